"""calibrate: from an observation file to the posterior of the stiffness factors."""

import hashlib
import json
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import ndtr
from torch import Tensor

from femupdate import __version__
from femupdate.inference.bridge import BridgeResult, as_smc_result
from femupdate.inference.decoded_chains import DecodedPosterior, DecodedSettings
from femupdate.inference.hamiltonian import HamiltonianSettings, hamiltonian_draws
from femupdate.inference.identifiability import Identifiability
from femupdate.inference.laplace import LaplaceSettings, LaplaceStart, laplace_start
from femupdate.inference.latent_search import FoundLatent
from femupdate.inference.likelihood import DataLikelihood, LatentLikelihood, usual_misfit
from femupdate.inference.posterior import Posterior, save_posterior
from femupdate.inference.predictive_check import (
    PredictiveCheck,
    check_predictions,
    floor_squares,
    with_least_noise,
)
from femupdate.inference.prior import UniformPrior
from femupdate.inference.smc import SmcResult, SmcSettings, TemperedSmc
from femupdate.measurement.observation import Observation, independent_share, on_all_floors
from femupdate.study import Study
from femupdate.surrogate.storage import ANY_FLOORS, SurrogateInfo, TrainedSurrogate
from femupdate.workflow.decoded import FEW, sample_decoded
from femupdate.workflow.model import REDUCED, StudyModel
from femupdate.workflow.observed import ObservationSource, read_observation
from femupdate.workflow.progress import Progress, Silent
from femupdate.workflow.sampling import ChainRunner
from femupdate.workflow.summary import identified, write_summary
from femupdate.workflow.train import SURROGATE, find_surrogate, require_surrogate

Floats = NDArray[np.float64]

POSTERIOR = "posterior"
_CHAINS = 4
_PREDICTIVE = 200
_CHECKED = 100
# Posterior predictive p-value below which it is worth a word.
_UNUSUAL = 0.01
_ZETA_GRID = 25
_ZETA_SAMPLES = 48
# Effective share of draws from the Gaussians at the maxima below which chains take over, tried on
# so many draws.
_GAUSSIAN_ENOUGH, _TRIED = 0.1, 400
# Chains that run side by side: they share batches, and differ where they have not mixed.
_SIDE_BY_SIDE = 16
# Share of the noise that a decoder, corrected, may miss the building by where its chains are: more,
# and the corrections have not led to the posterior.
_DECODER_MAY_MISS = 0.25
# Noise of the data over that which a surrogate allows, below which it is worth a word: that of two
# runs together is.
_MUCH_LESS = 0.75


@dataclass(frozen=True)
class CalibrationSettings:
    """How to sample.

    Attributes:
        particles: in all; shared among independent runs.
        exact: data-space likelihood instead of the latent one.
        chains: independent runs, so that their agreement can be judged.
        seed: of the sampler.
        device: where the likelihood is evaluated.
        smc: settings of the sampler.
    """

    particles: int = 5000
    exact: bool = False
    chains: int = _CHAINS
    seed: int = 0
    device: str = "cpu"
    smc: SmcSettings = field(default_factory=SmcSettings)


@dataclass(frozen=True)
class CalibrationReport:
    """A posterior and what to make of it.

    Attributes:
        posterior: the draws.
        path: where they are stored.
        r_hat: (p,) potential scale reduction between the independent runs.
        identified: which combinations of the parameters the data have determined.
        misfit: mean squared whitened residual of ln|H| at the posterior draw that fits best; 1
            when the model explains the data to within their noise.
        check: posterior predictive p-values; None where theta carries errors of the model, with
            which no draw of it meets the data.
        notes: what the user should know, in sentences.
        pictures: files drawn.
        seconds: all the time taken.
        evaluations: of the likelihood.
        invalid: evaluations without a number.
    """

    posterior: Posterior
    path: Path
    r_hat: Floats
    identified: Identifiability
    misfit: float
    check: PredictiveCheck | None
    notes: tuple[str, ...]
    pictures: tuple[Path, ...]
    seconds: float
    evaluations: int
    invalid: int


