"""What the trials of the effect finder come to, beside the targets."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..result import markdown_table
from .cases import CLEAN, FOREIGN, ONE, TWO, Outcome, TrialSettings

_SEEN = 0.99  # absorbed beyond this an effect is theta itself
_STRENGTHS = (5.0, 10.0, 20.0, 50.0, 100.0)  # D at which the table is cut


@dataclass(frozen=True)
class Row:
    """One line of the summary."""

    what: str
    first: str
    goal: str
    found: str
    of: int


def summary(outcomes: Sequence[Outcome]) -> list[Row]:
    """The table of the targets."""
    clean = [o for o in outcomes if o.kind == CLEAN]
    one = [o for o in outcomes if o.kind == ONE]
    visible = [o for o in one if o.absorbed < _SEEN]
    strong = [o for o in visible if o.strength >= 5.0]
    clear = [o for o in visible if o.strength >= 6.0]
    unseen = [o for o in one if o.absorbed >= _SEEN]
    foreign = [o for o in outcomes if o.kind == FOREIGN and o.strength >= 10.0]
    right = [o for o in clear if o.verdict == "named" and o.named == o.hidden[0]]

    def named_right(o: Outcome) -> bool:
        return o.named == o.hidden[0]

    def first_three(o: Outcome) -> bool:
        return o.hidden[0] in o.ranking[:3]

    share = _share
    return [
        Row("false alarms on clean cases", "<= 7 %", "<= 5 %", *share(clean, _alarm)),
        Row("detected, D >= 5", ">= 90 %", ">= 97 %", *share(strong, _alarm)),
        Row(
            "first name and place right, D >= 6",
            ">= 80 to 90 %",
            ">= 90 to 97 %",
            *share(clear, named_right),
        ),
        Row(
            "right, or named together with what these sensors cannot tell from it, D >= 6",
            "",
            "",
            *share(clear, lambda o: named_right(o) or _named_together(o)),
        ),
        Row(
            "verdict 'named' and the name right, D >= 6",
            "",
            "",
            *share(clear, lambda o: o.verdict == "named" and named_right(o)),
        ),
        Row(
            "right among all names given",
            "",
            "",
            *share([o for o in outcomes if o.verdict == "named"], lambda o: o.named in o.hidden),
        ),
        Row("among the first three, D >= 5", ">= 95 %", ">= 98 %", *share(strong, first_three)),
        Row(
            "what theta absorbs is not named",
            ">= 90 %",
            "100 %",
            *share(unseen, lambda o: o.verdict != "named" or named_right(o)),
        ),
        Row(
            "outside the catalogue, D >= 10: unknown or ambiguous",
            ">= 70 %",
            ">= 90 %",
            *share(foreign, lambda o: o.verdict in ("unknown", "ambiguous", "indistinguishable")),
        ),
        Row(
            "two effects: the first name is one of them",
            "",
            "",
            *share([o for o in outcomes if o.kind == TWO], lambda o: o.named in o.hidden),
        ),
        Row(
            "excess chi2 removed (median)",
            ">= 85 %",
            ">= 95 %",
            *_median(right, [o.excess_removed for o in right], "%"),
        ),
        Row(
            "excess held-out error removed (median)",
            ">= 50 %",
            ">= 80 %",
            *_median(right, [_held(o) for o in right], "%"),
        ),
        Row(
            "theta bias after, posterior sd (median)",
            "<= 2",
            "<= 1",
            *_median(right, [o.bias_after for o in right], ""),
        ),
        Row(
            "theta bias before, relative (median)",
            "",
            "",
            *_median(right, [o.bias_share_before for o in right], "%"),
        ),
        Row(
            "theta bias after, relative (median)",
            "",
            "",
            *_median(right, [o.bias_share_after for o in right], "%"),
        ),
        Row(
            "size within 2 sd",
            "",
            "95 %",
            *share(
                [o for o in right if np.isfinite(o.size_true)],  # an exchange has none
                lambda o: abs(o.size - o.size_true) <= 2.0 * o.size_sd,
            ),
        ),
        Row(
            "error of the size, relative (median)",
            "",
            "",
            *_median(right, [_size_error(o) for o in right], "%"),
        ),
        Row(
            "seconds a case (median)",
            "<= 60",
            "<= 10",
            *_median(outcomes, [o.seconds for o in outcomes], ""),
        ),
    ]


def _named_together(outcome: Outcome) -> bool:
    """Whether the effect is among those that the finder says it cannot tell apart."""
    unsure = outcome.verdict in ("indistinguishable", "ambiguous")
    return unsure and outcome.hidden[0] in (outcome.named, *outcome.twins)


def _size_error(outcome: Outcome) -> float:
    if not np.isfinite(outcome.size_true) or outcome.size_true == 0.0:
        return float("nan")
    return abs(outcome.size - outcome.size_true) / abs(outcome.size_true)


def _alarm(outcome: Outcome) -> bool:
    return outcome.verdict != "none"


def _held(outcome: Outcome) -> float:
    """Share of the error beyond what remains when all is right that was removed."""
    excess = outcome.held_before - outcome.held_floor
    return (outcome.held_before - outcome.held_after) / max(excess, 1e-9)


def _share(cases: Sequence[Outcome], good: Callable[[Outcome], bool]) -> tuple[str, int]:
    if not cases:
        return "-", 0
    hits = sum(map(good, cases))
    p = hits / len(cases)
    error = np.sqrt(max(p * (1.0 - p), 0.25 / len(cases)) / len(cases))
    return f"{p:.1%} +- {error:.1%}", len(cases)


def _median(cases: Sequence[Outcome], values: list[float], unit: str) -> tuple[str, int]:
    finite = [v for v in values if np.isfinite(v)]
    if not finite:
        return "-", 0
    middle = float(np.median(finite))
    return (f"{middle:.1%}" if unit == "%" else f"{middle:.2f}"), len(finite)


def summary_text(
    building: str, settings: TrialSettings, outcomes: Sequence[Outcome], rows: Sequence[Row]
) -> str:
    table = markdown_table(
        ("", "first", "goal", "found", "cases"),
        [(r.what, r.first, r.goal, r.found, str(r.of)) for r in rows],
    )
    compared = "amplitude and phase" if settings.use_phase else "amplitude alone"
    return (
        f"Building {building}, {settings.duration_s:g} s at {settings.sampling_hz:g} Hz, sensor "
        f"noise {settings.sensor_noise_m_s2:g} m/s2, {compared}.\n\n{table}\n\n"
        f"By strength of the hidden effect (D as the finder measures it):\n\n"
        f"{_by_strength(outcomes)}\n\n"
        f"What was hidden (rows, D >= 6) and what was named:\n\n{_confusion(outcomes)}\n"
    )


def _by_strength(outcomes: Sequence[Outcome]) -> str:
    """Detection and naming of single effects against their strength."""
    rows = []
    seen = [o for o in outcomes if o.kind == ONE and o.absorbed < _SEEN]
    for low, high in pairwise((0.0, *_STRENGTHS, np.inf)):
        own = [o for o in seen if low <= o.strength < high]
        if own:
            shares = (
                sum(map(_alarm, own)),
                sum(o.named == o.hidden[0] for o in own),
                sum(o.hidden[0] in o.ranking[:3] for o in own),
            )
            band = f"{low:g} to {high:g}" if np.isfinite(high) else f"from {low:g}"
            rows.append((band, str(len(own)), *map(str, shares)))
    return markdown_table(
        ("D", "cases", "detected", "first name right", "in the first three"), rows
    )


def _confusion(outcomes: Sequence[Outcome]) -> str:
    """Named right, right effect at another place, other effect, not named, by hidden effect."""
    head = ("hidden", "right", "other place", "other effect", "not named", "which")
    rows = []
    clear = [o for o in outcomes if o.kind == ONE and o.strength >= 6.0]
    for effect in sorted({_effect(o.hidden[0]) for o in clear}):
        own = [o for o in clear if _effect(o.hidden[0]) == effect]
        right = sum(o.named == o.hidden[0] for o in own)
        place = sum(o.named != o.hidden[0] and _effect(o.named) == effect for o in own)
        missed = sum(not o.named for o in own)
        wrong = Counter(_effect(o.named) for o in own if o.named and _effect(o.named) != effect)
        listed = ", ".join(f"{name} {count}" for name, count in wrong.most_common(3))
        counts = (right, place, sum(wrong.values()), missed)
        rows.append((effect, *map(str, counts), listed))
    return markdown_table(head, rows)


def _effect(label: str) -> str:
    return label.split("@")[0]
