"""Adding what is missing, one effect a round, as long as the evidence carries it.

Data kept out of a repair say how well they are predicted before and after.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from femupdate.arrays import Floats
from femupdate.discrepancy.diagnose import denied, diagnose, with_pair
from femupdate.discrepancy.evidence import as_event, gain_elsewhere, mean_square, missed_in_turn
from femupdate.discrepancy.findings import (
    AMBIGUOUS,
    INDISTINGUISHABLE,
    NAMED,
    PARTLY,
    Diagnosis,
    Finding,
    others_than,
)
from femupdate.discrepancy.fit import Fit, Remains, about, extended, fit, settle
from femupdate.discrepancy.search import FinderModel, problem_of, refined, with_rest_about
from femupdate.discrepancy.thresholds import VERDICT, DiagnosisSettings
from femupdate.dynamics.history import transformed_sensors
from femupdate.inference.frf_data import FrfData
from femupdate.inference.likelihood import Data, Likelihood, ModelError, joint_error
from femupdate.measurement.observation import Histories
from femupdate.progress import SILENT, Progress

Elsewhere = Callable[[Likelihood, Fit, Fit], float]
"""Log density of data kept out by the second of two fits over that by the first."""


@dataclass(frozen=True, eq=False)
class Round:
    """One effect that was added: what was found, and sums of squared residuals."""

    finding: Finding
    chi2_before: float
    chi2_after: float

    def stands_in(self, points: float) -> bool:
        """Whether much of the misfit beyond the noise of so many points stayed."""
        beyond = max(self.chi2_before - points, 1.0)
        return self.chi2_before - self.chi2_after < VERDICT.most * beyond


@dataclass(frozen=True, eq=False)
class Repair:
    """A model before and after.

    Attributes:
        before: the model as it was, fitted.
        after: the model with all that was added, fitted; the same as before where nothing was.
        last: the diagnosis that ended it.
        left: what the model after still misses.
        problem: as the model after was fitted to it.
        refused: what the evidence carries, but data kept out do not, in the order it was tried.
    """

    before: Fit
    after: Fit
    rounds: tuple[Round, ...]
    last: Diagnosis
    left: Remains
    problem: Likelihood
    refused: tuple[Finding, ...] = ()

    @property
    def verdict(self) -> str:
        """ "repaired", or the verdict that forbade to add anything."""
        return "repaired" if self.rounds else self.last.verdict


def repair(
    problem: Likelihood,
    base: Fit,
    settings: DiagnosisSettings | None = None,
    progress: Progress = SILENT,
    renewed: Callable[[Likelihood, Fit], tuple[Likelihood, Fit]] | None = None,
    found: Diagnosis | None = None,
    elsewhere: Elsewhere | None = None,
) -> Repair:
    """Diagnose and add, at most four times, while an effect is certain.

    Whether noise alone leaves as much does not matter: with the error that every estimate is
    allowed, it always does on quiet records. An effect that competes with another, or that these
    sensors cannot tell from another, is added only where data kept out decide between them; else
    the engineer does.

    Args:
        base: the model as it is, fitted.
        renewed: makes the problem and the fit anew where an exchange of channels was added, which
            moves theta far; by default they stay.
        found: of the model as it is, with its pair, where it was diagnosed already.
        elsewhere: by default each half of the data is kept out in turn.
    """
    settings = settings or DiagnosisSettings()
    rounds: list[Round] = []
    refused: dict[str, Finding] = {}
    now, current = problem, base
    while True:
        if found is None:
            found = with_pair(diagnose(now, settings, current, progress), settings, progress)
        rivals = found.verdict in (AMBIGUOUS, INDISTINGUISHABLE) and elsewhere is not None
        certain = found.verdict in (NAMED, PARTLY)
        if not (certain or rivals) or len(rounds) == 4:
            break
        leading, worse = next_effect(now, found, settings, elsewhere)
        refused |= {finding.placed.label: finding for finding in worse}
        if leading is None:
            break
        # What was refused beside one effect may be right beside two.
        refused.pop(leading.placed.label, None)
        rounds.append(Round(leading, current.chi2, leading.fitted.chi2))
        current, found = leading.fitted, None
        if renewed is not None and leading.placed.exchange:
            now, current = renewed(now, current)
    current, rounds = without_needless(base, current, rounds)
    return Repair(
        base, current, tuple(rounds), found, current.remains(), now, tuple(refused.values())
    )


def without_needless(base: Fit, current: Fit, rounds: list[Round]) -> tuple[Fit, list[Round]]:
    """The model without what others have made needless, and the rounds that stay.

    Where a third effect imitates two, it may be the first that is added. Beside the two, nothing
    of it is left: it is not clear of nothing.
    """
    first, squares = len(base.known), base.chi2
    values, sizes, kept = current.known, list(base.known), list[Round]()
    for number, step in enumerate(rounds, start=len(base.placed)):
        part = slice(first, first + len(step.finding.placed.effect.parameters))
        first = part.stop
        if not _clear(current, number):
            continue
        sizes += list(values[part])
        kept.append(replace(step, chi2_before=squares))
        squares = step.chi2_after
    if len(kept) == len(rounds):
        return current, rounds
    if not kept:
        return base, kept
    problem, placed = current.likelihood, (*base.placed, *(step.finding.placed for step in kept))
    start = extended(problem, current, placed, np.array(sizes))
    return settle(problem, fit(problem, placed, start)), kept


def _clear(fitted: Fit, number: int) -> bool:
    """Whether an effect of a fit lies three standard deviations or more from none."""
    counts = [len(placed.effect.parameters) for placed in fitted.placed]
    if not counts[number]:
        return True
    at = sum(counts[: number % len(counts)])
    values, sd = fitted.sizes()
    away = values[at] - fitted.placed[number].effect.parameters[0].neutral
    return bool(abs(away) >= 3.0 * sd[at])


def next_effect(
    problem: Likelihood,
    found: Diagnosis,
    settings: DiagnosisSettings,
    elsewhere: Elsewhere | None = None,
) -> tuple[Finding | None, tuple[Finding, ...]]:
    """What is added, and what leads but predicts data kept out worse.

    Data kept out certify by themselves, also what the data alone would give no name, if it is clear
    of nothing. What all data together hold clearly likelier than the first goes before it.
    """
    if elsewhere is None:
        # The log density of the halves is certified already. Two at once are judged together.
        first, last = found.findings[0], [*found.findings[:1], *found.pair][-1]
        if first.placed.effect.instrument and first.tested is not None and first.tested.certified:
            # What is certain of an instrument is mended before the structure is judged by it.
            return first, ()
        worse = missed_in_turn(last.fitted) >= missed_in_turn(found.base)
        return (None, (first,)) if worse or not _clear(first.fitted, -1) else (first, ())
    base, rivals = found.base, 0
    if found.twins:
        labels = [finding.placed.label for finding in found.findings]
        rivals = 1 + max(labels.index(twin) for twin in found.twins)
        gains = [elsewhere(problem, base, finding.fitted) for finding in found.findings[:rivals]]
        evidence = [finding.log_evidence for finding in found.findings[:rivals]]
        totals = np.add(evidence, gains)
        second, best = np.argsort(totals)[-2:]
        clear = totals[best] - totals[second] > settings.margin(totals[best])
        if clear and gains[best] > 0.0 and _clear(found.findings[best].fitted, -1):
            return found.findings[best], ()
    accepted: list[tuple[float, Finding]] = []
    refused: list[Finding] = []
    for finding in found.findings[rivals:]:
        value = finding.log_evidence
        if value < VERDICT.positive or not finding.matters(settings):
            continue
        if not _clear(finding.fitted, -1) or denied(found, finding, settings):
            continue
        gain = elsewhere(problem, base, finding.fitted)
        certain = value >= settings.over_none
        least = float(np.log(len(found.scores) / settings.false_share))
        if certain:
            # What differs between events alone hides in their scatter.
            least = 0.0 if finding.placed.effect.needs_levels else VERDICT.clearly
        if gain > least and value + gain >= settings.over_none:
            accepted.append((value + gain, finding))
        elif certain:
            refused.append(finding)
    if not accepted:
        return None, tuple(refused)
    total = {id(finding): value for value, finding in accepted}
    first, *others = [finding for _, finding in accepted]
    best = max([first, *others_than(first, others)], key=lambda finding: total[id(finding)])
    lead = total[id(best)] - total[id(first)]
    return best if lead > settings.margin(total[id(best)]) else first, tuple(refused)


def as_fitted(done: Repair) -> Repair:
    """The rounds with the sizes, and the last with the squares, of the model after all of them.

    A model that was fitted anew at the end has moved the sizes on from where they were named.
    """
    rounds = [
        replace(step, finding=step.finding.within(done.after, number))
        for number, step in enumerate(done.rounds, start=len(done.before.placed))
    ]
    rounds[-1:] = [replace(step, chi2_after=done.after.chi2) for step in rounds[-1:]]
    return replace(done, rounds=tuple(rounds))


def mend(
    model: FinderModel,
    problem: Likelihood,
    found: Diagnosis,
    settings: DiagnosisSettings,
    progress: Progress,
    elsewhere: Elsewhere | None = None,
) -> tuple[Likelihood, Repair]:
    """What was added to a diagnosed model, and the problem on a basis about the last fit."""

    def renewed(now: Likelihood, fitted: Fit) -> tuple[Likelihood, Fit]:
        return refined(model, now, fitted, progress)

    done = repair(problem, found.base, settings, progress, renewed, found, elsewhere)
    mended, clear = done.problem, False
    while not clear and done.rounds and not done.rounds[-1].finding.placed.exchange:
        mended, last = refined(model, done.problem, done.after, progress, alone=True)
        # On a basis of its own a size may come closer to nothing.
        after, rounds = without_needless(done.before, last, list(done.rounds))
        clear, ended = after is last, done.last if rounds else found
        done = replace(done, after=after, rounds=tuple(rounds), left=after.remains(), last=ended)
    return mended, as_fitted(done)


@dataclass(frozen=True, eq=False)
class Held:
    """How well two models predict data that neither was fitted to.

    Attributes:
        compared: what of it, beside histories.
        figures: before and after: `error`, rms of the predicted less the measured floor
            accelerations over the rms of the measured, up to the highest fitted frequency;
            `own_error`, the same with stiffness and damping of the event itself, as no two have the
            same; both missing without histories of base motion; and `chi2`, mean squared whitened
            residual of what is compared.
        roof: its name; time (n,), s, and its measured motion and that before and after, m/s2, where
            there are histories.
    """

    name: str
    compared: str
    figures: Mapping[str, tuple[float, float]]
    roof: str
    histories: tuple[Floats, Floats, Floats, Floats] | None = None

    def lines(self) -> tuple[str, ...]:
        """How both models predict the data, and how with the event's own factors."""
        told = {name: f"{a:.3f} -> {b:.3f}" for name, (a, b) in self.figures.items()}
        before, after = self.figures["chi2"]
        agreement = f"{self.compared} (chi2 a point) {before:.1f} -> {after:.1f}"
        if "error" not in told:
            return (f"{self.name}, kept out: error of {agreement}",)
        return (
            f"{self.name}, kept out: error of the histories {told['error']}, of {agreement}",
            "with that event's own stiffness and damping: error of the histories "
            f"{told['own_error']}",
        )


