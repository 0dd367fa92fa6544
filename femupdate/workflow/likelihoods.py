"""The likelihood of all that was measured of a building, and where it is highest."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce

import numpy as np
import torch
from scipy.special import logsumexp
from torch import Tensor

from femupdate.building.document import Building
from femupdate.dynamics.system import System
from femupdate.effects.tolerances import tolerances_of
from femupdate.errors import MeasurementError
from femupdate.inference.frf_data import (
    MODES_KEPT,
    FrfData,
    forced_data,
    frf_data,
    that_says,
    together,
)
from femupdate.inference.importance import SamplerRun
from femupdate.inference.latent_search import FoundLatent
from femupdate.inference.likelihood import Data, Likelihood, cost_of_scatter, likelihood_of
from femupdate.inference.maxima import FEW, Settled, settled
from femupdate.inference.mode_data import ModeData, mode_data
from femupdate.inference.model_error import COARSE_ERROR, MODEL_ERROR, WILD, ErrorTable
from femupdate.inference.parameters import Parameters, damping_parameter, theta_prior
from femupdate.inference.posterior import DrawnBy
from femupdate.inference.smc import SmcSettings
from femupdate.measurement.modes import IdentifiedModes
from femupdate.measurement.observation import Observation
from femupdate.seeds import Seed, torch_generator
from femupdate.units import percent
from femupdate.workflow.kinds import Measured
from femupdate.workflow.model import StudyModel


@dataclass(frozen=True)
class CalibrationSettings:
    """How to sample.

    Attributes:
        particles: in all; shared among independent runs.
        exact: data-space likelihood instead of the latent one.
        chains: independent runs, so that their agreement can be judged.
        anyway: store a posterior even of an observation that is unlike the building.
    """

    particles: int = 5000
    exact: bool = False
    chains: int = 4
    seed: int = 0
    anyway: bool = False
    smc: SmcSettings = field(default_factory=SmcSettings)

    @property
    def each(self) -> int:
        """Particles of one run."""
        return max(self.particles // self.chains, 50)


@dataclass(frozen=True)
class Sampled:
    """What a sampler has drawn.

    Attributes:
        parameters: that the columns of their draws are.
        likelihood: of what was measured, with the errors of the model that the data show; on as
            few shapes as do about the draws.
        latent: of the latent likelihood, where it was found by a search.
        warnings: what whoever uses the draws should know, in sentences.
    """

    runs: list[SamplerRun]
    parameters: Parameters
    drawn: DrawnBy
    notes: tuple[str, ...]
    likelihood: Likelihood
    latent: FoundLatent | None = None
    warnings: tuple[str, ...] = ()

    @property
    def theta(self) -> Tensor:
        """Draws (n, p) of all runs."""
        return torch.cat([run.theta for run in self.runs])


def drawn_by(
    likelihood: str, way: str, runs: Sequence[SamplerRun], *, evidence: bool = True
) -> DrawnBy:
    """What independent runs, one at least, say of how they were drawn.

    The error of their mean evidence is that of their weights; without weights, of their spread.
    """
    known = np.array([run.log_evidence for run in runs])
    weighted = all(run.effective > 0.0 for run in runs)
    error = None
    if weighted:
        error = float(np.linalg.norm([run.log_evidence_error for run in runs]) / len(runs))
    elif len(runs) > 1:
        error = float(known.std(ddof=1) / len(runs) ** 0.5)
    return DrawnBy(
        likelihood=likelihood,
        way=way,
        chains=len(runs),
        evaluations=sum(run.evaluations for run in runs),
        effective_sample_size=sum(run.effective for run in runs) if weighted else None,
        log_evidence=float(logsumexp(known) - np.log(len(known))) if evidence else None,
        log_evidence_error=error if evidence else None,
    )


def plain_settings(settings: CalibrationSettings) -> dict[str, object]:
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


def unserved(building: Building) -> str:
    """Why no surrogate can serve a building, in words; empty where one can."""
    if building.effects:
        return "lists effects"
    if tolerances_of(building):
        return "states tolerances"
    if building.has_dashpots:
        return "has dashpots"
    count = theta_prior(building).size + damping_parameter(building).free
    return f"has {count} parameters" if count > FEW else ""


LEAST_EXPLAINED = 0.25
"""Share of the measured variation below which a model explains nothing."""


def smooth_likelihood(model: StudyModel, measured: Measured) -> Likelihood:
    """The likelihood of all that was measured, the errors of the model not yet known.

    By all modes in double precision, which makes it smooth in the parameters. Phases count where
    an effect of the model shows in nothing else.
    """
    phase = any(place.effect.needs_phase for place in model.system.placed)
    forces = data_of_forces(measured, model.system, use_phase=phase)
    modes = data_of_modes(measured, model.system, damping=model.damping.free)
    others: tuple[Data, ...] = (*forces, *modes)
    if not measured.has_base:
        return likelihood_of(others, model.system, model.parameters)
    if any(measured.levels):
        base = base_data(measured.runs, model.system, phase)
        cost = 0.0
    else:
        base = base_data([measured.base], model.system, phase)
        base = base if phase else base.as_logs(model.system, modes=None)
        cost = cost_of_scatter(measured.base, base)
    # Of what the reduced model is known to miss, the data say nothing.
    least = model.reduction_error * base.independent**0.5
    base = replace(base, sd=base.sd.clamp_min(least))
    whole = likelihood_of((base, *others), model.system, model.parameters, cost)
    return replace(whole, known=model.shared)


def base_data(
    records: Iterable[Observation], system: System, use_phase: bool, table: ErrorTable = MODEL_ERROR
) -> FrfData:
    """FRFs under base motion of one record or several, each at its level and with its halves."""

    def read(one: Observation) -> FrfData:
        halves = tuple(read(replace(half, level=one.level, halves=())) for half in one.halves)
        seen, floors = that_says(one), system.floors
        return frf_data(seen, floors, use_phase=use_phase, halves=halves, table=table)

    return reduce(together, map(read, records))


def on_fewer_modes(likelihood: Likelihood) -> Likelihood:
    """The same with responses under base motion in single precision, by the modes that count."""
    base = likelihood.base
    if base is None or base.logs is None:
        return likelihood
    modes = None if likelihood.system.placed else MODES_KEPT
    fast = replace(base.logs, modes=modes, precision=torch.float32)
    return replace(likelihood, data=(replace(base, logs=fast), *likelihood.data[1:]))


def data_of_forces(
    measured: Measured,
    system: System,
    *,
    use_phase: bool = False,
    table: ErrorTable = MODEL_ERROR,
) -> tuple[FrfData, ...]:
    """Responses to forces, each at its level."""
    floors, rest = system.floors, measured.rest
    return tuple(
        forced_data(response, floors, rest, use_phase=use_phase, table=table).at_level(
            response.level
        )
        for response in measured.forced
    )


def data_of_modes(
    measured: Measured, system: System, *, damping: bool = True
) -> tuple[ModeData, ...]:
    """Every file of identified modes; `damping`: whether their damping ratios count."""
    several = len(measured.modes) > 1
    return tuple(
        mode_data(
            table, system, measured.errors, damping=damping, source=table.source if several else ""
        )
        for table in measured.modes
    )


def data_of(measured: Measured, system: System) -> tuple[Data, ...]:
    """What is to be explained, one entry a kind: records under base motion as one, forces, modes.

    Raises:
        InferenceError: more modes are identified than the model has.
    """
    runs = measured.runs if any(measured.levels) else (measured.base,)
    base = [base_data(runs, system, True, COARSE_ERROR)] if measured.has_base else []
    forces = data_of_forces(measured, system, use_phase=True, table=COARSE_ERROR)
    return (*base, *forces, *data_of_modes(measured, system))


def without_foreign_modes(model: StudyModel, measured: Measured) -> Measured:
    """Without a mode that fits none of the model's where the others fit without it, which is told.

    Their figures must be more than the stiffness factors, or any of them could be left out.

    Raises:
        MeasurementError: frequencies fit the model as circular ones, or as periods.
    """

    def fitted(modes: IdentifiedModes) -> tuple[float, ModeData, Tensor]:
        """What the model errs by, in ln of frequencies, and by which parameters (1, p)."""
        (data,) = data_of_modes(replace(measured, modes=(modes,)), model.system)
        found = settled(likelihood_of((data,), model.system, model.parameters), 0)
        error = found.likelihood.error.parts[0].levels[found.likelihood.row[0]].own
        return error, data, model.parameters.from_normal(found.found.z[:1])

    def missed_by(data: ModeData, best: Tensor) -> Tensor:
        """Residuals (n,) of parameters (1, p) of a model that errs by 1 %."""
        values = model.parameters.split(best)
        known = model.system, values.theta, values.zeta, values.sizes
        return data.coarse(0.01).compared(data.predicted(*known))[0].abs()

    kept, said = [], []
    for modes in measured.modes:
        kept.append(modes)
        count = len(modes.names)
        if model.parameters.size > FEW:
            continue
        error, data, _ = fitted(modes)
        if error > 0.05:
            turned = {"rad/s": modes.frequency_hz / (2.0 * np.pi), "s": 1.0 / modes.frequency_hz}
            for unit, frequency in turned.items():
                off, same, best = fitted(replace(modes, frequency_hz=frequency))
                if off <= 0.01 and bool((missed_by(same, best) < WILD).all()):
                    name = "frequency (rad/s)" if unit == "rad/s" else "period (s)"
                    raise MeasurementError(
                        f"{modes.source}: the frequencies fit {model.building.name} in {unit}, but "
                        f"not in Hz; write {name} above their column, or correct them"
                    )
        foreign = []
        for number in range(count) if error > 0.05 and count > 2 else ():
            rest = modes.some([k for k in range(count) if k != number])
            off, others, best = fitted(rest)
            residual = missed_by(data, best)
            shape = residual[2 * count :].view(count, -1)[number]
            away = float(torch.cat([residual[number::count][:2], shape]).max())
            enough = others.effective - others.freedom[1] > model.prior.size
            if enough and off <= 0.01 and away > WILD:
                foreign.append((rest, number, away))
        if len(foreign) == 1:
            kept[-1], number, away = foreign[0]
            said.append(
                f"{modes.source}: mode {modes.names[number]} at {modes.frequency_hz[number]:.4g} "
                f"Hz is left out. It fits no mode of the model ({away:.0f} standard deviations "
                "off), and the others fit without it."
            )
    return replace(measured, modes=tuple(kept), left_out=tuple(said))


def beyond_prior(
    model: StudyModel, measured: Measured, best: Tensor, settings: CalibrationSettings
) -> tuple[str, ...]:
    """Whether parameters outside the prior meet the data far better than the best (1, p) inside."""
    likelihood = smooth_likelihood(model, measured)
    wider = Parameters(tuple(entry.widened() for entry in likelihood.prior.entries))
    found = settled(replace(likelihood, prior=wider), settings.seed)
    points = torch.cat([best, wider.from_normal(found.found.z)])
    density = likelihood(points)
    at = int(density.nan_to_num(nan=-torch.inf).argmax())
    named, keys = _outside(likelihood.prior, points[at])
    if not named or float(density[at] - density[0]) < 10.0:  # nats
        return ()
    cure = f"change {keys} in the building file."
    if measured.doubts:
        cure = f"{measured.doubts[0]} Else {cure}"
    return (
        f"The prior is too narrow: the model meets the data far better with {named}. "
        f"Do not trust these intervals; {cure}",
    )


def _outside(prior: Parameters, point: Tensor) -> tuple[str, str]:
    """Which parameters (p,) lie outside a prior, and the keys of the limits."""
    named, keys = [], []
    for entry, value in zip(prior.entries, point.tolist(), strict=True):
        if not entry.lower <= value <= entry.upper:
            end = "lower" if value < entry.lower else "upper"
            named.append(f"{entry.called} near {value:.3g} ({end} limit {getattr(entry, end):.3g})")
            keys.append(f"{end} of {entry.key}")
    return ", ".join(named), " and ".join(dict.fromkeys(keys))


def settled_likelihood(
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    starts: Tensor | None = None,
    seed: Seed = 0,
) -> Settled:
    """The maxima of the likelihood, and the errors of the model that count there.

    Args:
        starts: (s, p) parameters, one at least near every maximum; by default likely points of
            the prior.

    Raises:
        MeasurementError: the observation is unlike anything that the building can do.
    """
    likelihood = smooth_likelihood(model, measured)
    found = settled(likelihood, seed, starts)
    points, likelihood = likelihood.prior.from_normal(found.found.z), found.likelihood
    if settings.anyway or likelihood.base is None:
        return found
    explained = likelihood.explained(likelihood.raw(points))
    assert explained is not None
    if not explained >= LEAST_EXPLAINED:
        # Where an error of the model explains more than the response, others may look more like it.
        likely = likelihood.prior.sample(512, torch_generator(0))
        explained = max(likelihood.explained(likelihood.raw(likely)) or 0.0, explained)
    if not explained >= LEAST_EXPLAINED:  # which no number is not
        # Damage may have taken it out of the prior.
        wider = Parameters(tuple(entry.widened() for entry in likelihood.prior.entries))
        beyond = wider.from_normal(settled(replace(likelihood, prior=wider), 0).found.z)
        each = [likelihood.explained(raw[None]) or 0.0 for raw in likelihood.raw(beyond)]
        at = int(np.argmax(each))
        named, keys = _outside(likelihood.prior, beyond[at])
        if named and each[at] >= LEAST_EXPLAINED:
            raise MeasurementError(
                f"the prior of {model.building.name} is too narrow for the observation: the best "
                f"response has {percent(each[at])} of its variation with {named}. If the building "
                f"was damaged, change {keys} in its file; then `femupdate compare` says "
                "what changed"
            )
        best = 0.0 if explained != explained else max(explained, 0.0)
        check = "check that the file belongs to the building, its units and directions"
        raise MeasurementError(
            f"the observation is unlike anything that {model.building.name} can do: its best "
            f"response has {percent(best)} of the measured variation over frequency "
            f"(--anyway keeps it): {measured.doubts[0].rstrip('.') if measured.doubts else check}"
        )
    return found
