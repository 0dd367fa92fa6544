"""What is missing: every effect tested, the leading ones fitted, their evidence weighed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

from femupdate.arrays import Floats
from femupdate.discrepancy.certify import Tested, certify
from femupdate.discrepancy.consequence import Consequence, consequence
from femupdate.discrepancy.evidence import Evidence, laplace, sampled
from femupdate.discrepancy.exchange import exchange_fits
from femupdate.discrepancy.fit import (
    Begun,
    Fit,
    about,
    extended,
    fit,
    fit_baseline,
    glance,
    log_posterior,
    narrowed,
    nearest,
    settle,
)
from femupdate.discrepancy.further_measurements import MeasurementValue, measurement_values
from femupdate.discrepancy.observability import same_to_sensors, unobservable_effects
from femupdate.discrepancy.remains import Remains, remains
from femupdate.discrepancy.residual_map import Cell, p_value, residual_cells
from femupdate.discrepancy.score import Score, candidates, score, without_phase
from femupdate.discrepancy.thresholds import FIT, VERDICT, DiagnosisSettings
from femupdate.effects.effect import Placed
from femupdate.inference.likelihood import Likelihood
from femupdate.progress import SILENT, Progress, counted
from femupdate.units import percent
from femupdate.workers import in_threads

T = TypeVar("T")

NONE, NAMED, PARTLY, AMBIGUOUS = "none", "named", "partly", "ambiguous"
INDISTINGUISHABLE, UNKNOWN = "indistinguishable", "unknown"
STANDS_IN = "Most of the misfit stays: what is named may stand in for what else is missing."


@dataclass(frozen=True, eq=False)
class Finding:
    """One candidate after fitting.

    Attributes:
        placed: effect and place.
        score: its score test.
        fitted: the model with it.
        evidence: over the model without it.
        changes: what it does to frequencies and responses.
        tested: on data to which it was not fitted; None where it was not.
        size, size_sd: of its first parameter.
    """

    placed: Placed
    score: Score
    fitted: Fit
    evidence: Evidence
    changes: Consequence
    tested: Tested | None
    size: float
    size_sd: float

    def matters(self, settings: DiagnosisSettings) -> bool:
        """Whether an engineer would notice what it changes."""
        return self.changes.matters(settings.least_frequency, settings.least_response)

    @property
    def large_enough(self) -> bool:
        """Whether anybody would look for an effect of this size."""
        own = self.placed.effect.parameters
        return not own or abs(self.size - own[0].neutral) >= own[0].least

    def needed(self, settings: DiagnosisSettings) -> float:
        """Log evidence that a name needs.

        An instrument's effect that the halves of the data certify needs little more: where the
        model itself errs, its error may take the place of a delay or a gain.
        """
        certified = self.tested is not None and self.tested.certified
        instrument = self.placed.effect.instrument
        return VERDICT.positive if instrument and certified else settings.over_none

    def carried(self, settings: DiagnosisSettings) -> bool:
        """Whether the evidence carries it, on data to which it was not fitted too."""
        enough = self.evidence.log_evidence >= self.needed(settings)
        return enough and (self.tested is None or self.tested.certified)

    @property
    def in_words(self) -> str:
        """Effect, place and size: "3F carries 9.8 % more mass than modelled (± 0.3 %; 2.1 t)"."""
        effect = self.placed.effect
        said = effect.said(self.placed.place, self.size)
        if not effect.parameters:
            return said
        mass = "" if self.mass is None else f"; {mass_in_words(self.mass)}"
        return f"{said} ({effect.scatter(self.size, self.size_sd)}{mass})"

    @property
    def mass(self) -> float | None:
        """What it adds, kg; None where it adds none, or the model's masses are nominal."""
        if self.fitted.likelihood.reduced.structure.building.forces_are_relative:
            return None
        own = self.fitted.system.terms[-1].mass
        return None if own is None else self.size * float(own.rigid[0, 0])


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Where the model fails and what could be missing.

        >>> import femupdate
        >>> found = femupdate.diagnose("house", "run.csv", building="shear_3dof").diagnosis
        >>> found.verdict
        'none'

    Attributes:
        base: the model as it is, at its most probable parameters.
        p_value: of noise alone leaving its residuals.
        verdict: "none", "named" (certain, and nothing of note is left), "partly" (certain, and
            something else is missing), "ambiguous", "indistinguishable" or "unknown".
        findings: fitted candidates, the most probable first.
        scores: all score tests, the strongest first.
        unobservable: labels of effects that these sensors could not show.
        residuals: of the model as it is, by floor and band.
        twins: labels that the leading finding cannot be told from.
        left: what the model misses, with the effect where one is named, or with both of a pair.
        worth: of further measurements, the best first, where the first is not told from its twins.
        sentence: the verdict for an engineer.
        pair: two that explain together what the best alone does not, the stronger first, with the
            sizes that they have together; empty where none was sought or found.
    """

    base: Fit
    p_value: float
    verdict: str
    findings: tuple[Finding, ...]
    scores: tuple[Score, ...]
    unobservable: tuple[str, ...]
    residuals: tuple[Cell, ...]
    twins: tuple[str, ...]
    left: Remains
    worth: tuple[MeasurementValue, ...]
    sentence: str
    pair: tuple[Finding, ...] = ()

    @property
    def leading(self) -> Finding | None:
        """The most probable finding."""
        return self.findings[0] if self.findings else None

    @property
    def close(self) -> tuple[Finding, ...]:
        """The leading findings between which the error of a basis for all effects may decide."""
        if self.leading is None or self.verdict in (NONE, UNKNOWN):
            return ()
        value = self.leading.evidence.log_evidence
        least = value - max(VERDICT.close * value, VERDICT.close_by)
        near = [one for one in self.findings if one.evidence.log_evidence > least]
        return tuple(near[: VERDICT.closest])

    def would_decide(self, settings: DiagnosisSettings) -> tuple[str, ...]:
        """Sentences on what would decide, where the first is not told from its twins.

        Args:
            settings: of the diagnosis, with what a name needs over the runner-up.
        """
        if not self.twins or self.leading is None:
            return ()
        found, needed = [], settings.margin(self.leading.evidence.log_evidence)
        enough = [one for one in self.worth if one.log_evidence >= needed]
        if enough:
            best = "; ".join(
                f"{one.what} ({one.log_evidence:.0f})" for one in enough[: VERDICT.shown]
            )
            found.append(f"Measured as well, it would decide (log evidence to expect): {best}.")
        elif self.worth:
            found.append(
                "No further floor would decide, measured as well as these: the most to expect is a "
                f"log evidence of {self.worth[0].log_evidence:.1f}, from {self.worth[0].what}."
            )
        placed = [one.placed for one in self.findings if one.placed.label in self.twins]
        for one in [self.leading.placed, *placed[: VERDICT.compared]]:
            found.append(f"Without the model, {one.label} is settled by {one.effect.settled_by}.")
        return tuple(found)


def diagnose(
    problem: Likelihood,
    settings: DiagnosisSettings | None = None,
    base: Fit | None = None,
    progress: Progress = SILENT,
    distant: Fit | None = None,
    among: frozenset[str] | None = None,
) -> Diagnosis:
    """Find where a model fails, and rank what could be missing.

    Args:
        problem: the likelihood of the data.
        settings: thresholds.
        base: the model so far, fitted; by default that without effects.
        progress: advances by one a step, with a note of what is being done.
        distant: with one effect more, at a theta from where all are fitted as well.
        among: labels of the only candidates that are fitted; None for the leading ones.
    """
    chosen = settings or DiagnosisSettings()
    progress.advance(note="fitting the model as it is")
    if base is None:
        base = fit_baseline(problem, seed=chosen.seed)[0]
    if not problem.error.knows:
        problem = about(problem, base)
    base = narrowed(settle(problem, base))
    problem = base.likelihood
    progress.advance(note="testing every effect")
    scores = _scored(problem, base)
    unobservable = (
        *unobservable_effects(problem, base, scores, chosen.least_strength),
        *without_phase(problem, base.placed),
    )
    base, fits = _fitted(problem, base, scores, chosen, progress, distant, among)
    weighed = _weigh(problem, base, fits, scores, chosen)
    findings = tuple(one for one in weighed if one.large_enough)
    progress.advance(note="testing half of the data against the other")
    findings = _certified(problem, base, findings, len(scores), chosen)
    findings = _simplest_first(findings, chosen)
    findings = _instrument_first(problem, findings, chosen)
    verdict, twins = _verdict(problem, base, findings, chosen)
    best = findings[0].fitted if verdict in (NAMED, PARTLY) else base
    left = remains(problem, best)
    sentence = _sentence(verdict, findings, twins, left, removed(base, best))
    problem.error.forget()
    if verdict == NONE and problem.effective < VERDICT.fewest_points * base.steps.size:
        sentence = _few_points(problem, base)
    return Diagnosis(
        base,
        p_value(problem, base),
        verdict,
        findings,
        tuple(scores),
        unseen(unobservable, verdict, findings, twins),
        residual_cells(problem, base),
        twins,
        left,
        _worth(problem, findings, twins),
        sentence,
    )


def _scored(problem: Likelihood, base: Fit) -> list[Score]:
    """The tests of all candidates, the strongest first."""
    found = in_threads(partial(score, problem, base), candidates(problem, base.placed))
    return sorted(found, key=lambda one: -abs(one.statistic))


def _fitted(
    problem: Likelihood,
    base: Fit,
    scores: list[Score],
    settings: DiagnosisSettings,
    progress: Progress,
    distant: Fit | None,
    among: frozenset[str] | None,
) -> tuple[Fit, list[Fit]]:
    """The model as it is, and those with one effect more, each where it explains most."""
    progress.advance(note="fitting the leading effects")
    leading = _chosen(scores, settings.fitted, distant, among)
    fits = _fit_candidates(problem, base, leading, distant, settings.over_none, progress)
    if among is None and _worth_all(problem, base, fits, settings):
        progress.advance(note="fitting every effect")
        fits += _others(problem, base, scores, fits, settings, distant)
    if _much_left(problem, [base, *fits], settings):
        base, *fits = _sharper(problem, [base, *fits])
    if _much_left(problem, [base, *fits], settings):
        progress.advance(note="trying exchanged channels")
        fits = _with_exchanges(problem, base, scores, fits, settings.seed)
    return _as_good(problem, base, fits), fits


def unseen(
    unobservable: tuple[str, ...],
    verdict: str,
    findings: tuple[Finding, ...],
    twins: tuple[str, ...],
) -> tuple[str, ...]:
    """Labels of what cannot be seen, but for what the verdict names: that was seen.

    At the size of its prior an effect may be too faint to show; what is there may be larger.
    """
    if verdict in (NONE, UNKNOWN):
        return unobservable
    named = {findings[0].placed.label, *twins}
    return tuple(label for label in unobservable if label not in named)


def _chosen(
    scores: list[Score], count: int, distant: Fit | None, among: frozenset[str] | None
) -> list[Score]:
    """The candidates to be fitted first."""
    if among is not None:
        return [one for one in scores if one.placed.label in among]
    leading = _leading(scores, count)
    return leading if distant is None else _with(leading, scores, distant.placed[-1])


def _with_exchanges(
    problem: Likelihood, base: Fit, scores: list[Score], fits: list[Fit], seed: int
) -> list[Fit]:
    """The fits with channels exchanged: without the exchange theta may lie far off."""
    exchanges = [one.placed for one in scores if one.placed.exchange]
    best = max(log_posterior(problem, one) for one in [base, *fits])
    again = in_threads(partial(settle, problem), exchange_fits(problem, base, exchanges, seed))
    again = [one for one in again if log_posterior(problem, one) > best]
    redone = {one.placed[-1] for one in again}
    return [*(one for one in fits if one.placed[-1] not in redone), *again]


def _much_left(problem: Likelihood, fits: list[Fit], settings: DiagnosisSettings) -> bool:
    """Whether even the best of fits leaves an error that an engineer would notice."""
    best = max(fits, key=lambda one: log_posterior(problem, one))
    return remains(problem, best).size >= settings.least_response


def _sharper(problem: Likelihood, fits: list[Fit]) -> list[Fit]:
    """Fits of which the leading ones were sought again as if nothing but noise were left.

    A fit that is allowed an error may stay where the error makes up for what needs none farther on.
    """
    leading = sorted(fits, key=lambda one: -log_posterior(problem, one))[: FIT.others]
    sharp = problem.at_row(problem.error.first)

    def sharpened(one: Fit) -> Fit:
        if one not in leading or one.likelihood.row == sharp.row:
            return one
        other = settle(problem, fit(sharp, one.placed, one.z, FIT.steps))
        return max(one, other, key=lambda two: log_posterior(problem, two))

    return in_threads(sharpened, fits)


def _leading(scores: list[Score], count: int) -> list[Score]:
    """The strongest candidates, and the strongest place of every other effect that is near."""
    strong = [one for one in scores if abs(one.statistic) > 2.0]
    chosen = strong[:count]
    known = {one.placed.effect.name for one in chosen}
    for one in strong[count:]:
        if one.placed.effect.name not in known and len(chosen) < count + 4:
            known.add(one.placed.effect.name)
            chosen.append(one)
    return chosen


def _with(leading: list[Score], scores: list[Score], placed: Placed) -> list[Score]:
    """The leading tests, that of one effect among them."""
    if any(one.placed.label == placed.label for one in leading):
        return leading
    return [*leading, *(one for one in scores if one.placed.label == placed.label)]


def _fit_candidates(
    problem: Likelihood,
    base: Fit,
    tests: list[Score],
    distant: Fit | None,
    least: float,
    progress: Progress,
) -> list[Fit]:
    """Fits with one effect more each; those that fall far behind are not followed.

    Where nothing but noise is left, those that gain less than half of the `least` log evidence of a
    name take two steps on all shapes.
    """
    small = problem.on_fewer(FIT.fewer_shapes)
    froms = _froms(small, fit(small, base.placed, base.z, 0), distant)
    known = base.jacobian if distant is None else None
    of_noise = problem.row == problem.error.first
    worth = froms[0].misfit - least if of_noise else np.inf

    def settled(one: Begun | Fit) -> Fit:
        steps = FIT.steps if one.misfit <= worth else FIT.glance
        steps = 0 if one.misfit > enough else steps
        return settle(problem, fit(problem, one.placed, one.z, steps, near=known), steps)

    def each(task: Callable[[Any], T], those: Sequence[Any], what: str) -> list[T]:
        return in_threads(counted(task, progress, what, len(those)), those)

    begun = each(partial(_glanced, froms, FIT.first_steps, distant), tests, "fitting effects")
    near = _enough(begun)
    followed: list[Begun | Fit] = each(
        lambda one: one if one.misfit > near else _further(small, one),
        begun,
        "fitting them further",
    )
    enough = _enough(followed)
    return each(settled, followed, "fitting them to all data")


def _others(
    problem: Likelihood,
    base: Fit,
    scores: list[Score],
    fits: list[Fit],
    settings: DiagnosisSettings,
    distant: Fit | None,
) -> list[Fit]:
    """Fits of those among all other effects that explain most, were nothing but noise left.

    Where theta, or what the model may err by, has made up for most of an effect, a test there does
    not see it; the first steps of a fit without such errors do.
    """
    known = {one.placed[-1].label for one in fits}
    small = problem.on_fewer(FIT.fewer_shapes).at_row(problem.error.first)
    without = fit(small, base.placed, base.z, FIT.first_steps)
    froms = _froms(small, without, distant)
    tests = [one for one in scores if one.placed.label not in known]
    begun = in_threads(partial(_glanced, froms, FIT.glance, None), tests)
    near = sorted(begun, key=lambda one: one.misfit)[: FIT.ahead]
    ahead = sorted(
        in_threads(lambda one: _further(small, one, FIT.first_steps), near),
        key=lambda one: one.misfit,
    )
    best = min(one.misfit for one in [without, *ahead])
    # Twice the log evidence of a name, which errors of the model only lower.
    enough = min(FIT.more * best, without.misfit - 2.0 * settings.over_none)
    return in_threads(
        lambda one: settle(problem, fit(problem, one.placed, _further(small, one).z, FIT.steps)),
        [one for one in ahead[: FIT.others] if one.misfit < enough],
    )


def _worth_all(
    problem: Likelihood, base: Fit, fits: list[Fit], settings: DiagnosisSettings
) -> bool:
    """Whether something may be named, or the model errs, so that every effect is due its chance.

    What a small effect does may be taken for an error of the model, in which no test sees it.
    """
    without = laplace(problem, base).log_evidence
    gain = max((laplace(problem, one).log_evidence for one in fits), default=without) - without
    return gain > settings.over_none or base.likelihood.row != problem.error.first


def _enough(fits: Sequence[Begun | Fit]) -> float:
    """The misfit from which a candidate is out of the race."""
    return FIT.far_behind * min((one.misfit for one in fits), default=0.0) + FIT.behind


def _froms(problem: Likelihood, without: Fit, distant: Fit | None) -> list[Fit]:
    """The fits without an effect from which those with one begin: the base, and far from it."""
    if distant is None:
        return [without]
    there = distant.z[: len(without.z)]
    return [without, fit(problem, without.placed, there, 0)]


def _glanced(froms: list[Fit], steps: int, distant: Fit | None, one: Score) -> Begun:
    """The best of some steps with an effect, from fits without it.

    The distant fit tells the size of its own effect.
    """
    starts = [_start(froms[0].likelihood, froms[0], one)] * len(froms)
    if distant is not None and distant.placed[-1].label == one.placed.label:
        starts[-1] = distant.known[len(froms[-1].known) :]
    pairs = [*zip(froms, starts, strict=True), *((froms[0], large) for large in _large(one))]
    tried = (glance(without, one.placed, start, steps) for without, start in pairs)
    return min(tried, key=lambda begun: begun.misfit)


def _large(one: Score) -> list[Floats]:
    """Parameters of an effect, not small, whose test points to an impossible size.

    Where the factors have made up for most of a large effect, a little of it makes things worse.
    """
    if one.statistic != 0.0 or not one.start:
        return []
    size = one.placed.effect.parameters[0]
    step = np.sign(one.start[0] - size.neutral) * size.scale
    sizes = np.clip(size.neutral + step * np.array(FIT.large), size.lower, size.upper)
    return [np.array([own, *one.start[1:]]) for own in np.unique(sizes)]


def _start(problem: Likelihood, base: Fit, one: Score) -> Floats:
    """An effect's parameters where a fit begins: of its test, or with the size that this tells.

    What grows as the square of a size, as smeared peaks do, is taken for far too large by the
    straight line from the test.
    """
    tested = np.array(one.start)
    if not tested.size or one.size == tested[0]:
        return tested
    told = np.concatenate([[one.size], tested[1:]])
    return nearest(problem, base, one.placed, (told, tested))


def _further(problem: Likelihood, begun: Begun | Fit, steps: int = FIT.steps) -> Fit:
    near = begun.jacobian if isinstance(begun, Fit) else begun.near
    return fit(problem, begun.placed, begun.z, steps, near=near)


def _as_good(problem: Likelihood, base: Fit, fits: list[Fit]) -> Fit:
    """The model as it is, from where those with an effect more lie best.

    Else an effect would be credited with a search that it led to a better place.
    """
    leading = sorted(fits, key=lambda one: -log_posterior(problem, one))[: FIT.again]
    again = in_threads(
        lambda one: settle(problem, fit(problem, base.placed, one.z[: len(base.z)], FIT.steps)),
        leading,
    )
    return max([base, *again], key=lambda one: log_posterior(problem, one))


def _weigh(
    problem: Likelihood,
    base: Fit,
    fits: list[Fit],
    scores: list[Score],
    settings: DiagnosisSettings,
) -> tuple[Finding, ...]:
    """Findings in the order of their evidence over the model without them."""
    by_label = {one.placed.label: one for one in scores}
    without = laplace(problem, base).log_evidence
    gains = [one.log_evidence - without for one in in_threads(partial(laplace, problem), fits)]
    evidence = {k: Evidence(gain) for k, gain in enumerate(gains)}
    order = sorted(evidence, key=lambda k: -gains[k])
    if settings.sampled and fits:
        reference = sampled(problem, base, settings.draws, settings.seed)
        for k in order[: settings.sampled]:
            evidence[k] = _over(sampled(problem, fits[k], settings.draws, settings.seed), reference)
    # No name comes of less, and the errors about a fit only make it less.
    if order and gains[order[0]] >= settings.over_none:
        lowest = _about_the_first(problem, base, [fits[k] for k in order[: VERDICT.compared + 1]])
        for k, gain in zip(order, lowest, strict=False):
            if gain < evidence[k].log_evidence:
                evidence[k] = replace(evidence[k], log_evidence=gain)
    order = sorted(evidence, key=lambda k: -evidence[k].log_evidence)
    return tuple(
        as_finding(problem, base, fits[k], by_label[fits[k].placed[-1].label], evidence[k])
        for k in order
    )


def _over(one: Evidence, reference: Evidence) -> Evidence:
    error = float(np.hypot(one.error, reference.error))
    return Evidence(one.log_evidence - reference.log_evidence, error, one.effective)


def _about_the_first(problem: Likelihood, base: Fit, fits: list[Fit]) -> list[float]:
    """Log evidence over the base with the errors known beforehand as they are about the first fit.

    They are taken along straight lines, which bend: a name must hold about either model.
    """
    if not problem.error.knows:
        return []
    there = about(problem, fits[0])
    values = in_threads(
        lambda one: laplace(there, settle(there, fit(there, one.placed, one.z, FIT.first_steps))),
        [base, *fits],
    )
    return [one.log_evidence - values[0].log_evidence for one in values[1:]]


def as_finding(
    problem: Likelihood, base: Fit, fitted: Fit, test: Score, evidence: Evidence
) -> Finding:
    """The last effect of a fit, beside the model without it as it is fitted; not yet tested."""
    size, sd = _first_size(fitted)
    changes = consequence(problem, base, fitted)
    return Finding(fitted.placed[-1], test, fitted, evidence, changes, None, size, sd)


def _first_size(fitted: Fit) -> tuple[float, float]:
    """First parameter of the last effect, and its standard deviation."""
    count = len(fitted.placed[-1].effect.parameters)
    if not count:
        return 1.0, 0.0
    values, sd = fitted.sizes()
    return float(values[-count]), float(sd[-count])


def _certified(
    problem: Likelihood,
    base: Fit,
    findings: tuple[Finding, ...],
    tried: int,
    settings: DiagnosisSettings,
) -> tuple[Finding, ...]:
    """The findings, the leading ones tested on data to which they were not fitted."""
    carried = [one for one in findings if one.evidence.log_evidence >= settings.over_none]
    worthy = [*carried[:1], *others_than(carried[0], carried[1:])] if carried else []
    worthy = worthy[: VERDICT.compared]
    if problem.row != problem.error.first:
        worthy += [one for one in _instruments(findings) if one not in worthy]
    if not worthy:
        return findings
    fits = [one.fitted for one in worthy]
    tests = certify(problem, base, fits, tried, settings.false_share)
    return tuple(replace(one, tested=tests.get(one.placed.label)) for one in findings)


def _instruments(findings: tuple[Finding, ...]) -> list[Finding]:
    """Instruments' effects that an error of the model may hide, the most probable first."""
    hinted = [one for one in findings if one.evidence.log_evidence >= VERDICT.positive]
    return [one for one in hinted if one.placed.effect.instrument][: VERDICT.compared]


