"""Trials of the effect finder: buildings with something hidden in them, and what was made of it."""

import time
from dataclasses import dataclass, replace

import numpy as np
import torch

from femupdate.arrays import Floats
from femupdate.building.frame import FrameBuilding
from femupdate.building.schema import Building
from femupdate.discrepancy.diagnose import Diagnosis, DiagnosisSettings
from femupdate.discrepancy.fit import Fit, extended, fit
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.score import score, starts
from femupdate.effects.effect import Effect, Placed
from femupdate.effects.registry import CATALOGUE
from femupdate.effects.structure import Structure
from femupdate.measurement.columns import BASE, Channel
from femupdate.measurement.frf import estimate_frf
from femupdate.measurement.observation import Observation
from femupdate.measurement.observation_file import Histories
from femupdate.progress import Progress
from femupdate.study import Study
from femupdate.workflow.diagnose import ModelParts, model_parts, prepared, refined, sought
from femupdate.workflow.effect_truth import FineModel, Truth, effect_truth, fine_model
from femupdate.workflow.model import StudyModel, damping_law, theta_prior, zeta_bounds
from femupdate.workflow.simulate import white_noise

from .outside import OUTSIDE

CLEAN, ONE, TWO, FOREIGN = "clean", "one", "two", "outside"
KINDS = (CLEAN, ONE, TWO, FOREIGN)
# Sampled in their own step of the pipeline, or not to be made in a time history.
_NOT_HIDDEN = ("noise_floor",)
_TRUTH_MESH = (
    0.4  # of the building's mesh size: finer than the finder's, and than what it learns of
)
_SIZES = (0.3, 2.5)  # times the prior's standard deviation


@dataclass(frozen=True)
class TrialSettings:
    """How the trials are measured.

    Attributes:
        duration_s, sampling_hz, rms_m_s2: of the base motion, white over the grid.
        sensor_noise_m_s2: rms on every channel.
        quantisation_m_s2: step of the recorder.
        mesh_size: m, of the truth of a frame; two fifths of the building's own where None.
        use_phase: whether phases are compared.
    """

    duration_s: float = 120.0
    sampling_hz: float = 200.0
    rms_m_s2: float = 0.3
    sensor_noise_m_s2: float = 0.003
    quantisation_m_s2: float = 5e-4
    mesh_size: float | None = None
    use_phase: bool = True


@dataclass(frozen=True, eq=False)
class KeptModels:
    """What all trials of a building share.

    Attributes:
        parts: of the finder's model.
        fine: of the truth.
    """

    parts: ModelParts
    fine: FineModel


def kept_models(
    study: Study, model: StudyModel, settings: TrialSettings, progress: Progress | None = None
) -> KeptModels:
    """Mesh the truth, and open the finder's model."""
    parts = model_parts(study, model, progress)
    building = model.building
    if not isinstance(building, FrameBuilding):
        return KeptModels(parts, fine_model(building, settings.mesh_size))
    size = settings.mesh_size or _TRUTH_MESH * building.mesh.size
    return KeptModels(parts, fine_model(building, size, building.sensors.points))


@dataclass(frozen=True)
class Trial:
    """One building with what is hidden in it.

    Attributes:
        number: seed of everything in it.
        kind: "clean", "one", "two" or "outside".
    """

    number: int
    kind: str


@dataclass(frozen=True)
class Outcome:
    """What the finder made of one trial; NaN or empty where a figure has no meaning.

    Attributes:
        number, kind: of the trial.
        hidden: labels of the effects that were hidden.
        strength: root of the chi2 that the first hidden effect explains beyond theta and zeta (D).
        absorbed: share of it that theta and zeta absorb.
        verdict, named: of the finder; `named` is its first label.
        ranking: labels of its findings, best first.
        twins: labels that it cannot tell the first from.
        log_evidence: of the first finding over the model without it.
        p_value: of the model as it is.
        size_true, size, size_sd: of the first hidden effect, when it was named.
        excess_removed: share of the chi2 beyond noise that the named effect removes.
        bias_before, bias_after: largest error of a stiffness factor in posterior sd.
        bias_share_before, bias_share_after: largest relative error of a stiffness factor.
        held_before, held_after, held_floor: error of histories in another motion; the last is
            that of the truth itself with its sensor noise.
        seconds: of the diagnosis, with the repair.
    """

    number: int
    kind: str
    hidden: tuple[str, ...]
    strength: float
    absorbed: float
    verdict: str
    named: str
    ranking: tuple[str, ...]
    twins: tuple[str, ...]
    log_evidence: float
    p_value: float
    size_true: float
    size: float
    size_sd: float
    excess_removed: float
    bias_before: float
    bias_after: float
    bias_share_before: float
    bias_share_after: float
    held_before: float
    held_after: float
    held_floor: float
    seconds: float


