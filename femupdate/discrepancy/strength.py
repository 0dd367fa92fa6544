"""Whether a structure changes while it shakes: its run parted by strength.

One linear model serves the weak and the strong parts of a run alike, whatever it errs by: what it
misses in one third it misses in the others. Stiffness that falls and damping that grows with the
motion show as what no linear effect explains. Where these laws do not hold, as for stories that
slip in a few cycles, the run itself tells: a model that lacks nothing leaves noise of it, as strong
in its weak parts as in its strong ones.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial, reduce

import numpy as np
from scipy.ndimage import uniform_filter1d

from femupdate.arrays import Floats
from femupdate.discrepancy.diagnose import as_finding
from femupdate.discrepancy.evidence import laplace
from femupdate.discrepancy.findings import NAMED, NONE, NONLINEAR, UNKNOWN, Diagnosis, Finding
from femupdate.discrepancy.fit import Fit, about, fit, log_posterior, settle, with_more
from femupdate.discrepancy.score import score
from femupdate.discrepancy.thresholds import DiagnosisSettings
from femupdate.dynamics.history import transformed_sensors
from femupdate.dynamics.level import PERIODS, strongest_hz
from femupdate.effects.catalogue.softening import AmplitudeSoftening
from femupdate.effects.effect import Placed
from femupdate.effects.registry import CATALOGUE
from femupdate.inference.frf_data import FrfData, frf_data, that_says, together
from femupdate.inference.likelihood import joint_error
from femupdate.inference.model_error import COARSE_ERROR
from femupdate.measurement.frf import by_strength
from femupdate.measurement.observation import Observation
from femupdate.units import percent
from femupdate.workers import in_threads

_HINT = 3.0  # standard deviations of the score test from which a change is fitted
# of the strong part of a run, that a model with a name may miss: nine linear sticks with their
# right effects missed .5 to 2.3 %, a frame on another mesh 11 %, four that yielded 47 to 74 %
_MISSED = 0.2
# the share of its strong third over that of its weak one that a model fitted to the weak one
# misses: seven linear sticks with something missing .6 to 1.05, eight of nine that yield 2.6 to 7.2
_TIMES = 2.0
_SERVES = (
    "No linear effect explains that. The factors are those of the mean strength of this run, and "
    "serve motions of that strength; a record at another level shows how they change."
)


def judged_by_strength(
    found: Diagnosis,
    run: Observation | None,
    direction: str,
    settings: DiagnosisSettings,
    use_phase: bool = True,
) -> Diagnosis:
    """The diagnosis, told as nonlinear where the thirds of a run by strength differ.

    A name that does not reproduce the run is none.

    Args:
        run: from the histories of which the diagnosis was made; None where there are several runs.
        direction: of the motion.
        use_phase: compare phases.
    """
    if run is None or run.histories is None:
        return found
    parts = [
        frf_data(that_says(part), found.base.system.floors, use_phase=use_phase, table=COARSE_ERROR)
        for part in by_strength(run, direction)
    ]
    changed = _told_by_thirds(found, reduce(together, parts), settings) if parts else found
    if changed.verdict not in (NAMED, NONE, UNKNOWN):
        return changed
    named = found.verdict == NAMED
    linear = found.findings[0].fitted if named else found.allowed or found.base
    missed = missed_in_run(linear, run, direction)
    if missed < _MISSED:
        return found
    changed = _told_by_weak(found, linear, parts, run, direction) if parts else found
    if changed.verdict not in (NAMED, NONE):
        return changed
    doubt = (
        f"{percent(missed)} of the strong part of the run beyond the noise of its weak part: the "
        "structure may change while it shakes, or something else is missing."
    )
    if not named:
        return replace(found, sentence=f"{found.sentence} Yet it misses {doubt}")
    text = f"{found.findings[0].in_words}, or so the response functions say; but with it the model"
    return replace(found, verdict=UNKNOWN, sentence=f"{text} misses {doubt}")


def missed_in_run(fitted: Fit, run: Observation, direction: str) -> float:
    """What a model misses of a run's strong third beyond that of its weak third, a share (rms).

    Of all floors together, within the band of the run.
    """
    (weak, strong), (_, whole) = _left_in_run(fitted, run, direction)
    return float(np.sqrt(max(strong - weak, 0.0) / whole))


def _left_in_run(fitted: Fit, run: Observation, direction: str) -> Floats:
    """Mean squares (2, 2) of what a model misses and of what was measured; weak, strong third."""
    histories, of = run.histories, fitted.likelihood
    assert histories is not None
    base, floors, names = histories.means(direction)
    rotation, step = histories.rotation, histories.time_step
    inputs = np.stack([base] if rotation is None else [base, rotation])
    rows = [of.system.floors.index(name) for name in run.floors]
    predicted = transformed_sensors(fitted.system, fitted.split, inputs, step)[rows]
    seen = floors[[names.index(name) for name in run.floors]]
    frequency = np.fft.rfftfreq(base.size, step)
    beyond = (frequency < run.frequency_hz[0]) | (frequency > of.top_hz)

    def within(motion: Floats) -> Floats:
        spectrum = np.fft.rfft(motion, axis=1)
        spectrum[:, beyond] = 0.0
        return np.fft.irfft(spectrum, base.size, axis=1)

    seen, left = within(seen), within(seen - predicted)
    width = max(1, round(PERIODS / strongest_hz(seen, step) / step))
    power = uniform_filter1d((seen**2).mean(axis=0), width)
    weak, strong = np.quantile(power, (1.0 / 3.0, 2.0 / 3.0))
    thirds = power <= weak, power >= strong
    return np.array([[(each[:, part] ** 2).mean() for part in thirds] for each in (left, seen)])


def _told_by_weak(
    found: Diagnosis, linear: Fit, thirds: list[FrfData], run: Observation, direction: str
) -> Diagnosis:
    """The diagnosis, told as nonlinear where a fit to the weak third fails in the strong one.

    Whatever a linear model lacks, it misses as large a share of the weak third as of the strong
    one. The story is the one whose factor falls most from a fit to the weak third to one to the
    strong.
    """

    def fitted_to(part: FrfData) -> Fit:
        error = joint_error((part,))
        whole = replace(linear.likelihood, data=(part,), error=error, row=error.first)
        problem = about(whole, linear)
        return settle(problem, fit(problem, linear.placed, linear.z))

    weak, strong = fitted_to(thirds[0]), fitted_to(thirds[-1])
    left = _left_in_run(weak, run, direction)
    missed = np.sqrt(left[0] / left[1])
    if missed[1] < _TIMES * missed[0]:
        return found
    level = max(thirds[-1].levels)
    (before, before_sd), (after, after_sd) = weak.theta(), strong.theta()
    fall, sd = np.log(after / before), np.hypot(before_sd / before, after_sd / after)
    story = int((fall / sd).argmin())
    name, changes = linear.likelihood.building.story_names[story], list[Finding]()
    where = "Which story changes is not certain."
    if fall[story] < -_HINT * sd[story]:
        where = (
            f"Where the run is strong ({2.0**level:.2g} times the motion of its weak parts), {name}"
            f" is {percent(-np.expm1(fall[story]))} softer than where it is weak "
            f"(± {percent(sd[story])})."
        )
        placed, size = Placed(CATALOGUE["amplitude_softening"], name), fall[story] / level
        changed = with_more(strong, placed, np.array([size, 0.0]))
        kept = fit(strong.likelihood, strong.placed, weak.z, 0)
        gain = log_posterior(strong.likelihood, strong) - log_posterior(strong.likelihood, kept)
        test = score(strong.likelihood, strong, placed)
        finding = as_finding(strong, changed, test, gain)
        changes = [replace(finding, size=float(size), size_sd=float(sd[story] / level))]
    sentence = (
        f"{where} A linear model that serves the weak third of the run misses {percent(missed[0])} "
        f"of it, and {percent(missed[1])} of the strong third. {_SERVES}"
    )
    return _nonlinear(found, changes, sentence)


def _told_by_thirds(found: Diagnosis, thirds: FrfData, settings: DiagnosisSettings) -> Diagnosis:
    """The diagnosis, told as nonlinear where stiffness or damping depend on the strength."""
    named = found.leading if found.verdict not in (NONE, UNKNOWN) else None
    if named is not None and isinstance(named.placed.effect, AmplitudeSoftening):
        named = None  # it says the same, of all stories
    changes = _changes(found.base if named is None else named.fitted, thirds, settings)
    if not changes:
        return found
    if named is not None:
        # What is linear must not take the place of what is not.
        alone = _changes(found.base, thirds, settings)
        fits = [change[0].fitted for change in (changes, alone) if change]
        values = [laplace(fitted.likelihood, fitted) for fitted in fits]
        if alone and values[0] < values[1] + settings.over_none:
            named, changes = None, alone
    size, level = changes[0].size, max(thirds.levels)
    damping = float(changes[0].fitted.known_of(-1)[1])
    turn = "grows" if damping >= 0.0 else "falls"
    parts = [
        f"{changes[0].in_words}, and the damping ratio {turn} by {percent(abs(damping))}.",
        f"Where the run is strong ({2.0**level:.2g} times the motion of its weak parts), it is "
        f"{percent(1.0 - (1.0 + size) ** level)} softer than where it is weak.",
        _SERVES,
    ]
    if named is not None:
        parts.append(f"Beside it: {named.in_words}.")
    return _nonlinear(found, (*changes, *found.findings), " ".join(parts))


def _nonlinear(found: Diagnosis, findings: Sequence[Finding], sentence: str) -> Diagnosis:
    """The diagnosis with another verdict."""
    told = replace(found, verdict=NONLINEAR, findings=tuple(findings), sentence=sentence)
    return replace(told, twins=(), worth=(), pair=())


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
    findings = [finding for finding in findings if finding.log_evidence >= settings.over_none]
    return tuple(sorted(findings, key=lambda finding: -finding.log_evidence))
