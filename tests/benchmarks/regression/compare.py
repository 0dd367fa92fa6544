"""Two records of figures side by side, and which differences break a tolerance."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from ..usage import MOST_MB

MEAN_SHIFT = 0.1  # sd
SD_SHARE = 0.05
QUANTILE_SHIFT = 0.2  # sd; two thousand draws leave .07
DIGITS = 1e-9
SLOWER, SLOWER_S = 2.0, 5.0  # another machine, or a busy one
NORMAL_90 = 3.29  # standard deviations in the 90 % interval of a normal distribution


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    figure: str
    before: str
    after: str
    difference: str
    broken: bool


Compared = tuple[str, bool]  # the difference in words, and whether it breaks a tolerance


def compare_same(before: Any, after: Any) -> Compared:
    """Equal or not."""
    return ("", False) if before == after else ("differs", True)


def compare_digits(before: float, after: float) -> Compared:
    """Relative difference."""
    relative = abs(after / before - 1.0)
    return f"{relative:.1e}", relative > DIGITS


def compare_posterior(before: list[float], after: list[float]) -> Compared:
    """Shift of the mean in standard deviations, and ratio of these."""
    shift, ratio = (after[0] - before[0]) / before[1], after[1] / before[1]
    broken = abs(shift) > MEAN_SHIFT or abs(ratio - 1.0) > SD_SHARE
    return f"{shift:+.3f} sd, sd x {ratio:.3f}", broken


def compare_evidence(before: list[float], after: list[float]) -> Compared:
    """Difference of [log evidence, error] against the error of both."""
    difference, error = after[0] - before[0], math.hypot(before[1] or 0.0, after[1] or 0.0)
    return f"{difference:+.3f}, error {error:.3f}", abs(difference) > max(error, 1e-6)


def compare_interval(before: list[float], after: list[float]) -> Compared:
    """Shifts of [mean, 5 %, 95 %] in standard deviations."""
    sd = max((before[2] - before[1]) / NORMAL_90, 1e-12)
    shifts = [(new - old) / sd for old, new in zip(before, after, strict=True)]
    limits = (MEAN_SHIFT, QUANTILE_SHIFT, QUANTILE_SHIFT)
    broken = any(abs(s) > limit for s, limit in zip(shifts, limits, strict=True))
    return ", ".join(f"{s:+.3f}" for s in shifts) + " sd", broken


def compare_shown(before: Any, after: Any) -> Compared:
    """For reading only."""
    if not all(isinstance(value, int | float) for value in (before, after)) or not before:
        return ("", False) if before == after else ("differs", False)
    return f"x {after / before:.3f}", False


def compare_speed(before: float, after: float) -> Compared:
    """Ratio of processor seconds."""
    return f"x {after / max(before, 0.01):.2f}", after > SLOWER * before + SLOWER_S


def compare_memory(before: float, after: float) -> Compared:
    """Ratio of the largest memory, MB."""
    return f"x {after / max(before, 1.0):.2f}", after > MOST_MB


RULES: dict[str, Callable[[Any, Any], Compared]] = {
    "same": compare_same,
    "digits": compare_digits,
    "posterior": compare_posterior,
    "evidence": compare_evidence,
    "interval": compare_interval,
    "shown": compare_shown,
}


def compare_records(before: dict[str, Any], after: dict[str, Any]) -> Iterator[Row]:
    """Lines of the runs that either record holds."""
    for name in dict.fromkeys([*before, *after]):
        if name not in before or name not in after:
            missing = "before" if name not in before else "after"
            yield Row(name, "", "", f"not run {missing}", False)
            continue
        yield from _compare_runs(name, before[name], after[name])


def _compare_runs(name: str, before: dict[str, Any], after: dict[str, Any]) -> Iterator[Row]:
    """What ended well must do so again, with the same figures, and as fast."""
    old, new = before["status"], after["status"]
    if old != new:
        yield Row(name, old, new, "differs", new != "finished")
    elif new != "finished":
        yield Row(name, old, new, "", False)
    for kind, rule in RULES.items():
        figures = before.get("figures", {}).get(kind, {})
        others = after.get("figures", {}).get(kind, {})
        if old == new:
            yield from _compare_figures(name, figures, others, rule, kind != "shown")
    seconds = before["processor_seconds"], after["processor_seconds"]
    difference, slower = compare_speed(*seconds)
    slower = slower and new == "finished"
    yield Row(f"{name}: processor s", f"{seconds[0]:.1f}", f"{seconds[1]:.1f}", difference, slower)
    memory = before["peak_mb"], after["peak_mb"]
    difference, large = compare_memory(*memory)
    yield Row(f"{name}: peak MB", f"{memory[0]:.0f}", f"{memory[1]:.0f}", difference, large)


def _compare_figures(
    name: str,
    before: dict[str, Any],
    after: dict[str, Any],
    rule: Callable[[Any, Any], Compared],
    needed: bool,
) -> Iterator[Row]:
    """Figures of one kind; one that is gone breaks a tolerance where it is `needed`."""
    for figure in dict.fromkeys([*before, *after]):
        label = f"{name}: {figure}"
        if figure not in before or figure not in after:
            difference, broken = "only one has it", needed
        else:
            difference, broken = rule(before[figure], after[figure])
        old, new = _text(before.get(figure)), _text(after.get(figure))
        yield Row(label, old, new, difference, broken)


def _text(value: Any) -> str:
    if isinstance(value, list):
        return " ".join(_text(one) for one in value)
    if isinstance(value, float):
        return f"{value:.6g}"
    return "-" if value is None else str(value)