def _simplest_first(
    findings: tuple[Finding, ...], settings: DiagnosisSettings
) -> tuple[Finding, ...]:
    """The findings, led by what says less than the first where that is not clearly better.

    The same effect in all places says not where; one that the first contains has a parameter less.
    """
    if not findings:
        return findings
    first = findings[0]
    least = first.evidence.log_evidence - settings.margin(first.evidence.log_evidence)
    for one in findings[1:]:
        wider = one.placed.effect is first.placed.effect and one.placed.place == "all"
        simpler = wider or _contains(first, one)
        if simpler and one.evidence.log_evidence > least and one.carried(settings):
            return (one, *(other for other in findings if other is not one))
    return findings


def _instrument_first(
    problem: Likelihood, findings: tuple[Finding, ...], settings: DiagnosisSettings
) -> tuple[Finding, ...]:
    """The findings, led by an instrument's effect that is missing beside the first and is close.

    An instrument is mended before the structure is judged by it. One that the other half of the
    data holds far likelier than the first need not be close by its own.
    """
    if not findings or findings[0].placed.effect.instrument:
        return findings
    first = findings[0]
    least = first.evidence.log_evidence - settings.margin(first.evidence.log_evidence)
    for one in findings[1:]:
        close = one.evidence.log_evidence > least or _far_behind(first, one, settings)
        if (
            one.placed.effect.instrument
            and close
            and one.carried(settings)
            and one.matters(settings)
            and _beside(problem, first, one, settings)
        ):
            return (one, *(other for other in findings if other is not one))
    return findings


