"""Two effects at once: each by itself explains little, and a third that imitates both may lead."""

from itertools import combinations

import numpy as np

from femupdate.discrepancy.diagnose import Diagnosis, Finding
from femupdate.discrepancy.evidence import laplace
from femupdate.discrepancy.fit import extended, fit, settle
from femupdate.discrepancy.thresholds import FIT, VERDICT, DiagnosisSettings
from femupdate.workers import in_threads


def led_by_a_pair(found: Diagnosis, settings: DiagnosisSettings) -> tuple[Finding, ...]:
    """The findings, led by the stronger of the best two where these do without the first.

    Each of the leading findings is fitted together with every other. The best two go before the
    first where the best pair with it is clearly less likely.

    Args:
        found: a diagnosis whose leading finding leaves most of the misfit.
        settings: of the diagnosis.
    """
    # One of two may show by itself as nothing.
    able = [one for one in found.findings if not one.placed.exchange]
    strong = [one for one in able if one.evidence.log_evidence >= settings.over_none]
    names = {one.placed.label for one in strong[: VERDICT.paired]}
    pairs = [pair for pair in combinations(able, 2) if pair[0].placed.label in names]
    if not pairs:
        return found.findings
    values = in_threads(lambda pair: _log_evidence(found, *pair), pairs)
    best = int(np.argmax(values))
    with_first = [
        value
        for value, pair in zip(values, pairs, strict=True)
        if any(one is found.findings[0] for one in pair)
    ]
    least = max(with_first, default=-np.inf)
    if values[best] - least <= settings.margin(values[best]):
        return found.findings
    leading = pairs[best][0]
    return (leading, *(one for one in found.findings if one is not leading))


def _log_evidence(found: Diagnosis, first: Finding, second: Finding) -> float:
    """Of a model with both effects, over that with neither."""
    problem, placed = first.fitted.problem, (*first.fitted.placed, second.placed)
    count = len(second.placed.effect.parameters)
    own = second.fitted.known[len(second.fitted.known) - count :]
    start = extended(problem, first.fitted, placed, np.concatenate([first.fitted.known, own]))
    both = settle(problem, fit(problem, placed, start, FIT.steps))
    without = laplace(found.base.problem, found.base).log_evidence
    return laplace(problem, both).log_evidence - without
