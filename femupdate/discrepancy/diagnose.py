"""What is missing: every effect tested, the leading ones fitted, their evidence weighed."""

from dataclasses import dataclass

import numpy as np

from femupdate.discrepancy.evidence import Evidence, laplace, sampled
from femupdate.discrepancy.exchange import exchange_fits
from femupdate.discrepancy.fit import Fit, extended, fit, fit_baseline
from femupdate.discrepancy.further_measurements import MeasurementValue, measurement_values
from femupdate.discrepancy.observability import same_to_sensors, unobservable_effects
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.residual_map import Cell, p_value, residual_cells
from femupdate.discrepancy.score import Score, candidates, score
from femupdate.discrepancy.thresholds import FIT, VERDICT, DiagnosisSettings
from femupdate.effects.effect import Placed
from femupdate.progress import SILENT, Progress

NONE, NAMED, AMBIGUOUS = "none", "named", "ambiguous"
INDISTINGUISHABLE, UNKNOWN = "indistinguishable", "unknown"


@dataclass(frozen=True, eq=False)
class Finding:
    """One candidate after fitting.

    Attributes:
        placed: effect and place.
        score: its score test.
        fitted: the model with it.
        evidence: over the model without it.
        probability: among all candidates, none and something unknown.
        size, size_sd: of its first parameter.
    """

    placed: Placed
    score: Score
    fitted: Fit
    evidence: Evidence
    probability: float
    size: float
    size_sd: float

    @property
    def in_words(self) -> str:
        """Effect, place and size, such as "3F carries 9.8 % more mass than modelled (± 0.3 %)"."""
        effect = self.placed.effect
        said = effect.said(self.placed.place, self.size)
        if not effect.parameters:
            return said
        return f"{said} ({effect.parameters[0].scatter(self.size_sd)})"


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Where the model fails and what could be missing.

    Attributes:
        base: the model as it is, at its most probable parameters.
        p_value: of noise alone leaving its residuals.
        inflation: how much larger than stated the noise is taken, because nothing explains more.
        verdict: "none", "named", "ambiguous", "indistinguishable" or "unknown".
        findings: fitted candidates, the most probable first.
        scores: all score tests, the strongest first.
        unobservable: labels of effects that these sensors could not show.
        residuals: of the model as it is, by floor and band.
        twins: labels that the leading finding cannot be told from.
        partner: label of a second effect, with which the first explains what it does not alone.
        worth: of further measurements, the best first, where the first is not told from its twins.
        sentence: the verdict for an engineer.
    """

    base: Fit
    p_value: float
    inflation: float
    verdict: str
    findings: tuple[Finding, ...]
    scores: tuple[Score, ...]
    unobservable: tuple[str, ...]
    residuals: tuple[Cell, ...]
    twins: tuple[str, ...]
    partner: str
    worth: tuple[MeasurementValue, ...]
    sentence: str

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
    problem: Problem,
    settings: DiagnosisSettings | None = None,
    base: Fit | None = None,
    progress: Progress = SILENT,
    distant: Fit | None = None,
    among: frozenset[str] | None = None,
) -> Diagnosis:
    """Find where a model fails, and rank what could be missing.

    Args:
        problem: structure and data.
        settings: thresholds.
        base: the model so far, fitted; by default that without effects.
        progress: advances by one a step, with a note of what is being done.
        distant: with one effect more, at a theta from where all are fitted as well.
        among: labels of the only candidates that are fitted; None for the leading ones.
    """
    chosen = settings or DiagnosisSettings()
    if base is None:
        progress.advance(note="fitting the model as it is")
        base = fit_baseline(problem, seed=chosen.seed)[0]
    progress.advance(note="testing every effect")
    scores = sorted(
        (score(problem, base, placed) for placed in candidates(problem, base.placed)),
        key=lambda one: -abs(one.statistic),
    )
    unobservable = unobservable_effects(problem, base, scores, chosen.least_strength)
    progress.advance(note="fitting the leading effects")
    leading = _chosen(scores, chosen.fitted, distant, among)
    fits = _fit_candidates(problem, base, leading, distant)
    if among is None and _worth_all(problem, base, fits, chosen):
        progress.advance(note="fitting every effect")
        fits += _others(problem, base, scores, fits, distant)
    best = _best(problem, [base, *fits])
    if _too_much_left(problem, base, best, chosen):
        progress.advance(note="trying exchanged channels")
        fits = _with_exchanges(problem, base, scores, fits, best.chi2, chosen.seed)
        best = _best(problem, [base, *fits])
    inflation, partner = _inflation(problem, base, best), ""
    findings = _weigh(problem, base, fits, scores, inflation, chosen)
    if findings and _too_much_left(problem, base, best, chosen):
        progress.advance(note="trying pairs of effects")
        findings, partner, best = _with_partner(problem, findings, best, chosen)
    verdict, twins = _verdict(problem, base, findings, best, chosen)
    inflation = _inflation(problem, base, best)
    sentence = _sentence(verdict, findings, twins, partner, inflation)
    if verdict == NONE and problem.effective < VERDICT.fewest_points * base.coordinates.size:
        sentence = _few_points(problem, base)
    return Diagnosis(
        base,
        p_value(problem, base),
        inflation,
        verdict,
        findings,
        tuple(scores),
        unseen(unobservable, verdict, findings, twins),
        residual_cells(problem, base),
        twins,
        partner if verdict != UNKNOWN else "",
        _worth(problem, findings, twins),
        sentence,
    )


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


def _inflation(problem: Problem, base: Fit, best: Fit) -> float:
    """Factor on the noise variance with which the best fit leaves only noise; at least one."""
    return max(1.0, best.chi2 / max(problem.effective - base.coordinates.size, 1.0))


def _with_exchanges(
    problem: Problem, base: Fit, scores: list[Score], fits: list[Fit], best: float, seed: int
) -> list[Fit]:
    """The fits with channels exchanged: without the exchange theta may lie far off."""
    exchanges = [one.placed for one in scores if one.placed.exchange]
    again = [
        one
        for one in exchange_fits(problem, base, exchanges, seed)
        if one.chi2 < VERDICT.better_exchange * best
    ]
    redone = {one.placed[-1] for one in again}
    return [*(one for one in fits if one.placed[-1] not in redone), *again]


def _excess(problem: Problem, base: Fit, chi2: float) -> tuple[float, bool]:
    """What a sum of squares is more than noise leaves, and whether that is beyond chance."""
    freedom = max(problem.effective - base.coordinates.size, 1.0)
    excess = chi2 - freedom
    return excess, excess > VERDICT.beyond_chance * np.sqrt(2.0 * freedom)


def _left(problem: Problem, fitted: Fit) -> float:
    """What a fit leaves unexplained, as a sum of squares.

    Errors that many points share could hide a good part of what a wrong effect leaves, each moved a
    little further than it should: where there are such, every point is taken to err alone.
    """
    return fitted.chi2 if problem.left_open is None else fitted.misfit


def _best(problem: Problem, fits: list[Fit]) -> Fit:
    """The fit that leaves least."""
    return min(fits, key=lambda one: _left(problem, one))


def _too_much_left(problem: Problem, base: Fit, best: Fit, settings: DiagnosisSettings) -> bool:
    """Whether even the best fit leaves, beyond chance, a part of what there is to explain.

    Mass takes the place of a tie or a brace for most of their effect; what it cannot explain says
    that it is not mass.
    """
    if problem.left_open is None:
        excess = _excess(problem, base, base.chi2)[0]
        left, significant = _excess(problem, base, best.chi2)
        return significant and left > settings.unknown_left * excess
    return _poor(problem, best) and best.misfit > settings.unknown_left * base.misfit


def _poor(problem: Problem, best: Fit) -> bool:
    """Whether a fit leaves more than noise and the usual error of a right model do."""
    expected = problem.expected(best.zeta(problem.fixed_zeta))
    return best.misfit > expected + VERDICT.beyond_chance * np.sqrt(2.0 * problem.effective)


def _with_partner(
    problem: Problem, findings: tuple[Finding, ...], best: Fit, settings: DiagnosisSettings
) -> tuple[tuple[Finding, ...], str, Fit]:
    """Put first the effect that explains most together with a second one."""
    chosen, partner = 0, ""
    for number, one in enumerate(findings[: settings.paired]):
        tests = [score(problem, one.fitted, p) for p in candidates(problem, one.fitted.placed)]
        strongest = sorted(tests, key=lambda test: -abs(test.statistic))[:2]
        for test in strongest:
            both = _fit_candidates(problem, one.fitted, [test])[0]
            if _left(problem, both) < VERDICT.better_pair * _left(problem, best):
                best, chosen, partner = both, number, test.placed.label
    if not partner:
        return findings, "", best
    others = (one for k, one in enumerate(findings) if k != chosen)
    return (findings[chosen], *others), partner, best


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
    problem: Problem, base: Fit, tests: list[Score], distant: Fit | None = None
) -> list[Fit]:
    """Fits with one effect more each; those that fall far behind are not followed."""
    small = problem.on_fewer()
    begun = [_begun(small, base, one, distant) for one in tests]
    enough = _enough(begun)
    followed = [one if one.misfit > enough else _further(small, one) for one in begun]
    enough = _enough(followed)
    return [
        fit(problem, one.placed, one.z, 0 if one.misfit > enough else FIT.steps) for one in followed
    ]


def _others(
    problem: Problem, base: Fit, scores: list[Score], fits: list[Fit], distant: Fit | None
) -> list[Fit]:
    """Fits of those among all other effects that explain more than the leading ones.

    Where theta has made up for most of an effect, a test at that theta does not see it; the first
    steps of a fit do.
    """
    known, small = {one.placed[-1].label for one in fits}, problem.on_fewer()
    best = min([base.misfit, *(one.misfit for one in fits)])
    tests = [one for one in scores if one.placed.label not in known]
    begun = (_begun(small, base, one, distant, FIT.glance) for one in tests)
    ahead = sorted(begun, key=lambda one: one.misfit)[: FIT.ahead]
    ahead = sorted(
        (_further(small, one, FIT.first_steps) for one in ahead), key=lambda one: one.misfit
    )
    return [
        fit(problem, one.placed, _further(small, one).z, FIT.steps)
        for one in ahead[: FIT.others]
        if one.misfit < FIT.more * best
    ]


def _worth_all(problem: Problem, base: Fit, fits: list[Fit], settings: DiagnosisSettings) -> bool:
    """Whether something may be named, so that every effect is due its chance; or nothing fits."""
    best = min([base, *fits], key=lambda one: one.misfit)
    gain = 0.5 * (base.chi2 - min([base.chi2, *(one.chi2 for one in fits)]))
    return gain > settings.over_none + problem.mesh_evidence or _poor(problem, best)


def _enough(fits: list[Fit]) -> float:
    """The misfit from which a candidate is out of the race."""
    return FIT.far_behind * min((one.misfit for one in fits), default=0.0) + FIT.behind


def _begun(
    problem: Problem, base: Fit, one: Score, distant: Fit | None, steps: int = FIT.first_steps
) -> Fit:
    """The first steps of a fit with an effect, from the base or from that distant fit."""
    placed = (*base.placed, one.placed)
    start = list(one.start)
    if start:
        start[0] = one.size
    own = np.concatenate([base.known, start])
    near = fit(problem, placed, extended(problem, base, placed, own), steps)
    if distant is None:
        return near
    if distant.placed[-1].label == one.placed.label:
        own = distant.known
    other = fit(problem, placed, extended(problem, distant, placed, own), steps)
    return min(near, other, key=lambda fitted: fitted.misfit)


def _further(problem: Problem, begun: Fit, steps: int = FIT.steps) -> Fit:
    return fit(problem, begun.placed, begun.z, steps)


def _weigh(
    problem: Problem,
    base: Fit,
    fits: list[Fit],
    scores: list[Score],
    inflation: float,
    settings: DiagnosisSettings,
) -> tuple[Finding, ...]:
    """Findings in the order of their evidence over the model without them."""
    by_label = {one.placed.label: one for one in scores}
    gains = [_gain(problem, base, one, inflation) for one in fits]
    evidence = {k: Evidence(gain) for k, gain in enumerate(gains)}
    if settings.sampled and len(fits):
        reference = sampled(problem, base, inflation, settings.draws, settings.seed)
        for k in sorted(evidence, key=lambda k: -gains[k])[: settings.sampled]:
            mine = sampled(problem, fits[k], inflation, settings.draws, settings.seed)
            error = float(np.hypot(mine.error, reference.error))
            gain = mine.log_evidence - reference.log_evidence
            evidence[k] = Evidence(gain, error, mine.effective)
    order = sorted(evidence, key=lambda k: -evidence[k].log_evidence)
    # Half of the prior probability is for "nothing is missing", the rest is shared evenly.
    logs = np.array([evidence[k].log_evidence for k in order]) - np.log(max(len(scores), 1))
    total = np.logaddexp.reduce(np.concatenate([[0.0], logs]))
    found = []
    for k, value in zip(order, logs, strict=True):
        fitted = fits[k]
        placed = fitted.placed[-1]
        size, sd = _first_size(fitted, inflation)
        found.append(
            Finding(
                placed,
                by_label[placed.label],
                fitted,
                evidence[k],
                float(np.exp(value - total)),
                size,
                sd,
            )
        )
    return tuple(found)


def _gain(problem: Problem, base: Fit, fitted: Fit, inflation: float) -> float:
    """Log evidence over the model without the effect."""
    with_it, without = laplace(problem, fitted, inflation), laplace(problem, base, inflation)
    return with_it.log_evidence - without.log_evidence


def _first_size(fitted: Fit, inflation: float) -> tuple[float, float]:
    """First parameter of the last effect, and its standard deviation."""
    count = len(fitted.placed[-1].effect.parameters)
    if not count:
        return 1.0, 0.0
    values, sd = fitted.sizes(inflation)
    return float(values[-count]), float(sd[-count])


def _verdict(
    problem: Problem,
    base: Fit,
    findings: tuple[Finding, ...],
    best: Fit,
    settings: DiagnosisSettings,
) -> tuple[str, tuple[str, ...]]:
    """The verdict and what the leading finding cannot be told from."""
    significant = _excess(problem, base, base.chi2)[1]
    if not findings:
        return (UNKNOWN if significant else NONE), ()
    first = findings[0]
    gain = base.chi2 - first.fitted.chi2
    carried = first.evidence.log_evidence >= settings.over_none + problem.mesh_evidence
    if not (carried and gain >= settings.smallest_gain * base.chi2):
        return (UNKNOWN if significant else NONE), ()
    if _too_much_left(problem, base, best, settings):
        return UNKNOWN, ()
    value = first.evidence.log_evidence
    least = value - settings.margin(value)
    near = [other for other in findings[1:] if other.evidence.log_evidence > least]
    twins = tuple(other.placed.label for other in near)
    if not near:
        return NAMED, ()
    tests = [first.score, *(other.score for other in near)]
    same = same_to_sensors(problem, base, tests, settings.alike)
    return (INDISTINGUISHABLE if same else AMBIGUOUS), twins


def _worth(
    problem: Problem, findings: tuple[Finding, ...], twins: tuple[str, ...]
) -> tuple[MeasurementValue, ...]:
    """What would tell the first finding from the first few of its twins."""
    others = [one.fitted for one in findings[1:] if one.placed.label in twins[: VERDICT.compared]]
    return measurement_values(problem, findings[0].fitted, others) if others else ()


def _few_points(problem: Problem, base: Fit) -> str:
    return (
        f"The data are too few: {problem.effective:.0f} independent points for "
        f"{base.coordinates.size} unknowns. Measure longer, with less noise, or on more floors."
    )


def _sentence(
    verdict: str,
    findings: tuple[Finding, ...],
    twins: tuple[str, ...],
    partner: str,
    inflation: float,
) -> str:
    if verdict == NONE:
        return "The model explains the data; nothing needs to be added."
    if verdict == UNKNOWN:
        return (
            "The model misses the data by more than their noise, and nothing in the catalogue "
            "explains most of it."
        )
    first = findings[0]
    if verdict == NAMED:
        text = f"{first.in_words}. {first.placed.effect.sentence}"
    else:
        how = "cannot be told from" if verdict == INDISTINGUISHABLE else "competes with"
        text = f"{first.in_words}. It {how} {', '.join(twins)}."
    if partner:
        text += f" Alone it leaves much unexplained; with {partner} it explains most."
    if inflation > 1.5:
        text += f" The best model still misses the data by {inflation**0.5:.1f} times the noise."
    return text
