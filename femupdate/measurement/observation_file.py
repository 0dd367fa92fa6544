"""Histories of a building's floors in files, and what the columns of tables stand for."""

import logging
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.measurement.base_rotation import fault_of
from femupdate.measurement.channel import (
    RecordedChannel,
    acceleration_unit,
    channel_listing,
    chosen_channel,
)
from femupdate.measurement.columns import (
    BASE,
    FREQUENCY,
    FREQUENCY_NAME,
    FRF_COLUMNS,
    HISTORY_COLUMNS,
    SECONDS_NAME,
    TIME,
    Channel,
    ForceChannel,
    FrfColumn,
    floor_height,
    parse_frf_column,
    parse_history,
)
from femupdate.measurement.quantity import newtons, si_factor, split_unit
from femupdate.measurement.record import LARGEST_PEAK
from femupdate.measurement.recording import Recording
from femupdate.measurement.sampling import check_step, uniform_step
from femupdate.measurement.table import Table
from femupdate.measurement.text import TextFile, closest
from femupdate.measurement.thresholds import RECORD
from femupdate.units import STANDARD_GRAVITY, percent

logger = logging.getLogger(__name__)

LARGEST_RESPONSE = RECORD.largest_floor * LARGEST_PEAK  # m/s2
_ON_BASE = re.compile(rf"^{BASE}/|/{BASE}\b|/{BASE}_", re.IGNORECASE)
_COMMON_NAMES = (BASE, "RF", *(f"{n}F" for n in range(2, 13)))


@dataclass(frozen=True, eq=False)
class Histories:
    """Accelerations measured at the same times.

    Attributes:
        time_step: s.
        channels: (c,) what each row is.
        acceleration: (c, n) absolute acceleration, m/s2.
        source: where they come from, for messages and reports.
    """

    time_step: float
    channels: tuple[Channel, ...]
    acceleration: Floats
    source: str = "histories"

    @property
    def floors(self) -> tuple[str, ...]:
        """Names of the floors that have a sensor, bottom to top, without the base."""
        names = {channel.floor for channel in self.channels} - {BASE}
        return tuple(sorted(names, key=floor_height))

    def rows(self, floor: str, direction: str) -> list[int]:
        """Rows of the sensors of a floor, or of the base, in one direction."""
        here = floor, direction
        return [k for k, one in enumerate(self.channels) if (one.floor, one.direction) == here]


@dataclass(frozen=True, eq=False)
class ForceHistories:
    """Accelerations of floors under one force.

    Attributes:
        force: floor at which it acts.
        histories: where the base would be stands the force, N.
        notes: for people.
    """

    force: str
    histories: Histories
    notes: tuple[str, ...] = ()


def histories_in(
    recording: Recording, unit: str | None = None, columns: Mapping[str, str] | None = None
) -> Histories | ForceHistories:
    """Histories of a file whose channels are given to floors by the user.

    Args:
        unit: of the accelerations, where the file does not give it.
        columns: our column name to the file's channel or its number.

    Raises:
        MeasurementError: a channel cannot be used; the message names it.
    """
    channels = _mapped_channels(recording, unit, columns or {})
    return _histories(recording.file, channels, unit)


def histories_in_table(
    table: Table, layout: "Layout", unit: str | None = None
) -> Histories | ForceHistories:
    """Likewise of a table with times."""
    channels = _columns_as_channels(table, layout.at, layout.known)
    return _histories(table.file, channels, unit)


def motions_in(
    recording: Recording, columns: Mapping[str, str] | None = None
) -> Mapping[Channel, RecordedChannel]:
    """Histories of floors at the same times, of any quantity, with or without the base.

    Args:
        columns: our column name to the file's column or channel.

    Raises:
        MeasurementError: the file holds no histories, their times differ, or a column or cell
            cannot be used; the message names it.
    """
    file, table = recording.file, recording.table
    if table is None:
        if not recording.channels:
            raise file.error("there are no histories in the file; give the record of the floors")
        channels = _mapped_channels(recording, None, columns or {})
    else:
        layout = layout_of(table, columns)
        if not layout.of_histories:
            raise file.error("these are response functions; modes come from a record of the floors")
        channels = _columns_as_channels(table, layout.at, layout.known)
    motions = {ours: one for ours, one in channels.items() if isinstance(ours, Channel)}
    _require_same_times(file, motions)
    return motions