def _beside(
    problem: Likelihood, first: Finding, other: Finding, settings: DiagnosisSettings
) -> bool:
    """Whether an effect explains beside the first most of what it explains without it."""
    placed = (*first.fitted.placed, other.placed)
    own = other.fitted.known[len(other.fitted.known) - len(other.placed.effect.parameters) :]
    start = extended(problem, first.fitted, placed, np.concatenate([first.fitted.known, own]))
    both = settle(problem, fit(problem, placed, start, FIT.steps))
    gain = laplace(problem, both).log_evidence - laplace(problem, first.fitted).log_evidence
    return gain >= max(other.needed(settings), VERDICT.beside * other.evidence.log_evidence)


def others_than(first: Finding, others: Sequence[Finding]) -> list[Finding]:
    """Others than the same effect at one place, where it leads in all: that does not say where."""
    if first.placed.place != "all":
        return list(others)
    return [one for one in others if one.placed.effect is not first.placed.effect]


def _verdict(
    problem: Likelihood, base: Fit, findings: tuple[Finding, ...], settings: DiagnosisSettings
) -> tuple[str, tuple[str, ...]]:
    """The verdict and what the leading finding cannot be told from."""
    wrong = remains(problem, base).size >= settings.least_response
    nothing = UNKNOWN if wrong else NONE
    if not findings or not findings[0].carried(settings):
        return nothing, ()
    first = findings[0]
    if not first.matters(settings):
        return nothing, ()
    least = first.evidence.log_evidence - settings.margin(first.evidence.log_evidence)
    near = [other for other in findings[1:] if other.evidence.log_evidence > least]
    # What other data refuse is no rival, nor what they hold far less likely, nor the same thing
    # with a parameter more, nor what is missing as well.
    near = [
        other
        for other in others_than(first, near)
        if other.carried(settings)
        and not _far_behind(other, first, settings)
        and not _contains(other, first)
        and not _beside(problem, first, other, settings)
    ]
    twins = tuple(other.placed.label for other in near)
    if not near:
        left = remains(problem, first.fitted).size >= settings.least_response
        return (PARTLY if left else NAMED), ()
    tests = [first.score, *(other.score for other in near)]
    same = same_to_sensors(problem, base, tests, settings.alike)
    return (INDISTINGUISHABLE if same else AMBIGUOUS), twins


