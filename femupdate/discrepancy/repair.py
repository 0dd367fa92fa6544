"""Adding what is missing, one effect a round, as long as the evidence carries it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from femupdate.discrepancy.certify import missed_in_turn
from femupdate.discrepancy.diagnose import (
    AMBIGUOUS,
    INDISTINGUISHABLE,
    NAMED,
    PARTLY,
    Diagnosis,
    Finding,
    diagnose,
    others_than,
)
from femupdate.discrepancy.finder_model import FinderModel
from femupdate.discrepancy.fit import Fit, extended, fit, settle
from femupdate.discrepancy.pairs import denied, with_pair
from femupdate.discrepancy.remains import Remains, remains
from femupdate.discrepancy.search import refined
from femupdate.discrepancy.thresholds import FIT, VERDICT, DiagnosisSettings
from femupdate.inference.likelihood import Likelihood
from femupdate.progress import SILENT, Progress

Elsewhere = Callable[[Likelihood, Fit, Fit], float]


@dataclass(frozen=True, eq=False)
class Round:
    """One effect that was added.

    Attributes:
        diagnosis: what was found.
        finding: what was added.
        chi2_before, chi2_after: sums of squared residuals.
    """

    diagnosis: Diagnosis
    finding: Finding
    chi2_before: float
    chi2_after: float

    def stands_in(self, points: float) -> bool:
        """Whether most of the misfit beyond the noise of so many points stayed."""
        beyond = max(self.chi2_before - points, 1.0)
        return self.chi2_before - self.chi2_after < VERDICT.most * beyond


@dataclass(frozen=True, eq=False)
class Repair:
    """A model before and after.

    Attributes:
        before: the model as it was, fitted.
        after: the model with all that was added, fitted; the same as before where nothing was.
        rounds: what was added.
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
    allowed, it always does on quiet records.

    An effect that competes with another, or that these sensors cannot tell from another, is added
    only where data kept out decide between them; else the engineer does.

    Args:
        problem: the likelihood of the data.
        base: the model as it is, fitted.
        settings: of the diagnosis.
        progress: see `diagnose`.
        renewed: makes the problem and the fit anew where an exchange of channels was added, which
            moves theta far; by default they stay.
        found: of the model as it is, with its pair, where it was diagnosed already.
        elsewhere: log density of data kept out by the second of two fits over that by the first; by
            default each half of the data is kept out in turn.
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
        if not (certain or rivals) or len(rounds) == VERDICT.most_rounds:
            break
        leading, worse = _chosen(now, found, settings, elsewhere)
        refused |= {one.placed.label: one for one in worse}
        if leading is None:
            break
        # What was refused beside one effect may be right beside two.
        refused.pop(leading.placed.label, None)
        rounds.append(Round(found, leading, current.chi2, leading.fitted.chi2))
        current, found = leading.fitted, None
        if renewed is not None and leading.placed.exchange:
            now, current = renewed(now, current)
    current, rounds = _needed(base, current, rounds)
    left = remains(now, current)
    return Repair(base, current, tuple(rounds), found, left, now, tuple(refused.values()))


def _needed(base: Fit, current: Fit, rounds: list[Round]) -> tuple[Fit, list[Round]]:
    """The model without what others have made needless, and the rounds that stay.

    Where a third effect imitates two, it may be the first that is added. Beside the two, nothing
    of it is left.
    """
    first, squares = len(base.known), base.chi2
    values, sd = current.sizes()
    sizes, kept = list(values[:first]), list[Round]()
    for one in rounds:
        own = one.finding.placed.effect.parameters
        size, error = values[first : first + len(own)], sd[first : first + len(own)]
        first += len(own)
        if own and abs(size[0] - own[0].neutral) < VERDICT.needless * error[0]:
            continue
        sizes += list(size)
        kept.append(replace(one, chi2_before=squares))
        squares = one.chi2_after
    if len(kept) == len(rounds):
        return current, rounds
    problem, placed = current.likelihood, (*base.placed, *(one.finding.placed for one in kept))
    start = extended(problem, current, placed, np.array(sizes))
    return settle(problem, fit(problem, placed, start, FIT.steps)), kept