@dataclass(frozen=True)
class Layout:
    """What the columns of a table stand for.

    Attributes:
        at: position of the times or frequencies.
        of_histories: whether these are times.
        known: what each other column stands for, by its position.
    """

    at: int
    of_histories: bool
    known: Mapping[int, Channel | ForceChannel | FrfColumn]

    @property
    def frfs(self) -> dict[FrfColumn, int]:
        """Position of every column of response functions."""
        return {column: i for i, column in self.known.items() if isinstance(column, FrfColumn)}


def layout_of(table: Table, columns: Mapping[str, str] | None) -> Layout:
    """What the columns of a table stand for.

    Args:
        table: with the names of its columns.
        columns: our column name to the file's.

    Raises:
        MeasurementError: the table has neither times nor frequencies, or a column's name is not
            known.
    """
    file = table.file
    if table.names is None:
        raise file.error(f"the first row must name the columns ({HISTORY_COLUMNS})", 1)
    if any(name.lower().startswith("load/") for name in table.names):
        raise file.error(
            "these are static load cases, which calibrate and inspect alone take; give histories"
            " or FRFs here"
        )
    columns = dict(_with_parts(table.names, columns or {}))
    names = with_usual_axis(_renamed(file, table.names, columns))
    kinds = [name for name in names if name.lower() in (TIME, FREQUENCY)]
    if len(kinds) != 1:
        first = table.names[0]
        raise file.error(
            f"one column must be {TIME} or {FREQUENCY}, the first is {first!r}; rename it or map"
            f" it: columns={{{TIME!r}: {first!r}}}"
        )
    at = names.index(kinds[0])
    known = _known_columns(table, names, at, columns)
    return Layout(at, kinds[0].lower() == TIME, known)


def _mapped_channels(
    recording: Recording, unit: str | None, columns: Mapping[str, str]
) -> dict[Channel | ForceChannel, RecordedChannel]:
    """The channels that are given to floors."""
    file, listing = recording.file, channel_listing(recording.file, recording.channels, unit)
    if not columns:
        raise file.error(
            "the file does not say which floors its channels are; say it by the columns option,"
            f" such as base=1,RF=2; its channels are {listing}"
        )
    chosen: dict[Channel | ForceChannel, RecordedChannel] = {}
    used: list[RecordedChannel] = []
    for ours, theirs in columns.items():
        channel = parse_history(ours)
        if channel is None:
            raise file.error(f"unknown column {ours!r}; columns are {HISTORY_COLUMNS}")
        number = theirs.removeprefix("-").strip()  # a minus turns the channel round
        taken = chosen_channel(file, recording.channels, number, listing)
        if channel in chosen or taken in used:
            name = ours if channel in chosen else theirs
            raise file.error(f"{name!r} is mapped twice; map every channel to one name")
        used.append(taken)
        chosen[channel] = taken if number == theirs else replace(taken, values=-taken.values)
    return chosen


def _renamed(file: TextFile, names: tuple[str, ...], columns: Mapping[str, str]) -> tuple[str, ...]:
    """Return the names of the columns with the mapped ones under our name."""
    ours_by_theirs: dict[str, str] = {}
    for ours, theirs in columns.items():
        title = theirs if theirs in names else split_unit(theirs)[0]
        if title not in names:
            raise file.error(
                f"there is no column {theirs!r} to take for {ours}{closest(theirs, names)};"
                f" the file has {', '.join(names)}"
            )
        if title in ours_by_theirs:
            raise file.error(f"column {theirs!r} is mapped twice; map it to one name")
        ours_by_theirs[title] = ours
    return tuple(ours_by_theirs.get(name, name) for name in names)


