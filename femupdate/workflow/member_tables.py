"""Largest forces of members, in units of their size, for people and for spreadsheets."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from femupdate.dynamics.member_histories import MemberForces
from femupdate.report.scale import Scale, force_scale, interval_text
from femupdate.tables import table

ALONE = (
    "Forces of members have the spread of the parameters alone, without that between events "
    "and the error of the model."
)


def force_scales(members: Sequence[MemberForces]) -> tuple[Scale, Scale]:
    """One unit for the forces of all members, and one for their moments."""
    largest = [0.0, 0.0]
    for one in members:
        for name, value in zip(one.member.forces, one.peak.mean.tolist(), strict=True):
            largest[is_moment(name)] = max(largest[is_moment(name)], value)
    return force_scale(largest[0]), force_scale(largest[1])


def is_moment(force: str) -> bool:
    """Whether a force of a member, such as "My_start", is a moment."""
    return force[0] in "TM"


def member_lines(members: Sequence[MemberForces]) -> Iterator[str]:
    """A table of every member; members are numbered."""
    scales = force_scales(members)
    for number, one in enumerate(members, 1):
        yield f"{place_of(number, one)}: largest forces"
        rows = [
            (f"{quantity}, {unit}", interval_text(*values))
            for quantity, unit, *values in _peaks(one, scales)
        ]
        yield table(("", ""), rows).partition("\n")[2]


def member_rows(members: Sequence[MemberForces]) -> Iterator[tuple[Any, ...]]:
    """Rows of a tidy table, as `TIDY` says."""
    scales = force_scales(members)
    for number, one in enumerate(members, 1):
        for quantity, unit, *values in _peaks(one, scales):
            yield (f"largest {quantity}", unit, place_of(number, one), *values)


def place_of(number: int, one: MemberForces) -> str:
    """Number and place of a member, such as "wall 1, X2:S1"."""
    return f"{one.member.kind} {number}, {one.member.name}"


def _peaks(one: MemberForces, scales: tuple[Scale, Scale]) -> Iterator[tuple[Any, ...]]:
    """Name, unit, mean, sd and 5 and 95 % of every force."""
    own = one.peak
    columns = np.stack([own.mean, own.sd, own.q05, own.q95], axis=1)
    for name, values in zip(one.member.forces, columns, strict=True):
        scale = scales[is_moment(name)]
        unit = f"{scale.unit} m" if is_moment(name) else scale.unit
        yield (name.replace("_", " "), unit, *(values / scale.factor).tolist())
