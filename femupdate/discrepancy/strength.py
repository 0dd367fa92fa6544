"""Whether a structure changes while it shakes: its run parted by strength.

One linear model serves the weak and the strong parts of a run alike, whatever it errs by: what it
misses in one third it misses in the others. Stiffness that falls and damping that grows with the
motion show as what no linear effect explains.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from femupdate.discrepancy.diagnose import as_finding
from femupdate.discrepancy.evidence import laplace
from femupdate.discrepancy.findings import NONE, NONLINEAR, UNKNOWN, Diagnosis, Finding
from femupdate.discrepancy.fit import Fit, about, fit, settle, with_more
from femupdate.discrepancy.score import score
from femupdate.discrepancy.thresholds import DiagnosisSettings
from femupdate.effects.catalogue.amplitude_softening import AmplitudeSoftening
from femupdate.effects.effect import Placed
from femupdate.effects.registry import CATALOGUE
from femupdate.inference.frf_data import FrfData
from femupdate.inference.joint_error import joint_error
from femupdate.units import percent
from femupdate.workers import in_threads

_HINT = 3.0  # standard deviations of the score test from which a change is fitted


def judged_by_strength(
    found: Diagnosis, thirds: FrfData | None, settings: DiagnosisSettings
) -> Diagnosis:
    """The diagnosis, told as nonlinear where the thirds of the run by strength differ.

    Args:
        thirds: the run parted by strength, each part at its level; None where it cannot be.
    """
    if thirds is None:
        return found
    named = found.leading if found.verdict not in (NONE, UNKNOWN) else None
    if named is not None and isinstance(named.placed.effect, AmplitudeSoftening):
        named = None  # it says the same, of all stories
    changes = _changes(found.base if named is None else named.fitted, thirds, settings)
    if not changes:
        return found
    if named is not None:
        # What is linear must not take the place of what is not.
        alone = _changes(found.base, thirds, settings)
        if alone and _evidence(changes[0]) < _evidence(alone[0]) + settings.over_none:
            named, changes = None, alone
    size, level = changes[0].size, max(thirds.levels)
    damping = float(changes[0].fitted.known_of(-1)[1])
    parts = [
        f"{changes[0].in_words}, and the damping ratio grows by {percent(damping)}.",
        f"Where the run is strong ({2.0**level:.2g} times the motion of its weak parts), it is "
        f"{percent(1.0 - (1.0 + size) ** level)} softer than where it is weak.",
        "No linear effect explains that. The factors are those of the mean strength of this run, "
        "and serve motions of that strength; a record at another level shows how they change.",
    ]
    if named is not None:
        parts.append(f"Beside it: {named.in_words}.")
    return replace(
        found,
        verdict=NONLINEAR,
        findings=(*changes, *found.findings),
        twins=(),
        worth=(),
        pair=(),
        sentence=" ".join(parts),
    )


def _changes(linear: Fit, thirds: FrfData, settings: DiagnosisSettings) -> tuple[Finding, ...]:
    """What changes with strength beside a linear model, the likeliest first; none if nothing."""
    error = joint_error((thirds,))
    whole = replace(linear.likelihood, data=(thirds,), error=error, row=error.first)
    problem = about(whole, linear)
    rough = settle(problem, fit(problem, linear.placed, linear.z, 0), 0)
    effect = CATALOGUE["amplitude_softening"]
    places = [Placed(effect, at) for at in effect.places(problem.reduced.structure)]
    tests = in_threads(partial(score, rough.likelihood, rough), places)
    tests.sort(key=lambda test: -abs(test.statistic))
    if abs(tests[0].statistic) < _HINT:
        return ()
    base = settle(problem, fit(problem, linear.placed, linear.z))
    tests = [*tests[:3], *(test for test in tests[3:] if test.placed.place == "all")]
    fits = in_threads(lambda test: with_more(base, test.placed, np.array([test.size, 0.0])), tests)
    without = laplace(problem, base)
    findings = [
        as_finding(base, fitted, test, laplace(problem, fitted) - without)
        for fitted, test in zip(fits, tests, strict=True)
    ]
    findings = [one for one in findings if one.log_evidence >= settings.over_none]
    return tuple(sorted(findings, key=lambda one: -one.log_evidence))


def _evidence(change: Finding) -> float:
    return laplace(change.fitted.likelihood, change.fitted)
