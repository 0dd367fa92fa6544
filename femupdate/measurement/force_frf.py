"""Frequency response functions under a force: of a hammer or a shaker at a floor."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from femupdate.arrays import Floats
from femupdate.errors import MeasurementError
from femupdate.measurement.columns import FrfColumn, floor_height
from femupdate.measurement.frf import estimate_frf
from femupdate.measurement.frf_table import FrfTable, curves_of
from femupdate.measurement.observation import Observation, require_floors_of_building, select_floors
from femupdate.measurement.observation_file import ForceHistories
from femupdate.measurement.quantity import ForceUnit, force_unit
from femupdate.measurement.resolve import Layout
from femupdate.measurement.table import Table
from femupdate.measurement.thresholds import RESPONSE

_POSSIBLE = (RESPONSE.least_accelerance, RESPONSE.largest_accelerance)
_UNITS = "m/s2/N (accelerance), m/s/N (mobility) or m/N (receptance)"


@dataclass(frozen=True, eq=False)
class ForceTable:
    """Responses to a force at one floor.

    Attributes:
        force: floor at which it acts, in the measured direction.
        quantity: what the file holds: receptance, mobility or accelerance.
        accelerance: magnitude in m/s2 per N whatever the file holds; without phase.
    """

    force: str
    quantity: str
    accelerance: FrfTable


@dataclass(frozen=True, eq=False)
class ForceTest:
    """Responses to forces at one floor after the other, of one file."""

    tables: tuple[ForceTable, ...]
    source: str


@dataclass(frozen=True, eq=False)
class ForcedObservation:
    """Responses to a force at one floor of a building.

    Attributes:
        force: floor at which it acts.
        quantity: what the file holds.
        observation: ln of the accelerance, 1/kg, of the floors that respond, at the frequencies of
            the file.
        halves: of what was estimated from histories, where they can be parted.
    """

    force: str
    quantity: str
    observation: Observation
    halves: tuple[Observation, ...] = ()

    def of_floors(self, floors: Sequence[str]) -> "ForcedObservation":
        """The same of some of the floors."""
        halves = tuple(select_floors(one, floors) for one in self.halves)
        return replace(self, observation=select_floors(self.observation, floors), halves=halves)


def force_test(layout: Layout, force: str | None, unit: str | None) -> ForceTest:
    """The responses to forces in a table.

    Args:
        force: floor at which the force acts, where a column's name does not say it.
        unit: of the responses, where a column does not say it.

    Raises:
        MeasurementError: the unit of a column is not known or two columns differ in their
            quantity, or see `frf_table`.
    """
    found = _by_force(layout, force)
    tests = (_under_force(found[floor], floor, unit) for floor in sorted(found, key=floor_height))
    return ForceTest(tuple(tests), layout.table.file.path.name)


def _by_force(layout: Layout, force: str | None) -> dict[str, Layout]:
    """The responses to the force at each floor, each response once."""
    table, found = layout.table, dict[str, dict[FrfColumn, int]]()
    for column, i in layout.frfs.items():
        at = column.force or force
        if at is None:
            raise table.file.error(
                "the floor at which the force acts is not said; name it by the force option, or by"
                " the column's name, such as 2F/RF for 2F under a force at RF",
                column=table.title(i),
            )
        if force is not None and at != force:
            raise table.file.error(
                f"the column says another floor than the force option, {force}; leave the option"
                " out",
                column=table.title(i),
            )
        own, plain = found.setdefault(at, {}), replace(column, force=at)
        if plain in own:
            raise table.file.error(
                f"{table.title(i)} and {table.title(own[plain])} are the same response; remove one"
            )
        own[plain] = i
    return {
        at: replace(layout, known={i: column for column, i in own.items()})
        for at, own in found.items()
    }


def _under_force(layout: Layout, force: str, unit: str | None) -> ForceTable:
    table, omega = layout.table, 2.0 * np.pi * layout.frequency_hz
    held = {i: _unit(table, i, unit) for column, i in layout.frfs.items() if column.part != "sd"}
    quantities = {one.quantity for one in held.values()}
    if len(quantities) > 1:
        raise table.file.error(
            f"responses to the force at {force} are in several quantities,"
            f" {' and '.join(sorted(quantities))}; give them in files of their own"
        )

    def accelerance(own: Table, position: int) -> Floats:
        of_column = held[position]
        # A sign or a phase of i omega does not matter to the magnitude.
        return own.values[:, position] * of_column.factor * omega ** (2 - of_column.power)

    curves = curves_of(layout, accelerance, _POSSIBLE)
    return ForceTable(force, next(iter(quantities)), replace(curves, complex_frf=None))


def _unit(table: Table, position: int, asked: str | None) -> ForceUnit:
    """The unit of a column, stated in the file or by the option."""
    stated = table.units[position] or asked
    found = None if stated is None else force_unit(stated)
    if found is None:
        said = "has no unit" if stated is None else f"cannot be in {stated!r}"
        raise table.file.error(
            f"a response to a force {said}; give it by the unit option or in the column's name,"
            f" as {_UNITS}",
            column=table.title(position),
        )
    return found


def forced_estimate(
    measured: ForceHistories, building_floors: Sequence[str], grid: Floats, direction: str
) -> ForcedObservation:
    """Responses to a force, estimated from histories as those to base motion are.

    Args:
        measured: the force, and the floors that respond.
        building_floors: names, bottom to top.
        grid: (m,) the building's frequencies, Hz.
        direction: of the motion.

    Raises:
        MeasurementError: the building has no such floor, or see `estimate_frf`.
    """
    own = measured.histories
    require_floors_of_building(own.source, (*own.floors, measured.force), building_floors)
    seen = estimate_frf(own, grid, direction)
    try:
        halves = tuple(estimate_frf(own, grid, direction, half=number) for number in (0, 1))
    except MeasurementError:
        halves = ()
    seen = replace(seen, notes=(*seen.notes, *measured.notes))
    order = [name for name in building_floors if name in seen.floors]
    return ForcedObservation(measured.force, "accelerance", seen, halves).of_floors(order)


def forced_observations(
    test: ForceTest,
    building_floors: Sequence[str],
    band_hz: tuple[float, float],
    default_noise: float,
) -> tuple[ForcedObservation, ...]:
    """Responses to forces on a building's floors, at the file's own frequencies.

    Args:
        building_floors: names, bottom to top.
        band_hz: lowest and highest frequency at which the building's model is good.
        default_noise: sd of ln|H| where the file gives none.

    Raises:
        MeasurementError: the building has no such floor, or fewer than ten frequencies lie in the
            band.
    """
    return tuple(
        _in_band(test, one, building_floors, band_hz, default_noise) for one in test.tables
    )


def _in_band(
    test: ForceTest,
    one: ForceTable,
    building_floors: Sequence[str],
    band_hz: tuple[float, float],
    default_noise: float,
) -> ForcedObservation:
    table = one.accelerance
    require_floors_of_building(test.source, (*table.floors, one.force), building_floors)
    low, high = band_hz
    slack = 1e-9  # grids are sums of rounded steps
    own = table.frequency_hz
    used = (own >= low * (1.0 - slack)) & (own <= high * (1.0 + slack))
    if np.count_nonzero(used) < RESPONSE.fewest_of_force:
        raise MeasurementError(
            f"{test.source}: fewer than ten frequencies lie between {low:g} and {high:g} Hz, which"
            " the building's frequency grid and --band leave; widen them"
        )
    order = [table.floors.index(name) for name in building_floors if name in table.floors]
    stated = np.full_like(table.magnitude, np.nan) if table.log_sd is None else table.log_sd
    without = [name for name, row in zip(table.floors, stated, strict=True) if np.isnan(row).any()]
    note = f"Noise on ln|H| taken as {default_noise:g} for {', '.join(without)}."
    noise = np.where(np.isnan(stated), default_noise, stated)[order][:, used]
    observation = Observation(
        frequency_hz=own[used],
        floors=tuple(table.floors[k] for k in order),
        log_frf=np.log(table.magnitude)[order][:, used],
        noise_sd=noise,
        valid=np.ones(noise.shape, dtype=bool),
        source=test.source,
        notes=(note,) if without else (),
    )
    return ForcedObservation(one.force, one.quantity, observation)
