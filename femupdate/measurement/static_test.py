"""Static load tests: deflections of floors under known horizontal loads.

A deflection per load is a column of the flexibility matrix, which is the receptance at zero
frequency. It is given on as an accelerance at a frequency so low that inertia is nothing, and so
needs no likelihood of its own.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats
from femupdate.measurement.columns import BASE, parse_channel
from femupdate.measurement.force_frf import ForcedObservation
from femupdate.measurement.observation import Observation, require_floors_of_building
from femupdate.measurement.quantity import newtons, si_factor
from femupdate.measurement.table import Table
from femupdate.measurement.thresholds import STATIC
from femupdate.units import percent

_LOAD = re.compile(r"load/(?P<floor>RF|(?:[2-9]|[1-9]\d+)F)", re.IGNORECASE)
_COLUMNS = "load/RF (kN) and 2F (mm) ... RF (mm), one row for each load case"


@dataclass(frozen=True, eq=False)
class StaticTest:
    """Deflections per load.

    Attributes:
        loads: (j,) floors at which loads act.
        floors: (f,) that deflect.
        flexibility: (f, j) m/N.
        log_sd: (f, j) standard deviations of its logarithm.
        assumed: whether these are assumed.
        source: name of the file.
    """

    loads: tuple[str, ...]
    floors: tuple[str, ...]
    flexibility: Floats
    log_sd: Floats
    assumed: bool
    source: str


def static_test(table: Table) -> StaticTest:
    """The deflections per load in a table of load cases, by least squares with a common offset.

    Raises:
        MeasurementError: a unit is missing or wrong, the loads cannot be told apart, or a floor
            deflects against a load.
    """
    loads, floors = _columns(table)
    force = np.column_stack(
        [
            newtons(table.file, table.values[:, i], table.units[i], table.title(i), "load")
            for i in loads.values()
        ]
    )
    moved = np.column_stack([_deflections(table, i) for i in floors.values()])
    cases = len(force)
    # Gauges are read against the unloaded state, where a case of it or enough others show it.
    offset = cases > force.shape[1] + 1 or not force.all(axis=1).all()
    design = np.column_stack([force, np.ones(cases)]) if offset and cases > 1 else force
    scale = np.abs(design).max(axis=0)
    if (scale == 0.0).any() or np.linalg.matrix_rank(design / scale) < design.shape[1]:
        raise table.file.error(
            f"the loads at {', '.join(loads)} cannot be told apart; give at least"
            f" {design.shape[1]} cases in which they act differently"
        )
    found, *_ = np.linalg.lstsq(design / scale, moved, rcond=None)
    found = found / scale[:, None]
    flexibility = found[: len(loads)].T
    freedom = cases - design.shape[1]
    spread = np.zeros_like(flexibility)
    if freedom > 1:
        left = np.sqrt(((moved - design @ found) ** 2).sum(axis=0) / freedom)
        inverse = np.linalg.inv((design / scale).T @ (design / scale))
        spread = left[:, None] * np.sqrt(np.diag(inverse))[: len(loads)] / scale[: len(loads)]
    _require_forward(table, tuple(loads), tuple(floors), flexibility, spread)
    least = STATIC.least_sd if freedom > 1 else STATIC.assumed_sd
    log_sd = np.hypot(spread / flexibility, least)
    return StaticTest(
        tuple(loads), tuple(floors), flexibility, log_sd, freedom <= 1, table.file.path.name
    )


def static_observations(
    test: StaticTest, building_floors: Sequence[str]
) -> tuple[ForcedObservation, ...]:
    """Deflections under each load as responses to a force on a building's floors.

    Raises:
        MeasurementError: the building has no such floor.
    """
    require_floors_of_building(test.source, (*test.floors, *test.loads), building_floors)
    order = [test.floors.index(name) for name in building_floors if name in test.floors]
    assumed = percent(STATIC.assumed_sd)
    note = f"Standard deviation of deflections taken as {assumed}: too few load cases."
    level = 2.0 * np.log(2.0 * np.pi * STATIC.low_hz)
    return tuple(
        ForcedObservation(
            load,
            "static deflection",
            Observation(
                frequency_hz=np.array([STATIC.low_hz]),
                floors=tuple(test.floors[k] for k in order),
                log_frf=level + np.log(test.flexibility[order, j : j + 1]),
                noise_sd=test.log_sd[order, j : j + 1],
                valid=np.ones((len(order), 1), dtype=bool),
                source=test.source,
                notes=(note,) if test.assumed else (),
            ),
        )
        for j, load in enumerate(test.loads)
    )


def _columns(table: Table) -> tuple[dict[str, int], dict[str, int]]:
    """Position of every load and of every deflection, by its floor."""
    loads: dict[str, int] = {}
    floors: dict[str, int] = {}
    for i, name in enumerate(table.names or ()):
        load, channel = _LOAD.fullmatch(name), parse_channel(name)
        if load is not None:
            loads[load["floor"].upper()] = i
        elif channel is not None and channel.floor != BASE and not channel.sensor:
            floors[channel.floor] = i
        elif name.lower() not in ("case", "load_case"):
            raise table.file.error(
                f"unknown column {name!r}; columns of load cases are {_COLUMNS}: rename or remove"
                " it"
            )
    if not floors:
        raise table.file.error(f"there is no floor that deflects; columns are {_COLUMNS}")
    return loads, floors


def _deflections(table: Table, position: int) -> Floats:
    unit = table.units[position]
    if unit is None:
        raise table.file.error(
            "the deflection has no unit; write it behind the name, such as RF (mm)",
            column=table.title(position),
        )
    found = np.asarray(table.values[:, position] * si_factor(table.file, unit, "length"))
    if found.size and np.abs(found).max() > STATIC.farthest_m:
        raise table.file.error(
            f"a floor deflects by {np.abs(found).max():.3g} m, which no building stands; correct"
            " the value or the unit",
            column=table.title(position),
        )
    return found


def _require_forward(
    table: Table,
    loads: tuple[str, ...],
    floors: tuple[str, ...],
    flexibility: Floats,
    spread: Floats,
) -> None:
    for row, floor in enumerate(floors):
        for column, load in enumerate(loads):
            value = flexibility[row, column]
            if not (value > 0.0 and spread[row, column] < STATIC.doubtful * value):
                raise table.file.error(
                    f"{floor} deflects by {1e6 * value:.3g} +- {1e6 * spread[row, column]:.2g} mm"
                    f" per kN at {load}; correct a sign or leave the column out"
                )