@dataclass(frozen=True, eq=False)
class KeptOut:
    """Data that no model is fitted to.

    Attributes:
        data: as the finder judges them.
        level: of the data, in doublings above those that are fitted.
        histories: under base motion, where there are any.
    """

    name: str
    model: FinderModel
    data: tuple[Data, ...]
    floors: tuple[str, ...]
    level: float
    histories: Histories | None
    direction: str

    def gain(self, problem: Likelihood, before: Fit, after: Fit) -> float:
        """Their log density by the second of two fits over that by the first, as another event.

        No more than zero where they are not predicted better as the fits stand, too: what any event
        may make up for is no proof.
        """
        gained = gain_elsewhere(self._seen_by(problem, before), before, after)
        better = self.chi2(problem, after) < self.chi2(problem, before)
        return gained if better else min(gained, 0.0)

    def chi2(self, problem: Likelihood, fitted: Fit) -> float:
        """Mean squared whitened residual at the parameters of a fit."""
        return mean_square(self._seen_by(problem, fitted), fitted)

    def explained(self, problem: Likelihood, fits: Sequence[Fit]) -> float | None:
        """Share of their variation that the best of fits has as another event; None if unknown."""
        events = [self.fitted(problem, fitted) for fitted in fits]
        raws = [event.likelihood.raw(event.parameters) for event in events]
        shares = [event.likelihood.explained(raw) for event, raw in zip(events, raws, strict=True)]
        return max((share for share in shares if share is not None), default=None)

    def fitted(self, problem: Likelihood, fitted: Fit) -> Fit:
        """The model as of the event that the data show."""
        event = about(self._seen_by(problem, fitted), fitted)
        return settle(event, as_event(event.at_row(event.error.start), fitted))

    def _seen_by(self, problem: Likelihood, fitted: Fit) -> Likelihood:
        """The data as a problem of the structure of a fit, at their level of motion."""
        data, error = self._judged
        near, theta = fitted.system.model, fitted.theta()[0]
        data = with_rest_about(data, self.model.structure, near, theta)
        return replace(problem_of(problem.reduced, self.model.building, data), error=error)

    @cached_property
    def _judged(self) -> tuple[tuple[Data, ...], ModelError]:
        """The data at their level of motion, and their error: what it factorises serves all."""
        data = tuple(
            kind.at_level(self.level) if isinstance(kind, FrfData) else kind for kind in self.data
        )
        return data, joint_error(data)