def calibrate_study(
    study: Study,
    model: StudyModel,
    source: ObservationSource,
    settings: CalibrationSettings | None = None,
    progress: Progress | None = None,
) -> CalibrationReport:
    """Draw the posterior for an observation file; store it, and draw it.

    Raises:
        MeasurementError: the observation cannot be used.
        SurrogateError: no surrogate fits the building (latent likelihood).
        InferenceError: the sampler cannot go on.
    """
    show, settings = progress or Silent(), settings or CalibrationSettings()
    if model.building.effects and settings.exact:
        from femupdate.workflow.calibrate_effects import calibrate_with_effects

        return calibrate_with_effects(study, model, source, settings, show)
    if model.building.effects:
        from femupdate.workflow.effect_surrogate import with_effects

        require_surrogate(study, model)
        model = with_effects(study, model, show)
    started = time.monotonic()
    observation = read_observation(model, source)
    origin = {**model.made_from(), **source.made_from()}
    used = {"sensors": list(observation.floors), "band_hz": source.band_hz}
    settled = {**used, **_plain(settings)}
    run = ChainRunner(
        settings.particles,
        settings.chains,
        settings.seed,
        show,
        study.path("sampling"),
        json.dumps([origin, settled, _judged(study, observation)], sort_keys=True),
    )
    sample = _sample_exact if settings.exact else _sample_latent
    sampled = sample(study, model, observation, settings, run)
    results = sampled.results
    latent = None if model.shared is None else sampled.latent
    posterior = _posterior(model, observation, settings, results, latent)
    misfit, check = (
        _against_data(model, posterior, sampled.least_noise, settings.seed)
        if latent is None
        else (latent.misfit, None)
    )
    path = study.path("posterior.nc")
    save_posterior(posterior, path)
    study.record(
        POSTERIOR, "posterior.nc", "calibrate", origin, {**source.files_as_settings(), **settled}
    )
    run.clear()
    found = identified(posterior)
    notes = (
        *observation.notes,
        *sampled.notes,
        *_judgement(posterior, misfit, check),
        *found.sentences(),
    )
    write_summary(study, posterior, found, misfit, notes, check)
    pictures = draw_posterior(study, model, posterior, show)
    return CalibrationReport(
        posterior,
        path,
        r_hat(posterior.theta),
        found,
        misfit,
        check,
        notes,
        pictures,
        time.monotonic() - started,
        sum(result.evaluations for result in results),
        sum(result.invalid for result in results),
    )


def r_hat(theta: Floats) -> Floats:
    """Potential scale reduction (p,) of chains (c, n, p) (Gelman & Rubin 1992); NaN for one."""
    chains, draws = theta.shape[:2]
    if chains < 2:
        return np.full(theta.shape[-1], np.nan)
    within = theta.var(axis=1, ddof=1).mean(axis=0)
    between = theta.mean(axis=1).var(axis=0, ddof=1)
    return np.sqrt((draws - 1) / draws + between / within)


def draw_zeta(
    model: StudyModel, observation: Observation, theta: Floats, seed: int
) -> Floats | None:
    """Damping ratios (n,) for posterior draws theta (n, p), or None where the law is fixed.

    p(zeta | theta, x) by the data-space likelihood on a grid, averaged over some draws of theta:
    the height of the resonance peaks tells zeta almost regardless of theta. Where the model does
    not reach the data, the noise is taken as large as the misfit, so that zeta stays uncertain.
    """
    if model.zeta_bounds is None:
        return None
    rng = np.random.default_rng(seed)
    some = torch.from_numpy(theta[rng.permutation(len(theta))[:_ZETA_SAMPLES]])
    grid = torch.linspace(*model.zeta_bounds, _ZETA_GRID, dtype=torch.float64)
    likelihood = DataLikelihood(model.responder, model.law, observation)
    both = torch.cat([some.repeat_interleave(len(grid), 0), grid.repeat(len(some))[:, None]], dim=1)
    misfit = likelihood.misfit(both).reshape(len(some), len(grid))
    inflation = max(1.0, float(misfit.min()) / likelihood.terms.count)
    log_density = -0.5 * likelihood.terms.independent * misfit / inflation
    density = torch.softmax(log_density, dim=1).mean(dim=0).numpy()
    # Within a cell of the grid zeta is uniform.
    width = (model.zeta_bounds[1] - model.zeta_bounds[0]) / (_ZETA_GRID - 1)
    drawn = grid.numpy()[rng.choice(_ZETA_GRID, size=len(theta), p=density)]
    spread = drawn + width * (rng.random(len(theta)) - 0.5)
    return np.clip(spread, *model.zeta_bounds)