def _with_parts(names: tuple[str, ...], columns: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Our name and the file's; of a complex column, which became two, those of either part."""
    for ours, theirs in columns.items():
        parts = [part for part in ("_re", "_im") if f"{theirs}{part}" in names]
        if theirs in names or len(parts) < 2:
            yield ours, theirs
        else:
            yield from ((f"{ours}{part}", f"{theirs}{part}") for part in parts)


def with_usual_axis(names: tuple[str, ...]) -> tuple[str, ...]:
    """The names with ours for the first column, where that has another name for times."""
    if any(name.lower() in (TIME, FREQUENCY) for name in names):
        return names
    for usual, ours in ((SECONDS_NAME, TIME), (FREQUENCY_NAME, FREQUENCY)):
        if usual.match(names[0]):
            return (ours, *names[1:])
    return names


def _known_columns(
    table: Table, names: tuple[str, ...], at: int, columns: Mapping[str, str] | None
) -> dict[int, Channel | ForceChannel | FrfColumn]:
    """Return what each column but the times or frequencies at `at` stands for, by its position."""
    file, of_histories = table.file, names[at].lower() == TIME
    parse: Callable[[str], Channel | ForceChannel | FrfColumn | None]
    parse = parse_history if of_histories else parse_frf_column
    known: dict[int, Channel | ForceChannel | FrfColumn] = {}
    for position, name in enumerate(names):
        if position == at:
            continue
        parsed = parse(name)
        if parsed is None and columns and name not in columns:
            logger.info("%s: column %r is left out", file.path, name)
        elif parsed is None and _ON_BASE.search(name):
            raise file.error(
                f"{name!r} is of a force or a sensor on the base itself, which is not read; leave"
                " the column out"
            )
        elif parsed is None:
            raise file.error(
                f"unknown column {name!r}{closest(name, _COMMON_NAMES)}; columns are"
                f" {HISTORY_COLUMNS if of_histories else FRF_COLUMNS}: rename it or map it by the"
                " columns option"
            )
        elif parsed in known.values():
            raise file.error(f"column {name!r} is there twice; rename or remove one")
        else:
            known[position] = parsed
    return known


def _columns_as_channels(
    table: Table, at: int, known: Mapping[int, Channel | ForceChannel | FrfColumn]
) -> dict[Channel | ForceChannel, RecordedChannel]:
    """The columns of a table with their times in the column `at`."""
    file = table.file
    _require_spectrum(file, table.values.shape[0], int(table.lines[-1]))
    seconds = si_factor(file, table.units[at] or "s", "time")
    step = uniform_step(file, table.values[:, at] * seconds, table.lines, table.title(at))
    return {
        channel: table.channel(i, step)
        for i, channel in known.items()
        if isinstance(channel, Channel | ForceChannel)
    }


def _histories(
    file: TextFile, channels: Mapping[Channel | ForceChannel, RecordedChannel], unit: str | None
) -> Histories | ForceHistories:
    motions = {ours: one for ours, one in channels.items() if isinstance(ours, Channel)}
    forces = [ours for ours in channels if isinstance(ours, ForceChannel)]
    if forces:
        return _under_force(file, forces, channels, motions, unit)
    _require_base_and_floors(file, tuple(motions))
    _require_same_times(file, motions)
    first = next(iter(motions.values()))
    rows = [_acceleration(file, each, channel, unit) for channel, each in motions.items()]
    return Histories(first.time_step, tuple(motions), np.array(rows), file.path.name)


def _under_force(
    file: TextFile,
    forces: Sequence[ForceChannel],
    channels: Mapping[Channel | ForceChannel, RecordedChannel],
    motions: Mapping[Channel, RecordedChannel],
    unit: str | None,
) -> ForceHistories:
    if len(forces) > 1:
        raise file.error(
            f"forces act at {' and '.join(one.floor for one in forces)}; give the record of each in"
            " a file of its own"
        )
    (force,) = forces
    floors = {ours: one for ours, one in motions.items() if ours.floor != BASE}
    if not floors:
        raise file.error("there is a force but no floor that responds; add columns 2F ... RF")
    excitation = channels[force]
    _require_same_times(file, {force: excitation, **floors})
    pushed = newtons(file, excitation.values, excitation.unit, repr(excitation.name))
    if np.ptp(excitation.values) == 0.0:
        raise file.error(
            f"every value is {excitation.values[0]:g}: the force was not recorded",
            column=repr(excitation.name),
        )
    moved = [_acceleration(file, each, ours, unit) for ours, each in floors.items()]
    names = (Channel(BASE, BASE, direction=force.direction), *floors)
    rows = np.array([pushed, *moved])
    histories = Histories(excitation.time_step, names, rows, file.path.name)
    base = [
        _acceleration(file, each, ours, unit)
        for ours, each in motions.items()
        if ours.floor == BASE and ours.direction == force.direction
    ]
    return ForceHistories(force.floor, histories, _base_beside(force.floor, base, moved))


def _base_beside(forced: str, base: Sequence[Floats], floors: Sequence[Floats]) -> tuple[str, ...]:
    """What is told of motion of the base that was measured beside a force."""
    if not base:
        return ()
    largest, own = (max(float(np.std(one)) for one in rows) for rows in (floors, base))
    share = f" ({percent(own / largest)} of the largest floor's, rms)" if largest > 0.0 else ""
    return (
        f"The base's motion{share} is not used beside the force at {forced}: the force is taken"
        " for all that moves the building.",
    )


def _require_same_times(file: TextFile, channels: Mapping[Any, RecordedChannel]) -> None:
    first = next(iter(channels.values()))
    _require_spectrum(file, first.values.size)
    check_step(file, first.time_step, repr(first.name))
    for each in channels.values():
        if (each.time_step, each.values.size) != (first.time_step, first.values.size):
            raise file.error(
                f"channel {each.name!r} has {each.values.size} values every {each.time_step:g} s,"
                f" {first.name!r} {first.values.size} every {first.time_step:g} s; bring them to"
                " the same times"
            )


def _require_spectrum(file: TextFile, count: int, line: int | None = None) -> None:
    if count < RECORD.fewest_of_spectrum:
        raise file.error(
            f"{count} rows are too short for a spectrum; give at least {RECORD.fewest_of_spectrum}",
            line,
        )


def _require_base_and_floors(file: TextFile, channels: tuple[Channel, ...]) -> None:
    floors = [channel.floor for channel in channels]
    if BASE not in floors:
        raise file.error(
            "there is no column base, and a response is measured against the base; name or map"
            " the base acceleration, or take modes from the floors alone by femupdate identify"
        )
    fault = fault_of(channels)
    if fault is not None:
        raise file.error(fault)
    if all(floor == BASE for floor in floors):
        raise file.error("there is no floor beside the base; add columns 2F ... RF")


def _acceleration(
    file: TextFile, recorded: RecordedChannel, channel: Channel, unit: str | None
) -> Floats:
    """Return a history in m/s2; refuse one without motion, or with more than any earthquake."""
    title = repr(recorded.name)
    stated = acceleration_unit(file, recorded, unit)
    values = recorded.values * si_factor(file, stated, "acceleration")
    driven = channel.floor == BASE and channel.direction != "z"
    if np.ptp(values) == 0.0:
        raise file.error(
            f"every value is {recorded.values[0]:g}: the channel was dead; "
            + ("a response needs a base that moves" if driven else "leave it out"),
            column=title,
        )
    peak = float(np.abs(values).max())
    if channel.floor == BASE and peak > LARGEST_PEAK:
        raise file.error(
            f"the base peaks at {peak / STANDARD_GRAVITY:.3g} g when read in {stated}, which no"
            f" strong-motion record has (up to {RECORD.largest_g:g} g); is the unit wrong?",
            column=title,
        )
    if peak > LARGEST_RESPONSE:
        at = int(np.abs(values).argmax())
        raise file.error(
            f"value {at + 1} is {peak / STANDARD_GRAVITY:.3g} g when read in {stated}, which no"
            " floor feels; remove the spike, or correct the unit",
            column=title,
        )
    return values
