"""What is missing: every effect tested, the leading ones fitted, their evidence weighed."""

import math
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from itertools import combinations
from typing import Any, TypeVar

import numpy as np

from femupdate.arrays import Floats
from femupdate.discrepancy.evidence import certify, consequence, laplace
from femupdate.discrepancy.findings import (
    AMBIGUOUS,
    INDISTINGUISHABLE,
    NAMED,
    NONE,
    PARTLY,
    UNKNOWN,
    Diagnosis,
    Finding,
    in_order,
    keeps_beside,
    others_than,
    removed,
    rivals,
    sentence_of,
    share_in_words,
    strained,
    unseen,
    within_tolerances,
)
from femupdate.discrepancy.fit import (
    FAR_STEPS,
    FEWER_SHAPES,
    FIRST_STEPS,
    RIGHT,
    STEPS,
    Fit,
    about,
    coarse,
    error_left,
    extended,
    fit,
    fit_baseline,
    glance,
    log_posterior,
    narrowed,
    nearest,
    settle,
    with_more,
)
from femupdate.discrepancy.global_search import exchange_fits
from femupdate.discrepancy.score import (
    Score,
    candidates,
    measures,
    same_to_sensors,
    score,
    unobservable_effects,
    without_phase,
)
from femupdate.discrepancy.thresholds import VERDICT, DiagnosisSettings
from femupdate.effects.effect import Placed
from femupdate.effects.tolerances import USUAL, tolerances_of
from femupdate.inference.likelihood import Likelihood
from femupdate.progress import SILENT, Progress, counted
from femupdate.workers import in_threads, one_by_one

T = TypeVar("T")
Pair = tuple[Finding, Finding]