def latent_zeta(latent: FoundLatent, bounds: tuple[float, float], count: int, seed: int) -> Floats:
    """Damping ratios (n,) by the last coordinate of q(z|x)."""
    rng = np.random.default_rng(seed)
    found = latent.posterior
    which = rng.choice(len(found.log_weight), count, p=found.log_weight.exp().numpy())
    variance = torch.linalg.inv(found.precision)[:, -1, -1].numpy()
    z = found.mean[:, -1].numpy()[which] + np.sqrt(variance)[which] * rng.standard_normal(count)
    return bounds[0] + (bounds[1] - bounds[0]) * ndtr(z)


def predictive_log_frf(
    model: StudyModel, posterior: Posterior, count: int = _PREDICTIVE, seed: int = 0
) -> Floats:
    """ln|H| (n, f, k) of all floors at n posterior draws, measured or not."""
    from femupdate.dynamics.frf import log_frf
    from femupdate.dynamics.modal import modal_data

    theta, zeta = posterior.thinned(count, seed)
    ratio = zeta if zeta is not None else np.full(len(theta), model.building.damping.ratio)
    frequency = model.frequency_hz
    modal = modal_data(
        model.reduced, torch.from_numpy(theta), modes=40, top_frequency_hz=float(frequency[-1])
    )
    parts = [
        log_frf(modal[rows], frequency, model.law, torch.from_numpy(ratio[rows]))
        for rows in (slice(k, k + 50) for k in range(0, len(theta), 50))
    ]
    return torch.cat(parts).numpy()


def _predictive(study: Study, model: StudyModel, posterior: Posterior) -> Floats:
    if not model.building.effects:
        return predictive_log_frf(model, posterior)
    from femupdate.workflow.calibrate_effects import open_effects, predictive_with_effects

    ratio, grid = model.building.damping.ratio, model.frequency_hz.numpy()
    system = model.system or open_effects(study, model)
    return predictive_with_effects(system, posterior, ratio, grid, _PREDICTIVE)


def draw_posterior(
    study: Study, model: StudyModel, posterior: Posterior, show: Progress
) -> tuple[Path, ...]:
    """FRF fit, pair plot and intervals of a posterior."""
    from femupdate.report import plot_frf
    from femupdate.report.figure import save_figure
    from femupdate.report.plot_intervals import theta_intervals
    from femupdate.report.plot_posterior import SampleSet, posterior_pairs

    show.start("Drawing", 3)
    predicted = _predictive(study, model, posterior)
    low, high = np.quantile(predicted, [0.05, 0.95], axis=0)
    observation = on_all_floors(posterior.observation, model.building.floors)
    names = [_pretty(name) for name in posterior.names]
    bounds = np.column_stack([posterior.lower, posterior.upper])
    label = f"{', '.join(posterior.observation.floors)} ({posterior.likelihood} likelihood)"
    sets = [SampleSet(label, posterior.samples)]
    frf = plot_frf.frf_fit(
        observation.frequency_hz,
        model.building.floors,
        plot_frf.Prediction(predicted.mean(axis=0), low, high),
        plot_frf.Observation(observation.log_frf, observation.noise_sd, observation.valid),
    )
    paths = [save_figure(frf, study.path("pictures", "frf_fit.png"))]
    show.advance()
    pairs = posterior_pairs(sets, names, bounds)
    paths.append(save_figure(pairs, study.path("pictures", "posterior.png")))
    show.advance()
    intervals = theta_intervals(names, sets, bounds)
    paths.append(save_figure(intervals, study.path("pictures", "stiffness_factors.png")))
    show.advance()
    return tuple(paths)


@dataclass(frozen=True)
class Sampled:
    """What a sampler has drawn.

    Attributes:
        results: of the independent runs.
        notes: how it went, in sentences.
        latent: of the latent likelihood, where it was found by a search.
        least_noise: standard deviation of ln|H| below which the likelihood does not believe the
            file's noise.
    """

    results: list[SmcResult]
    notes: tuple[str, ...]
    latent: FoundLatent | None = None
    least_noise: float = 0.0


