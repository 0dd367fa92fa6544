"""One trial of the effect finder: a building with something hidden in it, and what comes of it."""

import time
from dataclasses import dataclass, replace

import numpy as np
import torch

from femupdate.arrays import Floats
from femupdate.building import FrameBuilding
from femupdate.discrepancy.findings import NAMED, PARTLY, Diagnosis
from femupdate.discrepancy.fit import Fit, extended, fit, settle
from femupdate.discrepancy.repair import mend
from femupdate.discrepancy.score import score, starts
from femupdate.discrepancy.search import FinderModel, refined
from femupdate.discrepancy.thresholds import DiagnosisSettings
from femupdate.dynamics import transformed_sensors
from femupdate.effects import Effect
from femupdate.errors import ReportError
from femupdate.inference.likelihood import Likelihood
from femupdate.progress import SILENT, Progress
from femupdate.simulation import fine_model
from femupdate.simulation.truth import FineModel, Truth
from femupdate.study import Study
from femupdate.workflow import StudyModel
from femupdate.workflow.diagnose import finder_model, search
from femupdate.workflow.kinds import Measured
from femupdate.workflow.likelihoods import data_of

from .draw import KINDS, TWO, draw_effects, draw_parameters
from .kinds import BASE, given, shown
from .measurement import (
    SHAKINGS,
    HiddenEffect,
    MeasuredBuilding,
    TrialSettings,
    floor_means,
)

# Of the building's mesh size: finer than the finder's, and than what it learns of.
_TRUTH_MESH = 0.4


@dataclass(frozen=True, eq=False)
class TrialModels:
    """What all trials of a building share."""

    model: StudyModel  # of the finder
    finder: FinderModel  # of that model
    fine: FineModel  # of the truth
    settings: TrialSettings  # of the measurement
    data: str = BASE  # what is measured, one of `kinds.DATA`

    def shows(self, effect: Effect) -> bool:
        """Whether the data show an effect."""
        return shown(effect, self.data)

    def measure(
        self, measured: MeasuredBuilding, truth: Truth, rng: np.random.Generator
    ) -> Measured:
        """What is measured of a building."""
        if self.data != BASE:
            return given(self.data, truth, measured.building, measured.zeta, rng)
        observation, halves = measured.observe(truth, rng)
        return Measured(base=replace(observation, halves=halves))


def trial_models(
    study: Study,
    model: StudyModel,
    settings: TrialSettings,
    progress: Progress = SILENT,
    data: str = BASE,
) -> TrialModels:
    """Mesh the truth, and open the finder's model."""
    building = model.building
    if data != BASE and isinstance(building, FrameBuilding):
        raise ReportError(
            f"{building.name}: trials with {data} data are made with sticks, and this is a frame;"
            " leave --data out or choose a shear building"
        )
    # Every trial has other stiffness factors: to keep its basis would help none.
    finder = replace(finder_model(study, model, progress), bases=None)
    if not isinstance(building, FrameBuilding):
        return TrialModels(model, finder, fine_model(building), settings, data)
    fine = fine_model(building, _TRUTH_MESH * building.mesh.size, building.sensors.points)
    return TrialModels(model, finder, fine, settings)