def _chosen(
    problem: Likelihood,
    found: Diagnosis,
    settings: DiagnosisSettings,
    elsewhere: Elsewhere | None,
) -> tuple[Finding | None, tuple[Finding, ...]]:
    """What is added, and what leads but predicts data kept out worse.

    Such data certify by themselves, also what the data alone would give no name. What all data
    together hold clearly likelier than the first goes before it.
    """
    if elsewhere is None:
        return _kept_in_turn(found)
    rivals = _rivals(found)
    if rivals and (one := _decided(problem, found.base, rivals, settings, elsewhere)):
        return one, ()
    accepted: list[tuple[float, Finding]] = []
    refused: list[Finding] = []
    for one in found.findings[len(rivals) :]:
        value = one.evidence.log_evidence
        if denied(found, one, settings) or value < VERDICT.positive or not one.matters(settings):
            continue
        gain = elsewhere(problem, found.base, one.fitted)
        certain = value >= settings.over_none
        least = float(np.log(len(found.scores) / settings.false_share))
        if certain:
            # What differs between events alone hides in their scatter.
            least = 0.0 if one.placed.effect.needs_levels else VERDICT.clearly
        if gain > least and value + gain >= settings.over_none:
            accepted.append((value + gain, one))
        elif certain:
            refused.append(one)
    return _likeliest(accepted, settings), tuple(refused)


def _likeliest(
    accepted: list[tuple[float, Finding]], settings: DiagnosisSettings
) -> Finding | None:
    """The first of what is accepted, or what all data together hold clearly likelier, if any."""
    if not accepted:
        return None
    totals = {id(one): total for total, one in accepted}
    first, *others = [one for _, one in accepted]
    best = max([first, *others_than(first, others)], key=lambda one: totals[id(one)])
    lead = totals[id(best)] - totals[id(first)]
    return best if lead > settings.margin(totals[id(best)]) else first


def _kept_in_turn(found: Diagnosis) -> tuple[Finding | None, tuple[Finding, ...]]:
    """What leads, unless a half of the data is predicted worse with it by a fit to the other.

    Its log density there is certified already; see `certify`. Two at once are judged together.
    """
    first, last = found.findings[0], [*found.findings[:1], *found.pair][-1]
    worse = missed_in_turn(last.fitted) >= missed_in_turn(found.base)
    return (None, (first,)) if worse else (first, ())


def _rivals(found: Diagnosis) -> tuple[Finding, ...]:
    """The findings that compete for the first place; none where the first has none."""
    if not found.twins:
        return ()
    last = max(k for k, one in enumerate(found.findings) if one.placed.label in found.twins)
    return found.findings[: last + 1]


def _decided(
    problem: Likelihood,
    base: Fit,
    rivals: tuple[Finding, ...],
    settings: DiagnosisSettings,
    elsewhere: Elsewhere,
) -> Finding | None:
    """Of effects that compete, the one that all data together hold clearly likelier, if any."""
    gains = [elsewhere(problem, base, one.fitted) for one in rivals]
    totals = [one.evidence.log_evidence + gain for one, gain in zip(rivals, gains, strict=True)]
    second, first = np.argsort(totals)[-2:]
    clear = totals[first] - totals[second] > settings.margin(totals[first])
    return rivals[first] if clear and gains[first] > 0.0 else None


def as_fitted(done: Repair) -> Repair:
    """The rounds with the sizes, and the last with the squares, of the model after all of them.

    A model that was fitted anew at the end has moved the sizes on from where they were named.
    """
    values, sd = done.after.sizes()
    first = len(done.before.sizes()[0])
    rounds = []
    for one in done.rounds:
        finding, count = one.finding, len(one.finding.placed.effect.parameters)
        if count:
            size, error = float(values[first]), float(sd[first])
            finding = replace(finding, size=size, size_sd=error)
        first += count
        rounds.append(replace(one, finding=finding))
    rounds[-1:] = [replace(one, chi2_after=done.after.chi2) for one in rounds[-1:]]
    return replace(done, rounds=tuple(rounds))


def mend(
    model: FinderModel,
    problem: Likelihood,
    base: Fit,
    found: Diagnosis,
    settings: DiagnosisSettings,
    show: Progress,
    elsewhere: Elsewhere | None = None,
) -> tuple[Likelihood, Repair]:
    """What was added, and the problem on a basis about the last fit.

    Args:
        model: of the building.
        problem: the likelihood of the data.
        base: the model as it is, fitted.
        found: of the model as it is.
        settings: of the diagnosis.
        show: told about the steps.
        elsewhere: see `repair`.
    """

    def renewed(now: Likelihood, fitted: Fit) -> tuple[Likelihood, Fit]:
        return refined(model, now, fitted, show)

    done = repair(problem, base, settings, show, renewed, found, elsewhere)
    if not done.rounds or done.rounds[-1].finding.placed.exchange:
        return done.problem, done
    mended, last = refined(model, done.problem, done.after, show, alone=True)
    return mended, as_fitted(replace(done, after=last, left=remains(mended, last)))