def _sample_latent(
    study: Study,
    model: StudyModel,
    observation: Observation,
    settings: CalibrationSettings,
    run: ChainRunner,
) -> Sampled:
    """Latent likelihood; by chains on the decoder where there are many parameters."""
    surrogate = require_surrogate(study, model)
    least = surrogate.info.noise_sd
    noise, calibration = (
        told(surrogate.info, observation) for told in (_noise_notes, _calibration_notes)
    )
    # The chains on the decoder know no effects.
    if model.prior.size > FEW and model.system is None:
        results, notes = _sample_decoded(surrogate, model, observation, settings, run)
        return Sampled(results, (*noise, *notes, *calibration), None, least)
    likelihood = LatentLikelihood(
        surrogate,
        model.responder,
        model.law,
        observation,
        device=settings.device,
        shared=model.shared,
    )
    sampler = TemperedSmc(model.prior.to(settings.device), likelihood, settings=settings.smc)
    results = run(sampler, "Sampling (latent likelihood)")
    notes = (*likelihood.input.notes, *noise, *_latent_notes(likelihood), *calibration)
    return Sampled(results, notes, likelihood.found, least)


def _sample_decoded(
    surrogate: TrainedSurrogate,
    model: StudyModel,
    observation: Observation,
    settings: CalibrationSettings,
    run: ChainRunner,
) -> tuple[list[SmcResult], tuple[str, ...]]:
    """Many parameters: chains on the decoder, with zeta as one more where it is a nuisance."""
    found = _decoded(surrogate, model, observation, settings, run)
    each = found.draws.gradients // len(found.draws.theta)
    results = [
        SmcResult(theta, value, np.nan, (), each, 0)
        for theta, value in zip(found.draws.theta, found.draws.log_likelihood, strict=True)
    ]
    usual = usual_misfit(observation)
    noise = max(float(np.median(observation.noise_sd[observation.valid])), surrogate.info.noise_sd)
    return results, (*_decoded_notes(found, noise), *_misfit_notes(found.misfit, usual))