@dataclass(frozen=True)
class Trial:
    """One building with what is hidden in it."""

    number: int  # seed of everything in it
    kind: str  # "clean", "one", "two" or "outside"


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What the finder made of one trial; NaN or empty where a figure has no meaning."""

    # number, kind: of the trial
    number: int
    kind: str
    shaking: str  # of the base
    hidden: tuple[str, ...]  # labels of the effects that were hidden
    # Root of the chi2 that the first hidden effect explains beyond theta and zeta (D)
    strength: float
    absorbed: float  # share of it that theta and zeta absorb
    # verdict, named: of the finder; `named` is its first label
    verdict: str
    named: str
    pair: tuple[str, ...]  # labels of two that it tells together, the stronger first
    added: tuple[str, ...]  # labels that a repair adds, of two hidden effects alone
    beside: tuple[float, ...]  # D of each of two hidden effects beside the other
    ranking: tuple[str, ...]  # labels of its findings, best first
    twins: tuple[str, ...]  # labels that it cannot tell the first from
    log_evidence: float  # of the first finding over the model without it
    p_value: float  # of the model as it is
    # size_true, size, size_sd: of the first hidden effect, when it was named
    size_true: float
    size: float
    size_sd: float
    excess_removed: float  # share of the chi2 beyond noise that the named effect removes
    # bias_before, bias_after: largest error of a stiffness factor in posterior sd
    bias_before: float
    bias_after: float
    # bias_share_before, bias_share_after: largest relative error of a stiffness factor
    bias_share_before: float
    bias_share_after: float
    # held_before, held_after, held_floor: error of histories in another motion; the last is that of
    # the truth itself with its sensor noise
    held_before: float
    held_after: float
    held_floor: float
    seconds: float  # of the diagnosis, with the repair

    @property
    def detected(self) -> bool:
        """Whether the finder says that something is missing."""
        return self.verdict != "none"

    @property
    def named_right(self) -> bool:
        """Whether its first name is the first effect that was hidden, and the place is right."""
        return bool(self.hidden) and self.named == self.hidden[0]

    @property
    def in_first_three(self) -> bool:
        """Whether the first effect that was hidden is among the three it ranks highest."""
        return self.hidden[0] in self.ranking[:3]


@dataclass(frozen=True)
class _Found:
    """What the finder says, with the fits before and after it adds what it names."""

    problem: Likelihood
    before: Fit
    after: Fit
    added: tuple[str, ...]
    diagnosis: Diagnosis
    seconds: float


def run_trial(trial: Trial, models: TrialModels) -> Outcome:
    """Hide, measure, diagnose, add what is named, and compare with the truth."""
    torch.set_num_threads(1)
    building, settings = models.model.building, models.settings
    streams = np.random.default_rng([trial.number, KINDS.index(trial.kind)]).spawn(4)
    theta, zeta = draw_parameters(building, streams[0])
    structure = models.finder.plain.structure
    effects = draw_effects(trial.kind, building, structure, models.shows, streams[1])
    turn, which = divmod(trial.number, len(SHAKINGS))
    shaking, durations = SHAKINGS[which], settings.durations_s
    duration = durations[turn % len(durations)]
    measured = MeasuredBuilding(building, settings, theta, zeta, effects, shaking, duration)
    truth = measured.truth(models.fine)
    found = _find(trial, models, models.measure(measured, truth, streams[2]))
    diagnosis, leading = found.diagnosis, found.diagnosis.leading
    hidden = tuple(placed.label for placed, _ in effects)
    named = leading.placed.label if leading and diagnosis.verdict != "none" else ""
    strength, absorbed = _true_strength(found.problem, diagnosis, effects)
    size, size_sd = _size(found) if hidden and named == hidden[0] else (np.nan, np.nan)
    before, after = (_bias(one, theta) for one in (found.before, found.after))
    held = _held_out_errors(measured, truth, found, streams[3])
    return Outcome(
        number=trial.number,
        kind=trial.kind,
        shaking=shaking,
        hidden=hidden,
        strength=strength,
        absorbed=absorbed,
        verdict=diagnosis.verdict,
        named=named,
        pair=tuple(one.placed.label for one in diagnosis.pair),
        added=found.added,
        beside=_beside(found, effects),
        ranking=tuple(one.placed.label for one in diagnosis.findings[:5]),
        twins=diagnosis.twins,
        log_evidence=leading.log_evidence if leading else -np.inf,
        p_value=diagnosis.p_value,
        size_true=effects[0][1][0] if effects and effects[0][1] else np.nan,
        size=size,
        size_sd=size_sd,
        excess_removed=_excess_removed(found),
        bias_before=before[0],
        bias_after=after[0],
        bias_share_before=before[1],
        bias_share_after=after[1],
        held_before=held[0],
        held_after=held[1],
        held_floor=held[2],
        seconds=found.seconds,
    )


def _find(trial: Trial, models: TrialModels, seen: Measured) -> _Found:
    """Diagnose what was measured and add what is named."""
    model, finder = models.model, models.finder
    started = time.monotonic()
    chosen = DiagnosisSettings(seed=trial.number)
    data = data_of(seen, model.system)
    problem, diagnosis = search(finder, data, chosen, SILENT)
    base = diagnosis.base
    if trial.kind == TWO:
        done = mend(finder, problem, diagnosis, chosen, SILENT)[1]
        added = tuple(one.finding.placed.label for one in done.rounds)
        return _Found(problem, base, done.after, added, diagnosis, time.monotonic() - started)
    after = base
    if diagnosis.leading and diagnosis.verdict in (NAMED, PARTLY):
        after = refined(finder, problem, diagnosis.leading.fitted, alone=True)[1]
    return _Found(problem, base, after, (), diagnosis, time.monotonic() - started)


def _true_strength(
    problem: Likelihood, found: Diagnosis, effects: tuple[HiddenEffect, ...]
) -> tuple[float, float]:
    """D of the first hidden effect, by fitting it, and how much of it theta absorbs."""
    if not effects:
        return 0.0, 0.0
    placed, values = effects[0]
    for one in found.findings:
        if one.placed.label == placed.label:
            return _root(found.base.chi2 - one.fitted.chi2), one.score.absorbed
    test = score(problem, found.base, placed)
    start = values if values else starts(problem, placed)[0]
    known = np.concatenate([found.base.known, start])
    together = (*found.base.placed, placed)
    fitted = fit(problem, together, extended(problem, found.base, together, known))
    return _root(found.base.chi2 - fitted.chi2), test.absorbed


def _beside(found: _Found, effects: tuple[HiddenEffect, ...]) -> tuple[float, ...]:
    """D of each of two hidden effects beside the other, by fitting both and each alone."""
    if len(effects) < 2:
        return ()

    def squares(hidden: tuple[HiddenEffect, ...]) -> float:
        placed = tuple(one for one, _ in hidden)
        known = np.concatenate([np.asarray(values, dtype=float) for _, values in hidden])
        start = extended(found.problem, found.after, placed, known)
        return settle(found.problem, fit(found.problem, placed, start)).chi2

    both = squares(effects)
    return tuple(_root(squares((one,)) - both) for one in reversed(effects))


def _root(gain: float) -> float:
    return float(np.sqrt(max(gain, 0.0)))


def _size(found: _Found) -> tuple[float, float]:
    """Size of the leading effect and its standard deviation."""
    leading = found.diagnosis.leading
    if leading is None:
        return np.nan, np.nan
    if found.diagnosis.verdict not in (NAMED, PARTLY) or not leading.placed.effect.parameters:
        return leading.size, leading.size_sd
    sizes, sd = found.after.sizes()
    first = len(sizes) - len(leading.placed.effect.parameters)
    return float(sizes[first]), float(sd[first])


def _excess_removed(found: _Found) -> float:
    """Share of the chi2 beyond noise that what was added removes; NaN where nothing was."""
    excess = found.before.chi2 - (found.problem.effective - found.before.steps.size)
    if found.after is found.before or excess <= 0:
        return np.nan
    return (found.before.chi2 - found.after.chi2) / excess


def _bias(fitted: Fit, theta: Floats) -> tuple[float, float]:
    """Largest error of a stiffness factor in standard deviations, and relative."""
    mean, sd = fitted.theta()
    error = np.abs(mean - theta)
    return float((error / np.maximum(sd, 1e-12)).max()), float((error / theta).max())


def _held_out_errors(
    measured: MeasuredBuilding, truth: Truth, found: _Found, rng: np.random.Generator
) -> tuple[float, float, float]:
    """Relative error of predicted histories in another motion, before, after, and of noise."""
    histories = measured.record(truth, rng, share=0.5)
    floors = floor_means(histories, measured.building.floors, truth.fine.direction)
    size = float(np.sqrt((floors**2).mean()))
    errors = []
    for fitted in (found.before, found.after):
        sample = fitted.system, fitted.split, histories.acceleration[0], histories.time_step
        predicted = transformed_sensors(*sample)
        errors.append(float(np.sqrt(((predicted - floors) ** 2).mean())) / size)
    return errors[0], errors[1], measured.settings.sensor_noise_m_s2 / size
