"""What the trials of the effect finder come to."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from femupdate.discrepancy.thresholds import VERDICT

from ..result import markdown_table
from .draw import CLEAN, ONE, OUTSIDE, TWO
from .kinds import DESCRIBED
from .measurement import TrialSettings
from .trial import Outcome

_SEEN = 0.99  # absorbed beyond this an effect is theta itself


@dataclass(frozen=True)
class Row:
    """One line of the summary."""

    what: str
    found: str
    of: int


def summary(outcomes: Sequence[Outcome]) -> list[Row]:
    """The table of all figures."""
    clear = [o for o in outcomes if _visible(o) and o.strength >= 6.0]
    right = [o for o in clear if o.verdict == "named" and o.named_right]
    seconds = _median("seconds a case (median)", [o.seconds for o in outcomes])
    return [
        *_detections(outcomes),
        *_names(outcomes, clear),
        *_of_two(outcomes),
        *_repairs(right),
        seconds,
    ]


def _visible(outcome: Outcome) -> bool:
    """Whether one effect was hidden that theta does not absorb."""
    return outcome.kind == ONE and outcome.absorbed < _SEEN


def _detections(outcomes: Sequence[Outcome]) -> list[Row]:
    clean = [o for o in outcomes if o.kind == CLEAN]
    strong = [o for o in outcomes if _visible(o) and o.strength >= 5.0]
    detected = attrgetter("detected")
    return [
        _share("false alarms on clean cases", clean, detected),
        _share("detected, D >= 5", strong, detected),
    ]


def _names(outcomes: Sequence[Outcome], clear: Sequence[Outcome]) -> list[Row]:
    """How often names are right, of all outcomes and of effects that are clear (D >= 6)."""
    named = [o for o in outcomes if o.verdict == "named"]
    given = [o for o in outcomes if o.verdict in ("named", "partly")]
    strong = [o for o in outcomes if _visible(o) and o.strength >= 5.0]
    absorbed = [o for o in outcomes if o.kind == ONE and o.absorbed >= _SEEN]
    foreign = [o for o in outcomes if o.kind == OUTSIDE and o.strength >= 10.0]
    first_right = attrgetter("named_right")
    together = "right, or named together with what these sensors cannot tell from it, D >= 6"
    return [
        _share("first name and place right, D >= 6", clear, first_right),
        _share(together, clear, lambda o: o.named_right or _named_together(o)),
        _share(
            "verdict 'named' and the name right, D >= 6",
            clear,
            lambda o: o.verdict == "named" and o.named_right,
        ),
        _share("right among all names given", named, lambda o: o.named in o.hidden),
        _share(
            "false discoveries: wrong among names given, 'partly' among them",
            given,
            lambda o: o.named not in o.hidden,
        ),
        _share(
            "the same, without those told with doubt",
            [o for o in given if not _doubtful(o)],
            lambda o: o.named not in o.hidden,
        ),
        _share("among the first three, D >= 5", strong, attrgetter("in_first_three")),
        _share(
            "what theta absorbs is not named",
            absorbed,
            lambda o: o.verdict != "named" or o.named_right,
        ),
        _share(
            "outside the catalogue, D >= 10: something is said to be left",
            foreign,
            lambda o: o.verdict in ("unknown", "partly", "ambiguous", "indistinguishable"),
        ),
    ]


def _of_two(outcomes: Sequence[Outcome]) -> list[Row]:
    """What is told of two hidden effects, and what a repair adds."""
    two = [o for o in outcomes if o.kind == TWO]
    return [
        _share("two effects: the first name is one of them", two, lambda o: o.named in o.hidden),
        _share(
            "two effects, D >= 6 of each beside the other: the repair adds both",
            [o for o in two if min(o.beside) >= 6.0],
            lambda o: set(o.hidden) <= set(o.added),
        ),
        _share(
            "two effects: the repair adds nothing else",
            two,
            lambda o: set(o.added) <= set(o.hidden),
        ),
        _share(
            "two told together: both are right",
            [o for o in outcomes if o.pair],
            lambda o: set(o.pair) == set(o.hidden),
        ),
    ]


def _repairs(right: Sequence[Outcome]) -> list[Row]:
    """What adding the effect does, of outcomes whose verdict and name are right."""
    sized = [o for o in right if np.isfinite(o.size_true)]  # an exchange has none
    removed, held = [o.excess_removed for o in right], [_held_out_removed(o) for o in right]
    before, after = [o.bias_share_before for o in right], [o.bias_share_after for o in right]
    deviations = [o.bias_after for o in right]
    errors = [_size_error(o) for o in right]
    return [
        _median("excess chi2 removed (median)", removed, "%"),
        _median("excess held-out error removed (median)", held, "%"),
        _median("theta bias after, posterior sd (median)", deviations),
        _median("theta bias before, relative (median)", before, "%"),
        _median("theta bias after, relative (median)", after, "%"),
        _share(
            "size within 2 sd",
            sized,
            lambda o: abs(o.size - o.size_true) <= 2.0 * o.size_sd,
        ),
        _median("error of the size, relative (median)", errors, "%"),
    ]


def _doubtful(outcome: Outcome) -> bool:
    """Whether most of the misfit is said to have another cause than the name."""
    return outcome.verdict == "partly" and outcome.excess_removed < VERDICT.most


def _named_together(outcome: Outcome) -> bool:
    """Whether the effect is among those that the finder says it cannot tell apart."""
    unsure = outcome.verdict in ("indistinguishable", "ambiguous")
    return unsure and outcome.hidden[0] in (outcome.named, *outcome.twins)


def _size_error(outcome: Outcome) -> float:
    if not np.isfinite(outcome.size_true) or outcome.size_true == 0.0:
        return float("nan")
    return abs(outcome.size - outcome.size_true) / abs(outcome.size_true)


def _held_out_removed(outcome: Outcome) -> float:
    """Share of the error beyond what remains when all is right that was removed."""
    excess = outcome.held_before - outcome.held_floor
    return (outcome.held_before - outcome.held_after) / max(excess, 1e-9)


def _share(what: str, cases: Sequence[Outcome], good: Callable[[Outcome], bool]) -> Row:
    if not cases:
        return Row(what, "-", 0)
    p = sum(map(good, cases)) / len(cases)
    error = np.sqrt(max(p * (1.0 - p), 0.25 / len(cases)) / len(cases))
    return Row(what, f"{p:.1%} ± {error:.1%}", len(cases))


def _median(what: str, values: Sequence[float], unit: str = "") -> Row:
    finite = [value for value in values if np.isfinite(value)]
    if not finite:
        return Row(what, "-", 0)
    middle = float(np.median(finite))
    found = f"{middle:.1%}" if unit == "%" else f"{middle:.2f}"
    return Row(what, found, len(finite))


def summary_text(building: str, settings: TrialSettings, rows: Sequence[Row], data: str) -> str:
    """How it was measured, and the table in Markdown; outcomes are in the JSON file."""
    seconds = ", ".join(f"{length:g}" for length in settings.durations_s)
    measured = (
        f"{seconds} s at {settings.sampling_hz:g} Hz, sensor noise "
        f"{settings.sensor_noise_m_s2:g} m/s2"
    )
    table = markdown_table(("", "found", "cases"), [(r.what, r.found, str(r.of)) for r in rows])
    return f"Building {building}. {DESCRIBED.get(data, measured)}.\n\n{table}\n"
