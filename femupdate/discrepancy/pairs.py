"""Two effects at once: each by itself explains little, and a third that imitates both may lead."""

from dataclasses import replace
from itertools import combinations

import numpy as np

from femupdate.discrepancy.certify import certify
from femupdate.discrepancy.diagnose import (
    PARTLY,
    STANDS_IN,
    Diagnosis,
    Finding,
    as_finding,
    removed,
    share_in_words,
)
from femupdate.discrepancy.evidence import Evidence, laplace
from femupdate.discrepancy.fit import Fit, extended, fit, settle
from femupdate.discrepancy.remains import remains
from femupdate.discrepancy.thresholds import FIT, VERDICT, DiagnosisSettings
from femupdate.progress import SILENT, Progress, counted
from femupdate.workers import in_threads

Pair = tuple[Finding, Finding]


def with_pair(
    found: Diagnosis, settings: DiagnosisSettings, progress: Progress = SILENT
) -> Diagnosis:
    """The diagnosis, told by two effects where the first alone leaves most of the misfit.

    The stronger of the two must hold by itself on data to which it was not fitted, the other beside
    it, and both must remove more than the first. Else, and where the first leaves less than half,
    the diagnosis stays as it is.
    """
    first = found.leading
    if first is None or found.verdict != PARTLY:
        return found
    alone = removed(found.base, first.fitted)
    if alone >= VERDICT.most:
        return found
    progress.advance(0, "fitting two effects at once")
    best = _best_pair(found, settings, progress)
    if best is None or denied(found, best[0], settings):
        return found
    pair = _together(found, best, settings)
    both = pair[1].fitted
    together = removed(found.base, both)
    if not (pair[1].carried(settings) and pair[1].matters(settings) and together > alone):
        return found
    left = remains(both.likelihood, both)
    text = (
        f"Two effects together: {pair[0].in_words}. {pair[1].in_words}. They remove "
        f"{share_in_words(together)} of the misfit beyond the noise, {first.placed.label} alone "
        f"{share_in_words(alone)}."
    )
    if left.size >= settings.least_response:
        text += " Something else is missing as well."
    doubt = "" if together >= VERDICT.most else STANDS_IN
    return replace(
        found,
        findings=(*best, *(one for one in found.findings if one not in best)),
        pair=pair,
        left=left,
        sentence=" ".join(part for part in (text, doubt, left.sentence) if part),
    )


def denied(found: Diagnosis, one: Finding, settings: DiagnosisSettings) -> bool:
    """Whether the halves of the data do not certify what their sum carries."""
    tested, problem = one.tested, found.base.likelihood
    if tested is None and one.evidence.log_evidence >= settings.over_none:
        tests = certify(problem, found.base, [one.fitted], len(found.scores), settings.false_share)
        tested = tests.get(one.placed.label)
    return tested is not None and not tested.certified


def _best_pair(found: Diagnosis, settings: DiagnosisSettings, progress: Progress) -> Pair | None:
    """The most likely two, the stronger first; without the leading one only if clearly likelier.

    Each of the leading findings is fitted together with every other.
    """
    # One of two may show by itself as nothing.
    able = [one for one in found.findings if not one.placed.exchange]
    strong = [one for one in able if one.evidence.log_evidence >= one.needed(settings)]
    names = {one.placed.label for one in strong[: VERDICT.paired]}
    pairs = [pair for pair in combinations(able, 2) if pair[0].placed.label in names]
    if not pairs:
        return None
    each = counted(_log_evidence, progress, "fitting pairs", len(pairs))
    values = dict(zip(pairs, in_threads(each, pairs), strict=True))
    best = max(pairs, key=lambda pair: values[pair])
    with_first = [pair for pair in pairs if found.leading in pair]
    other = max(with_first, key=lambda pair: values[pair], default=best)
    return best if values[best] - values[other] > settings.margin(values[best]) else other


def _log_evidence(pair: Pair) -> float:
    """Of a model with both effects."""
    both = _both(*pair)
    return laplace(both.likelihood, both).log_evidence


def _both(first: Finding, second: Finding) -> Fit:
    problem, placed = first.fitted.likelihood, (*first.fitted.placed, second.placed)
    count = len(second.placed.effect.parameters)
    own = second.fitted.known[len(second.fitted.known) - count :]
    start = extended(problem, first.fitted, placed, np.concatenate([first.fitted.known, own]))
    return settle(problem, fit(problem, placed, start, FIT.steps))


def _together(found: Diagnosis, pair: Pair, settings: DiagnosisSettings) -> Pair:
    """Both with the sizes that they have together, the second as it is found beside the first."""
    first, second = pair
    both = _both(first, second)
    at, (values, sd) = len(found.base.known), both.sizes()
    told = first
    if first.placed.effect.parameters:
        told = replace(first, size=float(values[at]), size_sd=float(sd[at]))
    gain = laplace(both.likelihood, both).log_evidence
    gain -= laplace(both.likelihood, first.fitted).log_evidence
    beside = as_finding(both.likelihood, first.fitted, both, second.score, Evidence(gain))
    if gain < settings.over_none:
        return told, beside
    count, share = len(found.scores), settings.false_share
    tests = certify(first.fitted.likelihood, first.fitted, [both], count, share)
    return told, replace(beside, tested=tests.get(second.placed.label))