def hold(kept: KeptOut, problem: Likelihood, done: Repair) -> Held:
    """Both models against data that neither has seen, at their level of motion.

    Raises:
        MeasurementError: a channel that the observation has is missing in the file.
    """
    modes = any(kind.name == "modes" for kind in kept.data)
    chi2 = kept.chi2(problem, done.before), kept.chi2(problem, done.after)
    compared = "frequencies, damping ratios and shapes" if modes else "ln|H|"
    held = Held(kept.name, compared, {"chi2": chi2}, kept.floors[-1] if kept.floors else "")
    data = kept.histories
    if data is None:
        return held

    _, measured, names = data.means(kept.direction)
    seen = measured[[names.index(floor) for floor in kept.floors]]
    base = data.inputs(kept.direction)
    rows = [problem.reduced.model.floors.index(floor) for floor in kept.floors]
    fits = [done.before, done.after]
    fits += [kept.fitted(problem, fitted) for fitted in fits]
    told = []
    for fitted in fits:
        values = (*fitted.system.at_level(*fitted.split, kept.level), fitted.split[2])
        told.append(transformed_sensors(fitted.system, values, base, data.time_step)[rows])
    top_hz = max((kind.top_hz for kind in kept.data if isinstance(kind, FrfData)), default=np.inf)
    fitted_to = np.fft.rfftfreq(seen.shape[1], data.time_step) <= top_hz
    spectra = [np.fft.rfft(floors)[:, fitted_to] for floors in (seen, *told)]
    norm = np.linalg.norm
    errors = [float(norm(other - spectra[0]) / norm(spectra[0])) for other in spectra[1:]]
    time = data.time_step * np.arange(seen.shape[1], dtype=np.float64)
    figures = {"error": (errors[0], errors[1]), "own_error": (errors[2], errors[3]), "chi2": chi2}
    return replace(held, figures=figures, histories=(time, seen[-1], told[0][-1], told[1][-1]))
