"""What calibrate tells the user of a posterior, in sentences."""

import numpy as np

from femupdate.effects.tolerances import TOLERANCES, key_of
from femupdate.inference.diagnostics import r_hat
from femupdate.inference.latent_likelihood import LatentLikelihood, usual_misfit
from femupdate.inference.model_error import WILD
from femupdate.inference.posterior import Posterior
from femupdate.measurement.observation import Observation, independent_share
from femupdate.surrogate.storage import ANY_FLOORS, SurrogateInfo
from femupdate.units import percent
from femupdate.workflow.calibrate_draws import Fitting
from femupdate.workflow.likelihoods import LEAST_EXPLAINED
from femupdate.workflow.model import StudyModel

# Two runs together have .71 of the noise of one.
_MUCH_LESS = 0.75  # of the allowed noise, below which the noise of the data is worth a word
_OVERSTATED = 0.5  # of the stated noise that the best draw misses, below which it is worth one
_FEW_WILD = 0.005  # share of points too far off to count
_UNUSUAL = 0.01  # p-value below which something is missing, where data also miss by
_BEYOND = 1.2  # times what is allowed for
_NEAR = 0.02  # of the prior, to either limit, within which a draw is at it
_PRESSED = 0.3  # share of the draws at a limit
_LARGE = 0.4  # ln|H|, error of a model beside which no interval of a per cent means anything


def elsewhere_warnings(
    model: StudyModel, observation: Observation, least: float, missed: float
) -> tuple[str, ...]:
    """Where even the likeliest draw of a population misses ln|H| by more than is known to be wrong.

    Known are the noise of the file, what the reduced model misses, and the width of the posterior:
    a draw of d parameters misses n points by d / n of the variance that is believed.

    Args:
        least: standard deviation of ln|H| that the likelihood believes at least.
        missed: by the likeliest draw (rms).
    """
    valid = observation.valid
    independent = independent_share(observation) * float(valid.sum())
    width = least**2 * model.parameters.size / max(independent, 1.0)
    noise = usual_misfit(observation) * float(np.square(observation.noise_sd[valid]).mean())
    known = float(np.sqrt(noise + model.reduction_error**2 + width))
    if missed <= known:
        return ()
    return (
        f"The likeliest draw misses ln|H| by {missed:.2g} (rms), where noise and reduced model "
        f"account for {known:.2g}: a better solution may have been missed, or the model lacks "
        "something. Compare with another --seed before you trust this posterior.",
    )


def reduction_warnings(model: StudyModel, observation: Observation) -> tuple[str, ...]:
    """Where the data are better than the reduced model."""
    typical = float(np.median(observation.noise_sd[observation.valid]))
    if model.reduction_error <= max(typical, model.least_noise):
        return ()
    return (
        f"The reduced model misses the full one by {model.reduction_error:.2g} in ln|H| (rms, at "
        f"the lowest damping), but the data show a noise of {typical:.2g}. This posterior is "
        "narrower than the model deserves.",
    )


def noise_notes(model: StudyModel, observation: Observation, least: float) -> tuple[str, ...]:
    """Where the data have less noise than the likelihood believes, `least` in ln|H|."""
    typical = float(np.median(observation.noise_sd[observation.valid]))
    if typical >= _MUCH_LESS * least:
        return ()
    if model.least_noise:
        return (
            f"The data show a noise of {typical:.2g} in ln|H|, but {least:g} is allowed for. "
            "Factors of kinds of members make up for what mesh and reduced model have wrong, and "
            "no data tell the two apart.",
        )
    return (
        f"The latent likelihood assumes an error of {least:g} in ln|H| (noise and "
        f"idealisation), but the data show a noise of {typical:.2g}. This posterior is wider than "
        "necessary; --exact uses the noise of the file.",
    )


def latent_notes(likelihood: LatentLikelihood) -> tuple[str, ...]:
    """How the latent likelihood was found."""
    found = likelihood.found
    count = len(found.log_weight)
    return (
        f"{found.responses:,} responses of the reduced model refined the surrogate's proposal to "
        + ("one Gaussian." if count == 1 else f"a mixture of {count} Gaussians."),
    )


def misfit_warnings(misfit: float, usual: float) -> tuple[str, ...]:
    """Where the best response does not explain the data."""
    if misfit <= usual:
        return ()
    return (
        "The observation is unlike anything that this building can do. The best response misses "
        f"it by {np.sqrt(misfit):.2f} times the noise (rms); in 99.5 % of simulations it is less "
        f"than {np.sqrt(usual):.2f}. Do not trust this posterior; use `femupdate diagnose`.",
    )


def calibration_notes(info: SurrogateInfo, observation: Observation) -> tuple[str, ...]:
    """How often posteriors of the surrogate contained the truth in simulations."""
    notes, floors = [], observation.floors
    kept = info.calibration
    if kept:
        power = info.likelihood_power
        notes.append(
            f"In {kept['cases']} simulations the 90 % region contained "
            f"{percent(kept['coverage_90_after'])} of the truths"
            + (
                "."
                if power == 1.0
                else f", after the latent likelihood was raised to the power {power:.2f} "
                f"({percent(kept['coverage_90_before'])} before)."
            )
        )
    if kept and kept["floors"] != [ANY_FLOORS] and set(floors) != set(kept["floors"]):
        notes.append(
            f"That was checked for {', '.join(kept['floors'])}, not for {', '.join(floors)}; "
            "--exact needs no such check."
        )
    return tuple(notes)


