"""What a prediction gives an engineer: peaks, drifts, base shear, stiffness, forces of members."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from femupdate.arrays import Floats
from femupdate.building.document import Building
from femupdate.dynamics.members import MemberForces
from femupdate.dynamics.summary import Statistics, statistics
from femupdate.report.scale import Scale, force_scale, interval_text
from femupdate.result import Note
from femupdate.tables import Column, Table
from femupdate.units import STANDARD_GRAVITY, capital


@dataclass(frozen=True, eq=False)
class DrawnQuantity:
    """One quantity, such as "peak drift ratio", at n floors or stories: (S, n), a row a draw."""

    name: str
    unit: str
    places: tuple[str, ...]
    values: Floats

    @cached_property
    def statistics(self) -> Statistics:
        """(n,) over the draws."""
        return statistics(self.values)

    def tidy(self) -> Iterator[tuple[Any, ...]]:
        """Rows of a tidy table, see `tidy_table`."""
        statistics = self.statistics
        columns = (statistics.mean, statistics.sd, statistics.q05, statistics.q95)
        for place, *row in zip(self.places, *(column.tolist() for column in columns), strict=True):
            yield (self.name, self.unit, place, *row)

    @property
    def heading(self) -> str:
        """Name and unit."""
        return f"{self.name}, {self.unit}"

    def cells(self) -> tuple[str, ...]:
        """Mean and 5 to 95 % at every place."""
        statistics = self.statistics
        rows = zip(statistics.mean, statistics.sd, statistics.q05, statistics.q95, strict=True)
        return tuple(interval_text(*(float(value) for value in row)) for row in rows)


def quantity_tables(found: Iterable[DrawnQuantity]) -> list[Table]:
    """Tables of quantities at the same places: of the floors, of the stories, of the base."""
    groups: dict[tuple[str, ...], list[DrawnQuantity]] = {}
    for quantity in found:
        groups.setdefault(quantity.places, []).append(quantity)
    return [
        Table.of(
            ("", *(quantity.heading for quantity in group)),
            list(zip(places, *(quantity.cells() for quantity in group), strict=True)),
            name="_".join(group[0].name.split()),
            caption=capital(", ".join(quantity.name for quantity in group)),
            note="Mean, and 5 to 95 % in brackets.",
        )
        for places, group in groups.items()
    ]


def tidy_table(
    name: str, found: Iterable[DrawnQuantity], members: Sequence[MemberForces] = (), key: str = ""
) -> Table:
    """Quantities and forces of members, one figure at one place a row.

    Args:
        key: of the quantities in JSON, which are then not in the CSV file.
    """
    rows = [row for quantity in found for row in quantity.tidy()]
    rows += [
        (f"largest {quantity}", unit, place_of(number, member), *values)
        for number, member in enumerate(members, 1)
        for quantity, unit, *values in _peaks(member, force_scales(members))
    ]
    names = ("quantity", "unit", "place", "mean", "sd", "q05", "q95")
    kept = zip(names, list(zip(*rows, strict=True)) or [()] * len(names), strict=True)
    columns = [
        Column(values, key=heading) if key else Column(values, csv=heading)
        for heading, values in kept
    ]
    return Table(name=name, columns=tuple(columns), key=key)


def floor_table(
    name: str,
    floors: Sequence[str],
    axis: str,
    points: ArrayLike,
    columns: Mapping[str, Callable[[], Any]],
) -> Table:
    """A CSV table with a row for every floor and point of an axis.

    Args:
        columns: what makes (f, n) values, by their heading.
    """
    count = np.size(points)
    made: dict[str, Callable[[], Any]] = {
        "floor": lambda: np.repeat(np.array(floors), count),
        axis: lambda: np.tile(points, len(floors)),
        **columns,
    }
    return Table(name=name, columns=tuple(Column(values, csv=key) for key, values in made.items()))


def heights_of(building: Building) -> Floats | None:
    """(s,) heights of the stories, m; None where the file does not give them all."""
    heights = [getattr(story, "height", None) for story in building.stories]
    return None if None in heights else np.array(heights, dtype=float)


PEAKS = ("peak_acceleration", "peak_shear", "peak_drift", "story_stiffness")
"""What a prediction keeps of every draw: (S, f) m/s2, (S, s) N, (S, s) m and (S, s) N/m."""


def quantities(
    building: Building, floors: Sequence[str], peaks: Sequence[Floats], mass: float
) -> Mapping[str, DrawnQuantity]:
    """Return everything worth a table, by key.

    Args:
        peaks: see `PEAKS`.
        mass: above the middle of the first story, kg, for the base shear over the weight.
    """
    stories = tuple(building.story_names)
    acceleration, shear, drift, stiffness = peaks
    base = shear[:, :1]
    found = {
        "acceleration": DrawnQuantity("peak acceleration", "m/s²", tuple(floors), acceleration),
        "drift": DrawnQuantity("peak drift", "mm", stories, 1e3 * drift),
    }
    heights = heights_of(building)
    if heights is not None:
        ratio = 100.0 * drift / heights
        found["ratio"] = DrawnQuantity("drift ratio", "%", stories, ratio)
    # Figures of a bench-top model, which weighs some kilograms, would vanish in kN.
    force = "N" if shear.max() < 100.0 else "kN"
    newton = 1.0 if force == "N" else 1e-3
    found["shear"] = DrawnQuantity("peak shear", force, stories, newton * shear)
    found["base"] = DrawnQuantity("peak base shear", force, ("base",), newton * base)
    weight = mass * STANDARD_GRAVITY
    found["coefficient"] = DrawnQuantity(
        "peak base shear over weight", "%", ("base",), 100.0 * base / weight
    )
    found["stiffness"] = DrawnQuantity(
        "stiffness", f"{force}/mm", stories, 1e-3 * newton * stiffness
    )
    return found


ALONE = (
    "Forces of members have the spread of the parameters alone, without that between events "
    "and the error of the model."
)


def force_scales(members: Sequence[MemberForces]) -> tuple[Scale, Scale]:
    """One unit for the forces of all members, and one for their moments."""
    largest = [0.0, 0.0]
    for member in members:
        for name, value in zip(member.member.forces, member.peak.mean.tolist(), strict=True):
            largest[_is_moment(name)] = max(largest[_is_moment(name)], value)
    return force_scale(largest[0]), force_scale(largest[1])


def in_unit(force: str, scales: tuple[Scale, Scale]) -> tuple[str, str, float]:
    """Name, unit and what to divide by of a force of a member, such as "My_start"."""
    scale = scales[_is_moment(force)]
    unit = f"{scale.unit} m" if _is_moment(force) else scale.unit
    return force.replace("_", " "), unit, scale.factor


def _is_moment(force: str) -> bool:
    return force[0] in "TM"


def member_tables(members: Sequence[MemberForces]) -> Iterator[Note | Table]:
    """The largest forces of every member; members are numbered."""
    scales = force_scales(members)
    for number, member in enumerate(members, 1):
        yield Note(f"{place_of(number, member)}: largest forces")
        yield Table.of(
            ("force", "largest"),
            [
                (f"{quantity}, {unit}", interval_text(*values))
                for quantity, unit, *values in _peaks(member, scales)
            ],
        )


def place_of(number: int, member: MemberForces) -> str:
    """Number and place of a member, such as "wall 1, X2:S1"."""
    return f"{member.member.kind} {number}, {member.member.name}"


def _peaks(member: MemberForces, scales: tuple[Scale, Scale]) -> Iterator[tuple[Any, ...]]:
    """Name, unit, mean, sd and 5 and 95 % of every force."""
    peak = member.peak
    columns = np.stack([peak.mean, peak.sd, peak.q05, peak.q95], axis=1)
    columns[peak.mean < 1e-6 * peak.mean.max()] = 0.0  # no figures of nought
    for name, values in zip(member.member.forces, columns, strict=True):
        words, unit, factor = in_unit(name, scales)
        yield (words, unit, *(values / factor).tolist())