def run_trial(
    trial: Trial, model: StudyModel, settings: TrialSettings, kept: KeptModels
) -> Outcome:
    """Hide, measure, diagnose, add what is named, and compare with the truth.

    Args:
        trial: what is done.
        model: of the finder.
        settings: of the measurement.
        kept: what all trials of a building share.
    """
    torch.set_num_threads(1)
    building = model.building
    structure = kept.parts.plain.structure
    streams = np.random.default_rng([trial.number, KINDS.index(trial.kind)]).spawn(4)
    theta, zeta = _truth_parameters(building, streams[0])
    effects = _hide(trial.kind, building, structure, settings.use_phase, streams[1])
    truth = effect_truth(
        kept.fine, theta, effects, damping_law(building), building.frequency_grid.stop
    )
    observation = _measure(truth, zeta, building, settings, streams[2])
    started = time.monotonic()
    chosen = DiagnosisSettings(seed=trial.number)
    problem, base = prepared(model, kept.parts, observation, settings.use_phase, chosen)
    problem, base, found = sought(model, kept.parts, problem, base, chosen)
    hidden = tuple(placed.label for placed, _ in effects)
    strength, absorbed = _true_strength(problem, found, effects)
    named = found.leading.placed.label if found.leading and found.verdict != "none" else ""
    after = base
    if found.leading and found.verdict == "named":
        after = refined(model, kept.parts, problem, found.leading.fitted, alone=True)[1]
    seconds = time.monotonic() - started
    held = _held_out(truth, zeta, building, settings, (base, after), problem, streams[3])
    right = bool(hidden) and named == hidden[0] and found.leading is not None
    size, size_sd = _size(after, found, right)
    before_sd, before_share = _bias(base, theta, found.inflation)
    after_sd, after_share = _bias(after, theta, found.inflation)
    freedom = problem.effective - base.coordinates.size
    excess = base.chi2 - freedom
    removed = (base.chi2 - after.chi2) / excess if after is not base and excess > 0 else np.nan
    return Outcome(
        trial.number,
        trial.kind,
        hidden,
        strength,
        absorbed,
        found.verdict,
        named,
        tuple(one.placed.label for one in found.findings[:5]),
        found.twins,
        found.leading.evidence.log_evidence if found.leading else -np.inf,
        found.p_value,
        effects[0][1][0] if effects and effects[0][1] else np.nan,
        size,
        size_sd,
        removed,
        before_sd,
        after_sd,
        before_share,
        after_share,
        *held,
        seconds,
    )


def _truth_parameters(building: Building, rng: np.random.Generator) -> tuple[Floats, float]:
    """Stiffness factors in the inner part of the prior, and a damping ratio."""
    prior = theta_prior(building)
    low, high = prior.lower.numpy() * 1.5, prior.upper.numpy() / 1.5
    theta = np.exp(rng.uniform(np.log(low), np.log(high)))
    bounds = zeta_bounds(building)
    if bounds is None:
        return theta, float(building.damping.ratio)
    return theta, float(np.exp(rng.uniform(np.log(max(bounds[0], 0.008)), np.log(0.03))))


def _hide(
    kind: str,
    building: Building,
    structure: Structure,
    use_phase: bool,
    rng: np.random.Generator,
) -> tuple[tuple[Placed, tuple[float, ...]], ...]:
    """What is hidden: every kind of effect is equally likely, then every place of it."""
    if kind == CLEAN:
        return ()
    pool: list[Effect] = [
        effect
        for effect in (OUTSIDE if kind == FOREIGN else CATALOGUE.values())
        if effect.name not in _NOT_HIDDEN
        and not effect.needs_levels
        and effect.places(structure)
        and (use_phase or not effect.needs_phase)
    ]
    chosen = rng.choice(len(pool), size=2 if kind == TWO else 1, replace=False)
    hidden = []
    for index in chosen:
        effect = pool[index]
        places = effect.places(structure)
        place = places[rng.integers(len(places))]
        hidden.append((Placed(effect, place), _values(effect, structure, building, rng)))
    return tuple(hidden)


def _values(
    effect: Effect, structure: Structure, building: Building, rng: np.random.Generator
) -> tuple[float, ...]:
    if not effect.parameters:
        return ()
    size, *others = effect.parameters
    amount = size.scale * np.exp(rng.uniform(*np.log(_SIZES)))
    negative = size.upper <= size.neutral or (size.lower < size.neutral and rng.random() < 0.3)
    value = float(np.clip(size.neutral + (-amount if negative else amount), size.lower, size.upper))
    # An appendage is tuned somewhere in the lower half of the grid.
    first = structure.fundamental[0] / (2.0 * np.pi)
    highest = min(0.5 * building.frequency_grid.stop / first, 6.0)
    return (value, *(float(np.exp(rng.uniform(0.0, np.log(highest)))) for _ in others))