def judgement(posterior: Posterior, fitting: Fitting) -> tuple[str, ...]:
    """What decides whether a posterior can be used, the decisive first."""
    notes, check = [], fitting.check
    if fitting.explained is not None and fitting.explained < LEAST_EXPLAINED:
        notes.append(
            "The observation is unlike anything that this building can do: do not trust this."
        )
    missed = fitting.misfit > 2.0
    if missed:
        what = "the measured ln|H|" if posterior.observation.valid.any() else "what was measured"
        allowed = (
            "the intervals allow for it"
            if fitting.learned
            else "the standard deviations are too small by about that factor"
        )
        notes.append(
            f"The model misses {what} by {fitting.misfit**0.5:.1f} times its noise (rms, best "
            f"draw): something is missing in the model; {allowed}, and `femupdate diagnose` looks "
            "for it."
        )
    if wild := fitting.wild > _FEW_WILD:
        notes.append(
            f"{percent(fitting.wild, 1)} of the points are farther off than {WILD:g} "
            "standard deviations of noise and model error together: they count no more, neither "
            "for the parameters nor in the p-value."
        )
    # Where no error was learned, the first note says so already.
    new = fitting.learned or not (missed or wild)
    if new and check is not None and check.whole < _UNUSUAL and check.ratio**0.5 > _BEYOND:
        notes.append(
            f"The data miss the model by {check.ratio**0.5:.2g} times what is allowed for (noise "
            "and error of the model, rms): intervals are too narrow by about that factor."
        )
    notes += _at_limits(posterior)
    worst = r_hat(posterior.theta)
    if worst is not None and worst.max() > 1.05:
        notes.append(
            f"The independent runs differ (r-hat up to {worst.max():.2f}): use more particles."
        )
    return tuple(notes)


def error_notes(posterior: Posterior, of_forces: tuple[str, ...] = ()) -> tuple[str, ...]:
    """What is known of the error of the model."""
    if posterior.model_error is None:
        return of_forces
    return (posterior.model_error.sentence(posterior.observation), *of_forces)


def large_error(posterior: Posterior, fitting: Fitting) -> bool:
    """Whether the model errs by so much that its likeliest answer may lie outside the prior."""
    error = posterior.model_error
    far = error is not None and error.amplitude.size > _LARGE
    return fitting.misfit > 4.0 and (far or bool(_at_limits(posterior)))


def tolerance_notes(posterior: Posterior) -> tuple[str, ...]:
    """How much of the factors' intervals comes from what is known to a tolerance alone.

    Shares of variance by linear regression on the draws of each tolerance's parameters.
    """
    keys = np.array([key_of(name) for name in posterior.names])
    draws = posterior.samples - posterior.samples.mean(axis=0)
    factors = draws[:, : posterior.of("stiffness").samples.shape[1]]
    told = []
    for key, words in TOLERANCES.items():
        known = draws[:, keys == key]
        if known.size:
            fitted = known @ np.linalg.lstsq(known, factors, rcond=None)[0]
            shares = fitted.var(axis=0) / factors.var(axis=0)
            told.append(f"that of {words} {', '.join(percent(share) for share in shares)}")
    if not told:
        return ()
    return (f"Of the variances of the factors, by tolerances: {'; '.join(told)}.",)


def overstated_noise(fitting: Fitting, assumed: bool = False) -> tuple[str, ...]:
    """Where the model meets the data far better than their noise, stated or assumed, allows."""
    rms = fitting.misfit**0.5
    if not rms < _OVERSTATED:
        return ()
    noise = "the noise assumed for them" if assumed else "their stated noise"
    return (
        f"The best draw misses the data by {rms:.2g} times {noise} (rms): that noise is "
        f"{'too large' if assumed else 'overstated'}, and these intervals are wide rather than "
        "narrow.",
    )


def _at_limits(posterior: Posterior) -> list[str]:
    """Parameters that press against the limits of their prior, damping ratios too."""
    told = []
    for end in ("lower", "upper"):
        named, keys = [], []
        for at, entry in enumerate(posterior.parameters.entries):
            away = np.abs(posterior.values[..., at] - getattr(entry, end))
            if entry.free and (away < _NEAR * (entry.upper - entry.lower)).mean() > _PRESSED:
                named.append(f"{entry.called} ({getattr(entry, end):.3g})")
                keys += [entry.key] if entry.key else []
        if named:
            where = f" by {end} of {' and '.join(dict.fromkeys(keys))}" if keys else ""
            told.append(
                f"{', '.join(named)} press{'es' if len(named) == 1 else ''} against the prior's "
                f"{end} limit: widen the prior{where}, or look for what is missing in the model."
            )
    return told