def _contains(other: Finding, first: Finding) -> bool:
    """Whether another effect is the first one with a parameter more."""
    same_place = other.placed.place == first.placed.place
    return same_place and first.placed.effect.name in other.placed.effect.contains


def _far_behind(other: Finding, first: Finding, settings: DiagnosisSettings) -> bool:
    """Whether other data tell an effect from the first, where what they are fitted to does not."""
    if other.tested is None or first.tested is None:
        return False
    least = first.tested.log_e_value - settings.margin(first.tested.log_e_value)
    return other.tested.log_e_value < least


def _worth(
    problem: Likelihood, findings: tuple[Finding, ...], twins: tuple[str, ...]
) -> tuple[MeasurementValue, ...]:
    """What would tell the first finding from the first few of its twins."""
    others = [one.fitted for one in findings[1:] if one.placed.label in twins[: VERDICT.compared]]
    return measurement_values(problem, findings[0].fitted, others) if others else ()


def _few_points(problem: Likelihood, base: Fit) -> str:
    return (
        f"The data are too few: {problem.effective:.0f} independent points for "
        f"{base.steps.size} unknowns. Measure longer, with less noise, or on more floors."
    )


def removed(base: Fit, best: Fit) -> float:
    """Share of the squared residuals beyond the noise that a better fit does without."""
    return (base.chi2 - best.chi2) / max(base.chi2 - base.likelihood.effective, 1.0)


