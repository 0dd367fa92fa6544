"""compare, of two sets of modes: which belong together, and how alike their shapes are."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

from femupdate.arrays import Floats
from femupdate.errors import MeasurementError
from femupdate.measurement.modes import IdentifiedModes, identified_modes, mac
from femupdate.measurement.reader import read_measured
from femupdate.result import Item, Note, Notes, Result
from femupdate.tables import Column, Table
from femupdate.units import percent


@dataclass(frozen=True, kw_only=True)
class ModeComparison(Result):
    """Modes of two tests or models at the floors that both have."""

    before: IdentifiedModes
    after: IdentifiedModes

    @cached_property
    def mac(self) -> Floats:
        """(m, n) modal assurance criterion of every two shapes (Allemang 2003, equation 4)."""
        return np.array(
            [[mac(first, second) for second in self.after.shape] for first in self.before.shape]
        )

    @cached_property
    def pairs(self) -> list[tuple[int, int]]:
        """Modes that belong together: one to one, so that their MAC adds up to most."""
        rows, columns = linear_sum_assignment(-self.mac)
        found = zip(rows.tolist(), columns.tolist(), strict=True)
        # Above a MAC of .5 two shapes are more alike than not.
        return [(k, m) for k, m in found if self.mac[k, m] >= 0.5]

    @cached_property
    def comac(self) -> Floats:
        """(f,) how alike the pairs are at every floor, shapes of unit length (Allemang 2003).

        sum |a b|^2 / (sum a^2 sum b^2), the sums over the pairs (Lieven and Ewins 1988).
        """
        first, second = (
            np.array([modes.shape[pair[side]] for pair in self.pairs])
            for side, modes in enumerate((self.before, self.after))
        )
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        second /= np.linalg.norm(second, axis=1, keepdims=True)
        both = np.abs(first * second).sum(axis=0) ** 2
        return np.asarray(both / ((first**2).sum(axis=0) * (second**2).sum(axis=0)))

    def items(self) -> Iterator[Item]:
        """The pairs, the MAC of all, the COMAC of every floor, and modes without a partner."""
        before, after, pairs = self.before, self.after, self.pairs
        first, second = [k for k, _ in pairs], [m for _, m in pairs]
        hertz = before.frequency_hz[first], after.frequency_hz[second]
        change = hertz[1] / hertz[0] - 1.0
        value = [float(self.mac[pair]) for pair in pairs]
        yield Note(
            f"{len(pairs)} modes of {before.source} and {after.source} belong together, by their "
            f"shapes at {', '.join(before.floors)}.",
            {"before": before.source, "after": after.source, "floors": before.floors},
        )
        yield Table(
            name="pairs",
            key="pairs",
            columns=(
                Column([before.names[k] for k in first], "mode", csv="mode", key="mode"),
                Column([after.names[m] for m in second], "is mode", csv="is_mode", key="is_mode"),
                *(
                    Column(values, f"Hz {when}", [f"{v:.4g}" for v in values], f"hz_{when}", when)
                    for when, values in zip(("before", "after"), hertz, strict=True)
                ),
                Column(change, "change", [percent(v, 2) for v in change], "change", "change"),
                Column(value, "MAC", [f"{v:.3f}" for v in value], "mac", "mac"),
            ),
        )
        rows = [
            (name, *(f"{v:.3f}" for v in row))
            for name, row in zip(before.names, self.mac, strict=True)
        ]
        yield Table.of(("MAC", *after.names), rows, name="mac", caption="MAC of all modes")
        yield Note(content={"mac": self.mac})
        if pairs:
            cells = [f"{v:.3f}" for v in self.comac]
            columns = (
                Column(before.floors, "floor", csv="floor", key="floor"),
                Column(self.comac, "COMAC", cells, "comac", "comac"),
            )
            yield Table(name="comac", key="comac", columns=columns)
        alone = [
            f"mode {before.names[k]} of {before.source}"
            for k in range(len(before.names))
            if k not in first
        ]
        alone += [
            f"mode {after.names[m]} of {after.source}"
            for m in range(len(after.names))
            if m not in second
        ]
        yield Notes(tuple(f"{name} has no partner." for name in alone), key="alone")


def compare_modes(before: Path, after: Path) -> ModeComparison:
    """Compare two files of modes.

    Raises:
        MeasurementError: one holds none, a shape is not whole, or they share no two floors.
    """
    found = [identified_modes(read_measured(path)) for path in (before, after)]
    floors = [floor for floor in found[0].floors if floor in found[1].floors]
    if len(floors) < 2:
        raise MeasurementError(
            f"{before} and {after} have {len(floors)} floors in common; shapes need two to compare"
        )
    earlier, later = (
        each.some(np.flatnonzero(np.isfinite(each.of_floors(floors).shape).all(axis=1)).tolist())
        for each in found
    )
    if not earlier.names or not later.names:
        raise MeasurementError(
            f"no mode of {before if not earlier.names else after} has a value at all of "
            f"{', '.join(floors)}; complete one"
        )
    return ModeComparison(before=earlier.of_floors(floors), after=later.of_floors(floors))