def _decoded(
    surrogate: TrainedSurrogate,
    model: StudyModel,
    observation: Observation,
    settings: CalibrationSettings,
    run: ChainRunner,
) -> DecodedPosterior:
    """The decoder's posterior by chains, with zeta as one more parameter where it is unknown."""
    chosen = DecodedSettings()
    draws = max(-(-run.particles // chosen.chains), 2)
    run.show.start("Sampling (latent likelihood)", chosen.trajectories(draws))
    return sample_decoded(
        surrogate,
        model,
        observation,
        draws,
        settings.seed,
        chosen,
        device=settings.device,
        progress=run.show.advance,
    )


def _decoded_notes(found: DecodedPosterior, noise: float) -> tuple[str, ...]:
    """How chains on the decoder have gone, for a noise on ln|H|."""
    draws, maxima = found.draws, len(found.reached)
    notes = [
        f"{len(draws.theta)} chains of Hamiltonian Monte Carlo drew the decoder's posterior "
        f"({draws.acceptance:.0%} of their moves accepted); {found.responses:,} responses of the "
        f"reduced model corrected the decoder, from {found.decoder_error:.2g} to "
        f"{found.error:.2g} in ln|H| (rms)."
    ]
    if found.error > _DECODER_MAY_MISS * noise:
        notes.append(
            f"That is too much beside a noise of {noise:.2g}: do not trust this posterior; train "
            "on more samples, or use --exact."
        )
    if maxima > 1:
        notes.append(
            f"The searches that the chains start from ended in {maxima} maxima that count; a chain "
            "seldom goes from one to another, and their shares are those of Gaussians there."
        )
    return tuple(notes)


def _noise_notes(info: SurrogateInfo, observation: Observation) -> tuple[str, ...]:
    """Where the data are better than the surrogate believes."""
    typical = float(np.median(observation.noise_sd[observation.valid]))
    if typical >= _MUCH_LESS * info.noise_sd:
        return ()
    return (
        f"The latent likelihood allows ln|H| an error of {info.noise_sd:g} (noise and "
        f"idealisation), the data show a noise of {typical:.2g}: this posterior is wider than the "
        "data allow; --exact uses the file's noise.",
    )


def _latent_notes(likelihood: LatentLikelihood) -> tuple[str, ...]:
    """How the latent likelihood was found."""
    found = likelihood.found
    count = len(found.posterior.log_weight)
    return (
        f"The surrogate proposed, {found.responses:,} responses of the reduced model led to "
        + ("one solution." if count == 1 else f"{count} solutions."),
        *_misfit_notes(found.misfit, likelihood.usual_misfit),
    )


def _misfit_notes(misfit: float, usual: float) -> tuple[str, ...]:
    """Where the best response does not explain the data."""
    if misfit <= usual:
        return ()
    return (
        "The observation is unlike anything that this building can do: its best response "
        f"misses it by {np.sqrt(misfit):.2f} times the noise (rms), where 99.5 % of "
        f"simulations are missed by less than {np.sqrt(usual):.2f}; do not "
        "trust this posterior, use `femupdate diagnose`.",
    )


def _calibration_notes(info: SurrogateInfo, observation: Observation) -> tuple[str, ...]:
    """What simulations say about the posteriors of a surrogate."""
    notes, floors = [], observation.floors
    kept = info.calibration
    if kept:
        power = info.likelihood_power
        notes.append(
            f"On {kept['cases']} fresh simulations the 90 % region held "
            f"{kept['coverage_90_after']:.0%} of the truths"
            + (
                "."
                if power == 1.0
                else f", after the latent likelihood was raised to the power {power:.2f} "
                f"({kept['coverage_90_before']:.0%} before)."
            )
        )
    if kept and kept["floors"] != [ANY_FLOORS] and set(floors) != set(kept["floors"]):
        notes.append(
            f"That was checked for {', '.join(kept['floors'])}, not for {', '.join(floors)}; "
            "--exact needs no such check."
        )
    return tuple(notes)


def _sample_exact(
    study: Study,
    model: StudyModel,
    observation: Observation,
    settings: CalibrationSettings,
    run: ChainRunner,
) -> Sampled:
    """Data-space likelihood, with zeta as one more parameter where it is a nuisance.

    A building with a surrogate starts from the latent posterior, which saves most of the responses.
    """
    bounds = model.zeta_bounds
    prior = model.prior if bounds is None else model.prior.joined("zeta", *bounds)
    fixed = model.building.damping.ratio if bounds is None else None
    target = DataLikelihood(
        model.reduced,
        model.law,
        observation,
        fixed,
        device=settings.device,
        precision=torch.float32,
    )
    found, base = find_surrogate(study, model), None
    if prior.size > FEW:
        near = None
        if found is not None:
            near = _decoded(found[0], model, observation, settings, run).draws.theta[:, -1]
        return Sampled(*_sample_from_maxima(model, observation, settings, run, prior, target, near))
    if found is None:
        starts = run(
            TemperedSmc(prior, target, settings=settings.smc), "Sampling (data-space likelihood)"
        )
    else:
        size = model.prior.size
        latent = LatentLikelihood(
            found[0], model.reduced, model.law, observation, device=settings.device
        )

        def base(parameters: Tensor) -> Tensor:
            return latent(parameters[:, :size])

        starts = run(
            TemperedSmc(prior, base, settings=settings.smc), "Sampling (latent likelihood)"
        )
    results = run.bridge(prior, target, base, starts, settings.smc)
    return Sampled(
        [as_smc_result(result, start) for result, start in zip(results, starts, strict=True)],
        _cost(results, starts, base is not None),
    )


def _sample_from_maxima(
    model: StudyModel,
    observation: Observation,
    settings: CalibrationSettings,
    run: ChainRunner,
    prior: UniformPrior,
    target: DataLikelihood,
    near: Tensor | None,
) -> tuple[list[SmcResult], tuple[str, ...]]:
    """Many parameters: from Gaussians at the maxima of the posterior density, by chains where
    those are too crude. The maxima are looked for near draws of the latent posterior, if any."""
    fixed = model.building.damping.ratio if prior.size == model.prior.size else None
    exact = DataLikelihood(model.reduced, model.law, observation, fixed, device=settings.device)
    chosen = LaplaceSettings()
    run.show.start("Searching for maxima", chosen.evaluations(prior.size))
    start = laplace_start(prior, exact.residuals, settings.seed, chosen, run.show.advance, near)
    count = len(start.reached)
    found = (
        f"{sum(start.reached)} of {chosen.starts} searches ended in the one maximum that counts"
        if count == 1
        else f"searches from {chosen.starts} starts ended in {count} maxima that count"
    )
    if start.effective_share(target, _TRIED, settings.seed) < _GAUSSIAN_ENOUGH:
        results, how = _hamiltonian(run, prior, target, start)
    else:
        results, how = _around_maxima(run, prior, target, start, settings.smc)
    if near is not None:
        found += " (all from draws of the latent posterior)"
    return results, (
        f"The posterior was found by its maxima: {found}, after "
        f"{start.evaluations + _TRIED:,} responses; {how} A maximum that no search led to is "
        "missing.",
    )


def _around_maxima(
    run: ChainRunner,
    prior: UniformPrior,
    target: DataLikelihood,
    start: LaplaceStart,
    settings: SmcSettings,
) -> tuple[list[SmcResult], str]:
    """Importance sampling from the Gaussians, and what it took."""
    starts = []
    for chain in range(run.chains):
        theta = start.draw(run.each, run.seed_of(chain))
        starts.append(SmcResult(theta, start.log_likelihood(theta), 0.0, (), 0, 0))
    results = run.bridge(prior, target, start.log_likelihood, starts, settings)
    how = f"sampling took {sum(result.evaluations for result in results):,} more."
    if min(result.effective_share for result in results) <= 0.0:
        how = f"{how} {_TEMPERED}"
    return [as_smc_result(result, one) for result, one in zip(results, starts, strict=True)], how


def _hamiltonian(
    run: ChainRunner, prior: UniformPrior, target: DataLikelihood, start: LaplaceStart
) -> tuple[list[SmcResult], str]:
    """Chains from the maxima where the posterior is far from Gaussian, and what they took."""
    settings = HamiltonianSettings()
    draws = max(-(-run.particles // _SIDE_BY_SIDE), 2)
    run.show.start("Sampling (Hamiltonian Monte Carlo)", settings.warm_up + draws)
    result = hamiltonian_draws(
        prior, target, start, _SIDE_BY_SIDE, draws, run.seed, settings, run.show.advance
    )
    each = result.gradients // _SIDE_BY_SIDE
    parts = zip(result.theta, result.log_likelihood, strict=True)
    how = (
        f"the posterior bends too much for Gaussians, so {_SIDE_BY_SIDE} chains of Hamiltonian "
        f"Monte Carlo drew it, with {result.gradients:,} gradients ({result.acceptance:.0%} of "
        "their moves accepted); they give no evidence"
    )
    if len(start.reached) > 1:
        how += ", and the shares of separate maxima are those of their Gaussians"
    return [SmcResult(theta, value, np.nan, (), each, 0) for theta, value in parts], f"{how}."


_TEMPERED = (
    "Importance sampling did not reach this posterior: its draws are the tempered particles, "
    "and the spread of the runs is the only measure of their error."
)


def _cost(
    results: list[BridgeResult], starts: list[SmcResult], from_latent: bool
) -> tuple[str, ...]:
    """What the exact posterior took, beside what it would have taken without a surrogate."""
    responses = sum(result.evaluations for result in results)
    least = min(result.effective_share for result in results)
    sampled = sum(start.evaluations for start in starts)
    if not from_latent:
        text = f"The sampler took {sampled:,} responses, importance sampling {responses:,} more"
    else:
        text = (
            f"From the latent to the data-space posterior took {responses:,} responses; the "
            f"sampler, from the prior, evaluated the latent likelihood {sampled:,} times and would "
            "have needed more responses than that"
        )
    if least > 0.0:
        return (f"{text}; {least:.0%} of the importance draws are effective.",)
    return (
        f"{text}.",
        _TEMPERED,
    )


def _judged(study: Study, observation: Observation) -> list[str]:
    """Hashes of what a likelihood is made of: the data as read, reduced model and surrogate."""
    data = hashlib.sha256()
    for values in (observation.log_frf, observation.noise_sd, observation.valid):
        data.update(np.ascontiguousarray(values).tobytes())
    kept = study.artefacts()
    models = [kept[name].sha256 for name in (REDUCED, SURROGATE) if name in kept]
    return [__version__, data.hexdigest(), *models]


def _posterior(
    model: StudyModel,
    observation: Observation,
    settings: CalibrationSettings,
    results: list[SmcResult],
    latent: FoundLatent | None,
) -> Posterior:
    """The draws, with damping ratios.

    Where theta carries errors of the model no draw of it meets the data, and the damping ratio
    cannot be found from there: then it is the latent posterior's, `latent`.
    """
    drawn = np.stack([_numpy(result.theta) for result in results])
    size = model.prior.size
    theta, rest = drawn[..., :size], drawn[..., size:]
    if rest.shape[-1]:
        zeta: Floats | None = rest[..., 0]
    else:
        flat = (
            draw_zeta(model, observation, theta.reshape(-1, size), settings.seed)
            if latent is None or model.zeta_bounds is None
            else latent_zeta(latent, model.zeta_bounds, theta[..., 0].size, settings.seed)
        )
        zeta = None if flat is None else flat.reshape(theta.shape[:2])
    evidence = np.array([result.log_evidence for result in results])
    return Posterior(
        model.prior.names,
        theta,
        zeta,
        np.stack([_numpy(result.log_likelihood) for result in results]),
        model.prior.lower.numpy(),
        model.prior.upper.numpy(),
        "exact" if settings.exact else "latent",
        evidence if settings.exact and np.isfinite(evidence).all() else None,
        observation,
        _plain(settings),
    )


def _against_data(
    model: StudyModel, posterior: Posterior, least_noise: float, seed: int
) -> tuple[float, PredictiveCheck]:
    """Some posterior draws against the data: the smallest mean squared whitened residual, and the
    posterior predictive check, with the noise that the likelihood allows."""
    observation = posterior.observation
    theta, zeta = posterior.thinned(_CHECKED, seed)
    ratio = zeta if zeta is not None else np.full(len(theta), model.building.damping.ratio)
    likelihood = DataLikelihood(model.responder, model.law, observation)
    predicted = likelihood.predict(torch.from_numpy(theta), torch.from_numpy(ratio)).numpy()
    squares = floor_squares(observation, predicted).sum(axis=1)
    points = independent_share(observation) * np.count_nonzero(observation.valid)
    allowed = with_least_noise(observation, least_noise)
    return float(squares.min() / points), check_predictions(allowed, predicted)


def _judgement(
    posterior: Posterior, misfit: float, check: PredictiveCheck | None
) -> tuple[str, ...]:
    """How well the data are met, and whether the independent runs agree."""
    notes = []
    factor = np.sqrt(misfit)
    if misfit > 2.0:
        text = (
            f"The model misses the measured ln|H| by {factor:.1f} times its noise (rms, best "
            "draw): something is missing in the model"
        )
        if posterior.likelihood == "exact":
            text += ", and the standard deviations given are too small by about that factor"
        notes.append(text + ".")
    elif check is not None and check.whole < _UNUSUAL:
        share = f"{check.whole:.1%}" if check.whole >= 1e-3 else "Less than 0.1%"
        notes.append(
            f"{share} of data drawn from the posterior miss the model by as much as the measured "
            "ones do: something small is missing, or the noise is larger than stated."
        )
    worst = r_hat(posterior.theta)
    if np.isfinite(worst).all() and worst.max() > 1.05:
        notes.append(
            f"The independent runs differ (r-hat up to {worst.max():.2f}): use more particles."
        )
    return tuple(notes)


def _plain(settings: CalibrationSettings) -> dict[str, object]:
    """Settings as the study's record and the posterior keep them."""
    return {
        "particles": settings.particles,
        "chains": settings.chains,
        "seed": settings.seed,
        "exact": settings.exact,
        "ess_target": settings.smc.ess_target,
        "moves": settings.smc.moves,
        "walk_scale": settings.smc.walk_scale,
        "independence_moves": settings.smc.independence_moves,
    }


def _pretty(name: str) -> str:
    return name.replace("theta_", "θ")


def _numpy(tensor: Tensor) -> Floats:
    return tensor.detach().cpu().to(torch.float64).numpy()