def mass_in_words(mass: float) -> str:
    """A mass (kg) in a unit of its size."""
    return f"{mass:.3g} kg" if abs(mass) < VERDICT.in_tonnes else f"{1e-3 * mass:.3g} t"


def share_in_words(share: float) -> str:
    """A share in per cent, or "none" and "all" where it is no less."""
    return "none" if share < 0.005 else percent(share) if share < 1.0 else "all"


def _sentence(
    verdict: str,
    findings: tuple[Finding, ...],
    twins: tuple[str, ...],
    left: Remains,
    share: float,
) -> str:
    if verdict == NONE:
        text = "The model explains the data; nothing needs to be added."
        if findings and findings[0].tested is not None and findings[0].tested.certified:
            text += f" {findings[0].in_words}, but that is of no consequence."
        return " ".join([text, left.sentence]).rstrip()
    if verdict == UNKNOWN:
        text = (
            "The model misses the data by more than their noise, and no effect of the catalogue is "
            "certain to explain it."
        )
        return f"{text} {left.sentence}".rstrip()
    first = findings[0]
    if verdict == NAMED:
        return f"{first.in_words}. {first.placed.effect.sentence} {left.sentence}".rstrip()
    if verdict == PARTLY:
        told = f"It removes {share_in_words(share)} of the misfit beyond the noise;"
        doubt = "" if share >= VERDICT.most else f" {STANDS_IN}"
        return (
            f"{first.in_words}. {first.placed.effect.sentence} {told} something else is missing "
            f"as well.{doubt} {left.sentence}"
        )
    how = "cannot be told from" if verdict == INDISTINGUISHABLE else "competes with"
    return f"{first.in_words}. It {how} {', '.join(twins)}."