def _measure(
    truth: Truth,
    zeta: float,
    building: Building,
    settings: TrialSettings,
    rng: np.random.Generator,
) -> Observation:
    """FRFs by Welch's method of what the recorder wrote."""
    histories = _record(truth, zeta, building, settings, rng)
    grid = building.frequency_grid.frequencies_hz()
    return estimate_frf(histories, grid, truth.seen.direction)


def _record(
    truth: Truth,
    zeta: float,
    building: Building,
    settings: TrialSettings,
    rng: np.random.Generator,
) -> Histories:
    top = min(building.frequency_grid.stop, 0.44 * settings.sampling_hz)
    motion = white_noise(
        settings.duration_s, settings.sampling_hz, settings.rms_m_s2, (0.3, top), rng
    )
    exact = np.vstack([motion.acceleration, truth.respond(zeta, motion)])
    noisy = exact + settings.sensor_noise_m_s2 * rng.standard_normal(exact.shape)
    step = settings.quantisation_m_s2
    direction = truth.seen.direction
    base = Channel(BASE, BASE, "", direction)
    return Histories(
        motion.time_step, (base, *truth.seen.channels), step * np.round(noisy / step), "trial"
    )


def _true_strength(
    problem: Problem, found: Diagnosis, effects: tuple[tuple[Placed, tuple[float, ...]], ...]
) -> tuple[float, float]:
    """D of the first hidden effect, by fitting it, and how much of it theta absorbs."""
    if not effects:
        return 0.0, 0.0
    placed, values = effects[0]
    for one in found.findings:
        if one.placed.label == placed.label:
            gain = found.base.chi2 - one.fitted.chi2
            return float(np.sqrt(max(gain, 0.0))), one.score.absorbed
    test = score(problem, found.base, placed)
    start = values if values else starts(problem, placed)[0]
    known = np.concatenate([found.base.known, start])
    together = (*found.base.placed, placed)
    fitted = fit(problem, together, extended(problem, found.base, together, known))
    gain = found.base.chi2 - fitted.chi2
    return float(np.sqrt(max(gain, 0.0))), test.absorbed


def _size(after: Fit, found: Diagnosis, right: bool) -> tuple[float, float]:
    """Size of the leading effect and its standard deviation, where it is the hidden one."""
    if not right or found.leading is None:
        return np.nan, np.nan
    if found.verdict != "named" or not found.leading.placed.effect.parameters:
        return found.leading.size, found.leading.size_sd
    sizes, sd = after.sizes(found.inflation)
    first = len(sizes) - len(found.leading.placed.effect.parameters)
    return float(sizes[first]), float(sd[first])


def _bias(fitted: Fit, theta: Floats, inflation: float) -> tuple[float, float]:
    """Largest error of a stiffness factor in standard deviations, and relative."""
    mean, sd = fitted.theta(inflation)
    error = np.abs(mean - theta)
    return float((error / np.maximum(sd, 1e-12)).max()), float((error / theta).max())


def _held_out(
    truth: Truth,
    zeta: float,
    building: Building,
    settings: TrialSettings,
    fits: tuple[Fit, Fit],
    problem: Problem,
    rng: np.random.Generator,
) -> tuple[float, float, float]:
    """Relative error of predicted histories in another motion, before, after, and of noise."""
    from femupdate.dynamics.effect_history import effect_histories

    shorter = replace(settings, duration_s=0.5 * settings.duration_s)
    histories = _record(truth, zeta, building, shorter, rng)
    direction = truth.seen.direction
    rows: dict[str, list[int]] = {floor: [] for floor in building.floors}
    for row, channel in enumerate(histories.channels):
        if channel.floor != BASE and channel.direction == direction:
            rows[channel.floor].append(row)
    measured = np.stack([histories.acceleration[own].mean(axis=0) for own in rows.values()])
    size = float(np.sqrt((measured**2).mean()))
    errors = []
    for fitted in fits:
        predicted = next(
            effect_histories(
                fitted.system,
                fitted.theta()[0][None],
                np.array([fitted.zeta(problem.fixed_zeta)]),
                fitted.sizes()[0][None],
                histories.acceleration[0],
                histories.time_step,
                instruments=True,
            )
        ).floor_acceleration[0]
        errors.append(float(np.sqrt(((predicted - measured) ** 2).mean())) / size)
    return errors[0], errors[1], settings.sensor_noise_m_s2 / size