_GLANCE = 2  # steps of every other effect before a name is given


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
        base: the model so far, fitted; by default that without effects.
        progress: advances by one a step, with a note of what is being done.
        distant: with one effect more, at a theta from where all are fitted as well.
        among: labels of the only candidates that are fitted; None for the leading ones.
    """
    # Threads of sticks wait for each other: 1.4 times the processor time, no less on the clock.
    with one_by_one() if problem.reduced.structure.is_stick else nullcontext():
        return _diagnosed(problem, settings or DiagnosisSettings(), base, progress, distant, among)


def _diagnosed(
    problem: Likelihood,
    chosen: DiagnosisSettings,
    base: Fit | None,
    progress: Progress,
    distant: Fit | None,
    among: frozenset[str] | None,
) -> Diagnosis:
    """As `diagnose`."""
    progress.advance(note="fitting the model as it is")
    if base is None:
        base = fit_baseline(problem, seed=chosen.seed)[0]
    if not problem.error.knows:
        problem = about(problem, base)
    base = narrowed(settle(problem, base))
    problem = base.likelihood
    progress.advance(note="testing every effect")
    tests = in_threads(partial(score, problem, base), candidates(problem, base.placed))
    scores = sorted(tests, key=lambda test: -abs(test.statistic))
    unobservable = (
        *unobservable_effects(problem, base, scores, chosen.least_strength),
        *without_phase(problem, base.placed),
    )
    fits = _fitted(base, scores, chosen, progress, distant, among)
    # From where those with an effect more lie best: else an effect would be credited with a search
    # that it led to a better place.
    leading = sorted(fits, key=lambda fitted: -log_posterior(problem, fitted))[:2]
    starts, placed = [fitted.z[: len(base.z)] for fitted in leading], base.placed
    again = in_threads(lambda z: settle(problem, fit(problem, placed, z)), starts)
    base = max([base, *again], key=lambda fitted: log_posterior(problem, fitted))
    problem = base.likelihood
    findings = tuple(
        finding for finding in _weighed(base, fits, scores, chosen) if finding.large_enough
    )
    progress.advance(note="testing half of the data against the other")
    findings = _certified(base, findings, len(scores), chosen)
    beside = partial(keeps_beside, settings=chosen)
    findings = in_order(findings, chosen, beside) if findings else ()
    verdict, twins, allowed = NONE, list[Finding](), None
    if base.remains().size >= chosen.least_response:
        verdict = UNKNOWN
    if findings and findings[0].names(base, chosen):
        findings, allowed = _beyond_tolerances(base, findings, chosen)
    if allowed is not None:
        verdict = NONE if allowed.remains().size < chosen.least_response else UNKNOWN
    elif findings and findings[0].names(base, chosen):
        first, twins = findings[0], rivals(findings, chosen, beside)
        verdict = PARTLY if first.fitted.remains().size >= chosen.least_response else NAMED
        if twins:
            alike = [finding.score for finding in (first, *twins)]
            same = same_to_sensors(problem, base, alike, chosen.alike)
            verdict = INDISTINGUISHABLE if same else AMBIGUOUS
    best = findings[0].fitted if verdict in (NAMED, PARTLY) else base
    labels, left = tuple(twin.placed.label for twin in twins), best.remains()
    others = [twin.in_words for twin in twins]
    sentence = sentence_of(verdict, findings, others, left, removed(base, best))
    if allowed is not None:
        sentence = within_tolerances(verdict, findings, allowed.remains())
    if verdict == NONE:
        sentence += strained(allowed or base)
    problem.error.forget()
    if verdict == NONE and too_few(base):
        verdict = UNKNOWN
        sentence = (
            f"The data are too few to tell: {problem.effective:.0f} independent points for "
            f"{base.steps.size} unknowns. Measure longer, with less noise, or on more floors."
        )
    seen = unseen(unobservable, verdict, findings, labels)
    return Diagnosis(
        base, verdict, findings, tuple(scores), seen, labels, left, sentence, allowed=allowed
    )


def _beyond_tolerances(
    base: Fit, findings: tuple[Finding, ...], settings: DiagnosisSettings
) -> tuple[tuple[Finding, ...], Fit | None]:
    """The findings, led by one that goes beyond the usual tolerances of an unstated building.

    Where none of the leading ones does, the model with these tolerances, too.
    """
    problem = base.likelihood
    varying = tuple(
        placed
        for placed in tolerances_of(problem.building, USUAL)
        if problem.building.tolerances is None and measures(problem, placed)
    )
    if not varying or findings[0].placed.exchange:
        return findings, None
    together = (*base.placed, *varying)
    start = extended(problem, base, together, np.append(base.known, np.zeros(len(varying))))
    allowed = settle(problem, fit(problem, together, start))
    without = laplace(problem, allowed)
    for finding in findings[: VERDICT.compared + 1]:
        if not finding.names(base, settings):
            continue
        # From where the effect alone lies best: the tolerances may have led far from there.
        placed, alone = (*together, finding.placed), finding.fitted
        known = np.split(alone.known, [len(base.known)])
        values = np.concatenate([known[0], np.zeros(len(varying)), known[1]])
        both = settle(problem, fit(problem, placed, extended(problem, alone, placed, values)))
        gain = laplace(problem, both) - without
        # What is left to it must be of consequence itself.
        beside = replace(as_finding(allowed, both, finding.score, gain), tested=finding.tested)
        if beside.carried(settings) and beside.matters(settings):
            return (finding, *(other for other in findings if other is not finding)), None
    return findings, allowed


def too_few(base: Fit) -> bool:
    """Whether the data have less than two independent points for each unknown."""
    return base.likelihood.effective < 2.0 * base.steps.size


def _fitted(
    base: Fit,
    scores: list[Score],
    settings: DiagnosisSettings,
    progress: Progress,
    distant: Fit | None,
    among: frozenset[str] | None,
) -> list[Fit]:
    """The models with one effect more, each where it explains most."""
    problem = base.likelihood

    def much_left(fits: list[Fit]) -> bool:
        """Whether even the best leaves an error that an engineer would notice."""
        best = max([base, *fits], key=lambda fitted: log_posterior(problem, fitted))
        return best.remains().size >= settings.least_response

    swapped = list[Fit]()
    if among is None and error_left(problem, base) >= RIGHT:
        progress.advance(note="trying exchanged channels")
        exchanges = [test.placed for test in scores if test.placed.exchange]
        swapped = exchange_fits(problem, base, exchanges, settings.seed)
        swapped = in_threads(partial(settle, problem), swapped)
        if _surely_exchanged(base, swapped):
            return swapped
    progress.advance(note="fitting the leading effects")
    # The strongest candidates, and the strongest place of every other effect that is near.
    strong = [test for test in scores if abs(test.statistic) > 2.0]
    leading, count = strong[: settings.fitted], settings.fitted
    names = {test.placed.effect.name for test in leading}
    for test in strong[count:]:
        if test.placed.effect.name not in names and len(leading) < count + 4:
            names.add(test.placed.effect.name)
            leading.append(test)
    if distant is not None:
        label = distant.placed[-1].label
        leading += [t for t in scores if t.placed.label == label and t not in leading]
    if among is not None:
        leading = [test for test in scores if test.placed.label in among]
    fits = _fit_candidates(base, leading, distant, settings.over_none, progress)
    # Something may be named, or the model errs: what a small effect does may be taken for an error
    # of the model, in which no test sees it. Then every effect is due its chance.
    gain = max((laplace(problem, fitted) for fitted in fits), default=-np.inf)
    gain -= laplace(problem, base)
    if among is None and (gain > settings.over_none or problem.row != problem.error.first):
        progress.advance(note="fitting every effect")
        fits = _likeliest(problem, [*fits, *_others(base, scores, fits, settings, distant)])
    if among is None and much_left(fits):
        fits += _over_ranges(base, scores, fits, settings, progress)
    if much_left(fits):
        # A fit that is allowed an error may stay where the error makes up for what needs none
        # farther on: the leading ones are sought again as if nothing but noise were left, from
        # there and from where they lie by coarse noise, whose maxima are wide.
        sharp, rough = problem.at_row(problem.error.first), coarse(problem)
        best = sorted(fits, key=lambda fitted: -log_posterior(problem, fitted))[:4]

        def sharpened(fitted: Fit) -> Fit:
            if fitted not in best or fitted.likelihood.row == sharp.row:
                return fitted
            placed, starts = fitted.placed, [fitted.z]
            starts.append(fit(rough, placed, fitted.z, FAR_STEPS).z)
            others = [settle(problem, fit(sharp, placed, start)) for start in starts]
            return max([fitted, *others], key=lambda either: log_posterior(problem, either))

        fits = in_threads(sharpened, fits)
    return _likeliest(problem, [*fits, *_mirrored(base, fits), *swapped])


def _mirrored(base: Fit, fits: list[Fit]) -> list[Fit]:
    """Of two floors, the mass of the other where that of one explains most.

    Without a force only ratios of masses show: heavier by so much, with a stiffness likewise, the
    other looks the same, and a search may end at either.
    """
    problem, floors = base.likelihood, base.likelihood.reduced.structure.floors
    best = max([base, *fits], key=lambda fitted: log_posterior(problem, fitted))
    last = best.placed[-1] if best is not base else None
    if last is None or last.effect.name != "added_mass" or len(floors) != 2:
        return []
    other = Placed(last.effect, floors[1 - floors.index(last.place)])
    if other.label in {effect.label for effect in base.placed}:  # it has one already
        return []
    placed, times = (*base.placed, other), 1.0 / (1.0 + float(best.known[-1]))
    z = extended(problem, best, placed, [*base.known, times - 1.0])
    z[: best.steps.stories] += math.log(times)
    return [settle(problem, fit(problem, placed, z))]


def _surely_exchanged(base: Fit, fits: list[Fit]) -> bool:
    """Whether exchanges, of which each fit has another, together leave the factors right.

    What channels say surely goes before every effect of the structure.
    """
    if not fits:
        return False
    problem = base.likelihood
    best = min(fits, key=lambda fitted: error_left(problem, fitted))
    if error_left(problem, best) >= RIGHT:
        placed = tuple(fitted.placed[-1] for fitted in fits)
        best = fit(problem, (*base.placed, *placed), best.z, FAR_STEPS)
    return error_left(problem, best) < RIGHT and removed(base, best) >= VERDICT.least


def _over_ranges(
    base: Fit,
    scores: list[Score],
    fits: list[Fit],
    settings: DiagnosisSettings,
    progress: Progress,
) -> list[Fit]:
    """Fits of the leading effects over ranges of stories or floors, whose tests join the scores.

    Among so many ranges one always removes something: only what leaves nothing of note counts.
    """
    problem = base.likelihood
    ahead = sorted(fits, key=lambda fitted: -log_posterior(problem, fitted))[:4]
    known = {placed.label for placed in base.placed}
    places = [
        Placed(effect, place)
        for effect in {fitted.placed[-1].effect for fitted in ahead}
        for place in effect.points(problem.reduced.structure)
    ]
    wanted = [one for one in places if one.is_range and one.label not in known]
    tests = in_threads(partial(score, problem, base), wanted)
    scores += tests
    best = sorted(tests, key=lambda test: -abs(test.statistic))[: VERDICT.compared]
    tried = _fit_candidates(base, best, None, settings.over_none, progress)
    return [fitted for fitted in tried if fitted.remains().size < settings.least_response]


def _fit_candidates(
    base: Fit, tests: list[Score], distant: Fit | None, least: float, progress: Progress
) -> list[Fit]:
    """Fits with one effect more each; those that fall far behind are not followed.

    Where nothing but noise is left, those that gain less than half of the `least` log evidence of a
    name take two steps on all shapes.
    """
    problem = base.likelihood
    small = problem.on_fewer(FEWER_SHAPES)
    froms = _froms(small, fit(small, base.placed, base.z, 0), distant)
    known = base.jacobian if distant is None else None
    of_noise = problem.row == problem.error.first
    worth = froms[0].misfit - least if of_noise else np.inf

    def enough(fits: Sequence[Fit]) -> float:
        """The misfit from which a candidate is out of the race."""
        return 2.0 * min((fitted.misfit for fitted in fits), default=0.0) + 200.0

    def settled(near: Fit) -> Fit:
        steps = STEPS if near.misfit <= worth else _GLANCE
        steps = 0 if near.misfit > last else steps
        if small.reduced is not problem.reduced:
            near = fit(problem, near.placed, near.z, steps, near=known)
        return settle(problem, near, steps)

    def each(task: Callable[[Any], T], those: Sequence[Any], what: str) -> list[T]:
        return in_threads(counted(task, progress, what, len(those)), those)

    begun = each(partial(_glanced, froms, FIRST_STEPS, distant), tests, "fitting effects")
    most = enough(begun)
    followed = each(
        lambda near: near if near.misfit > most else _further(near),
        begun,
        "fitting them further",
    )
    last = enough(followed)
    return each(settled, followed, "fitting them to all data")


def _others(
    base: Fit,
    scores: list[Score],
    fits: list[Fit],
    settings: DiagnosisSettings,
    distant: Fit | None,
) -> list[Fit]:
    """Fits of those effects that explain most, were nothing but noise left.

    Where theta, or what the model may err by, has made up for most of an effect, a test there does
    not see it; the first steps of a fit without such errors do. Every effect gets two steps, and
    five more those that are fitted already, which may have stayed where the error explains as much,
    and the best twelve others. The best four are fitted to convergence.
    """
    problem = base.likelihood
    small = problem.on_fewer(FEWER_SHAPES).at_row(problem.error.first)
    without = fit(small, base.placed, base.z, FIRST_STEPS)
    froms = _froms(small, without, distant)
    near = in_threads(partial(_glanced, froms, _GLANCE, None), scores)
    near.sort(key=lambda fitted: fitted.misfit)
    there = in_threads(lambda fitted: fit(small, fitted.placed, fitted.z, 0).misfit, fits)
    known = dict(zip((fitted.placed[-1].label for fitted in fits), there, strict=True))
    new = [fitted for fitted in near if fitted.placed[-1].label not in known][:12]
    again = [fitted for fitted in near if fitted.placed[-1].label in known]
    ahead = in_threads(partial(_further, steps=FIRST_STEPS), [*new, *again])
    ahead.sort(key=lambda fitted: fitted.misfit)
    # Twice the log evidence of a name, which errors of the model only lower.
    enough = 2.0 * settings.over_none
    best = min(fitted.misfit for fitted in [without, *ahead])
    most = min(1.5 * best, without.misfit - enough)
    worth = [
        fitted
        for fitted in ahead
        if fitted.misfit < min(most, known.get(fitted.placed[-1].label, np.inf) - enough)
    ]
    return in_threads(
        lambda near: settle(problem, fit(problem, near.placed, _further(near).z)), worth[:4]
    )


def _likeliest(problem: Likelihood, fits: list[Fit]) -> list[Fit]:
    """The likelier of two fits of one effect."""
    fits = sorted(fits, key=lambda fitted: log_posterior(problem, fitted))
    return list({fitted.placed[-1].label: fitted for fitted in fits}.values())


def _further(near: Fit, steps: int = STEPS) -> Fit:
    return fit(near.likelihood, near.placed, near.z, steps, near=near.jacobian)


def _froms(problem: Likelihood, without: Fit, distant: Fit | None) -> list[Fit]:
    """The fits without an effect from which those with one begin: the base, and far from it."""
    if distant is None:
        return [without]
    return [without, fit(problem, without.placed, distant.z[: len(without.z)], 0)]


def _glanced(froms: list[Fit], steps: int, distant: Fit | None, test: Score) -> Fit:
    """The best of some steps with an effect, from fits without it."""
    base, tested, large = froms[0], np.array(test.start), list[Floats]()
    start = tested
    if tested.size and test.size != tested[0]:
        # What grows as the square of a size, as smeared peaks do, is taken for far too large by
        # the straight line from the test.
        told = np.concatenate([[test.size], tested[1:]])
        start = nearest(base.likelihood, base, test.placed, (told, tested))
    if tested.size:
        # Where the factors have made up for most of a large effect, a little of it makes things
        # worse, and the test may point to the other side or an impossible size: with beams of one
        # story of a six-story frame at .45, the first steps lead there from 1.5 alone.
        size = test.placed.effect.parameters[0]
        step = np.sign(tested[0] - size.neutral) * size.scale
        shares = np.array([1.0, -1.0] if test.statistic else [1.0, 1.5, 2.0])
        sizes = np.clip(size.neutral + step * shares, size.lower, size.upper)
        sizes = np.unique(sizes[sizes != size.neutral])
        large = [np.array([value, *tested[1:]]) for value in sizes]
    starts = [[start, *large], *([start] for _ in froms[1:])]
    if distant is not None and distant.placed[-1].label == test.placed.label:
        starts[-1] = [distant.known_of(-1)]
    pairs = zip(froms, starts, strict=True)
    tried = (glance(without, test.placed, begun, steps) for without, begun in pairs)
    return min(tried, key=lambda fitted: fitted.misfit)


def _weighed(
    base: Fit, fits: list[Fit], scores: list[Score], settings: DiagnosisSettings
) -> list[Finding]:
    """Findings in the order of their evidence over the model without them."""
    problem, by_label = base.likelihood, {test.placed.label: test for test in scores}
    without = laplace(problem, base)
    gains = [value - without for value in in_threads(partial(laplace, problem), fits)]
    order = sorted(range(len(fits)), key=lambda k: -gains[k])
    # Errors known beforehand are taken along straight lines, which bend: a name must hold about the
    # first fit as about the base. No name comes of less, and errors there only make it less.
    if problem.error.knows and order and gains[order[0]] >= settings.over_none:
        leading = order[: VERDICT.compared + 1]
        there = about(problem, fits[leading[0]])
        values = in_threads(
            lambda fitted: laplace(
                there, settle(there, fit(there, fitted.placed, fitted.z, FIRST_STEPS))
            ),
            [base, *(fits[k] for k in leading)],
        )
        for k, value in zip(leading, values[1:], strict=True):
            gains[k] = min(gains[k], value - values[0])
        order.sort(key=lambda k: -gains[k])
    tests = [by_label[fitted.placed[-1].label] for fitted in fits]
    standing = (k for k in order if gains[k] > -np.inf)  # of others no structure is left
    return [as_finding(base, fits[k], tests[k], gains[k]) for k in standing]


def as_finding(base: Fit, fitted: Fit, test: Score, log_evidence: float) -> Finding:
    """The last effect of a fit, beside the model without it as it is fitted; not yet tested."""
    changes = consequence(base.likelihood, base, fitted)
    return Finding(test, fitted, log_evidence, changes, None, *fitted.last_size)


def _certified(
    base: Fit, findings: tuple[Finding, ...], tried: int, settings: DiagnosisSettings
) -> tuple[Finding, ...]:
    """The findings, the leading ones tested on data to which they were not fitted.

    Where the model errs, instruments' effects that its error may hide are tested too.
    """
    problem, most = base.likelihood, VERDICT.compared
    carried = [finding for finding in findings if finding.log_evidence >= settings.over_none]
    worthy = [*carried[:1], *others_than(carried[0], carried[1:])][:most] if carried else []
    if problem.row != problem.error.first:
        hinted = [finding for finding in findings if finding.log_evidence >= VERDICT.positive]
        instruments = [finding for finding in hinted if finding.placed.effect.instrument][:most]
        worthy += [finding for finding in instruments if finding not in worthy]
    fits = [finding.fitted for finding in worthy]
    tests = certify(problem, base, fits, tried, settings.false_share) if fits else {}
    return tuple(replace(finding, tested=tests.get(finding.placed.label)) for finding in findings)


def with_pair(
    found: Diagnosis, settings: DiagnosisSettings, progress: Progress = SILENT
) -> Diagnosis:
    """The diagnosis, told by two effects where the first alone leaves much of the misfit.

    What removes less than three quarters is no name but a candidate.

    Each by itself explains little, and a third that imitates both may lead. The stronger of the two
    must hold by itself on data to which it was not fitted, the other beside it, and both must
    remove nearly all. Else, and where the first does, the diagnosis stays as it is.
    """
    first = found.leading
    if first is None or found.verdict not in (PARTLY, AMBIGUOUS, INDISTINGUISHABLE):
        return found
    alone = first.removes(found.base)
    if alone >= VERDICT.most:
        return found
    little = alone < VERDICT.least and first.fitted.remains().size >= settings.least_response
    told, left = found, found.base.remains()
    if little and not first.placed.exchange:  # what channels say of themselves stands
        sentence = sentence_of(UNKNOWN, found.findings, (), left, alone)
        told = replace(found, verdict=UNKNOWN, twins=(), left=left, sentence=sentence)
    if found.verdict == INDISTINGUISHABLE:
        return told
    progress.advance(0, "fitting two effects at once")
    best = _best_pair(found, settings, progress)
    if best is None or denied(found, best[0], settings):
        return told
    # Both with the sizes that they have together, the second as it is found beside the first.
    leads, second = best
    both = _both(leads, second)
    gain = laplace(both.likelihood, both) - laplace(both.likelihood, leads.fitted)
    beside = as_finding(leads.fitted, both, second.score, gain)
    if gain >= settings.over_none:
        tried, share = len(found.scores), settings.false_share
        tests = certify(leads.fitted.likelihood, leads.fitted, [both], tried, share)
        beside = replace(beside, tested=tests.get(second.placed.label))
    together = removed(found.base, both)
    enough = together > alone and together >= VERDICT.most
    if not (beside.carried(settings) and beside.matters(settings) and enough):
        return told
    pair = leads.within(both, -2), beside
    left = both.remains()
    text = (
        f"Two effects together: {pair[0].in_words}. {pair[1].in_words}. They remove "
        f"{share_in_words(together)} of the misfit beyond the noise, {first.placed.label} alone "
        f"{share_in_words(alone)}."
    )
    if left.size >= settings.least_response:
        text += " Something else is missing as well."
    return replace(
        found,
        verdict=PARTLY,
        twins=(),
        findings=(*best, *(finding for finding in found.findings if finding not in best)),
        pair=pair,
        left=left,
        sentence=f"{text} {left.sentence}".rstrip(),
    )


def denied(found: Diagnosis, finding: Finding, settings: DiagnosisSettings) -> bool:
    """Whether the halves of the data do not certify what their sum carries."""
    tested, base = finding.tested, found.base
    if tested is None and finding.log_evidence >= settings.over_none:
        tried, share = len(found.scores), settings.false_share
        tests = certify(base.likelihood, base, [finding.fitted], tried, share)
        tested = tests.get(finding.placed.label)
    return tested is not None and not tested.certified


def _best_pair(found: Diagnosis, settings: DiagnosisSettings, progress: Progress) -> Pair | None:
    """The most likely two, the stronger first; without the leading one only if clearly likelier.

    Each of the ten leading findings is fitted together with every other.
    """
    # One of two may show by itself as nothing.
    able = [finding for finding in found.findings if not finding.placed.exchange]
    strong = [finding for finding in able if finding.log_evidence >= finding.needed(settings)][:10]
    pairs = [pair for pair in combinations(able, 2) if pair[0] in strong]
    if not pairs:
        return None

    def log_evidence(pair: Pair) -> float:
        both = _both(*pair)
        return laplace(both.likelihood, both)

    each = counted(log_evidence, progress, "fitting pairs", len(pairs))
    values = dict(zip(pairs, in_threads(each, pairs), strict=True))
    best = max(pairs, key=lambda pair: values[pair])
    with_first = [pair for pair in pairs if found.leading in pair]
    other = max(with_first, key=lambda pair: values[pair], default=best)
    return best if values[best] - values[other] > settings.margin(values[best]) else other


def _both(first: Finding, second: Finding) -> Fit:
    return with_more(first.fitted, second.placed, second.fitted.known_of(-1))
