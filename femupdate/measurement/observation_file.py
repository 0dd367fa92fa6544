"""Observations of a building in files: measured histories or frequency response functions."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.measurement.columns import (
    BASE,
    FREQUENCY,
    FRF_COLUMNS,
    HISTORY_COLUMNS,
    TIME,
    Channel,
    FrfColumn,
    floor_height,
    parse_channel,
    parse_frf_column,
)
from femupdate.measurement.frf_table import FrfTable, frf_table
from femupdate.measurement.quantity import agreed_unit, si_factor, split_unit
from femupdate.measurement.record import LARGEST_PEAK, channel_listing
from femupdate.measurement.recording import RecordedChannel, Recording, chosen_channel
from femupdate.measurement.registry import read_measured
from femupdate.measurement.sampling import uniform_step
from femupdate.measurement.table import Table
from femupdate.measurement.text import TextFile, closest
from femupdate.units import STANDARD_GRAVITY

logger = logging.getLogger(__name__)

MINIMUM_SAMPLES = 64  # four segments of 32 samples: less is no spectrum
__all__ = ["FrfTable", "Histories", "read_observation_file"]
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


def read_observation_file(
    path: str | Path, unit: str | None = None, columns: Mapping[str, str] | None = None
) -> Histories | FrfTable:
    """Read measured histories or response functions of a building's floors.

    Args:
        path: a table with the column time_s (histories) or frequency_hz (FRFs), or any other
            format that is known, whose channels `columns` gives to floors.
        unit: of the accelerations, where the file does not give it.
        columns: our column name to the file's column or channel, such as `{"2F": "a_1F"}`; a
            channel also by its number. Once it is given, the file's other columns count only
            where they bear one of our names.

    Raises:
        MeasurementError: the file, a column or a cell cannot be used; the message names it.
    """
    recording = read_measured(path)
    if recording.table is None:
        return _from_channels(recording, unit, columns or {})
    return _from_table(recording.table, unit, columns)


def _from_table(
    table: Table, unit: str | None, columns: Mapping[str, str] | None
) -> Histories | FrfTable:
    file = table.file
    if table.names is None:
        raise file.error(f"the first row must name the columns ({HISTORY_COLUMNS})", 1)
    names = _renamed(file, table.names, columns or {})
    kinds = [name for name in names if name.lower() in (TIME, FREQUENCY)]
    if len(kinds) != 1:
        first = table.names[0]
        raise file.error(
            f"one column must be {TIME} or {FREQUENCY}, the first is {first!r}; rename it or map"
            f" it: columns={{{TIME!r}: {first!r}}}"
        )
    at = names.index(kinds[0])
    if kinds[0].lower() == TIME:
        known = _known_columns(file, names, at, _Naming(parse_channel, HISTORY_COLUMNS), columns)
        return _histories(table, at, known, unit)
    naming = _Naming(parse_frf_column, FRF_COLUMNS)
    return frf_table(table, at, _known_columns(file, names, at, naming, columns))


def _from_channels(recording: Recording, unit: str | None, columns: Mapping[str, str]) -> Histories:
    file, listing = recording.file, channel_listing(recording.file, recording.channels, unit)
    if not columns:
        raise file.error(
            "the file does not say which floors its channels are; say it by the columns option,"
            f" such as base=1,RF=2; its channels are {listing}"
        )
    chosen: dict[Channel, RecordedChannel] = {}
    for ours, theirs in columns.items():
        channel = parse_channel(ours)
        if channel is None:
            raise file.error(f"unknown column {ours!r}; columns are {HISTORY_COLUMNS}")
        taken = chosen_channel(file, recording.channels, theirs, listing)
        if taken in chosen.values():
            raise file.error(f"channel {theirs!r} is mapped twice; map it to one name")
        chosen[channel] = taken
    _require_base_and_floors(file, tuple(chosen))
    _require_one_sampling(file, tuple(chosen.values()))
    rows = [
        _acceleration(file, _Column(repr(each.name), each.values, each.unit), channel, unit)
        for channel, each in chosen.items()
    ]
    step = next(iter(chosen.values())).time_step
    return Histories(step, tuple(chosen), np.array(rows), file.path.name)


def _require_one_sampling(file: TextFile, channels: tuple[RecordedChannel, ...]) -> None:
    first = channels[0]
    if first.values.size < MINIMUM_SAMPLES:
        raise file.error(
            f"{first.values.size} values are too short for a spectrum; give at least"
            f" {MINIMUM_SAMPLES}"
        )
    for each in channels[1:]:
        if (each.time_step, each.values.size) != (first.time_step, first.values.size):
            raise file.error(
                f"channel {each.name!r} has {each.values.size} values every {each.time_step:g} s,"
                f" {first.name!r} {first.values.size} every {first.time_step:g} s; bring them to"
                " the same times"
            )


@dataclass(frozen=True)
class _Naming:
    """How the columns of a kind of file are named."""

    parse: Callable[[str], Channel | FrfColumn | None]
    help: str


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


def _known_columns(
    file: TextFile,
    names: tuple[str, ...],
    at: int,
    naming: _Naming,
    columns: Mapping[str, str] | None,
) -> dict[int, Channel | FrfColumn]:
    """Return what each column but the one at `at` stands for, by its position."""
    known: dict[int, Channel | FrfColumn] = {}
    for position, name in enumerate(names):
        if position == at:
            continue
        parsed = naming.parse(name)
        if parsed is None and columns and name not in columns:
            logger.info("%s: column %r is left out", file.path, name)
        elif parsed is None:
            raise file.error(
                f"unknown column {name!r}{closest(name, _COMMON_NAMES)}; columns are"
                f" {naming.help}: rename it or map it by the columns option"
            )
        elif parsed in known.values():
            raise file.error(f"column {name!r} is there twice; rename or remove one")
        else:
            known[position] = parsed
    return known


def _histories(
    table: Table, at: int, known: Mapping[int, Channel | FrfColumn], unit: str | None
) -> Histories:
    file, count = table.file, table.values.shape[0]
    if count < MINIMUM_SAMPLES:
        raise file.error(
            f"{count} rows are too short for a spectrum; give at least {MINIMUM_SAMPLES}",
            int(table.lines[-1]),
        )
    seconds = si_factor(file, table.units[at] or "s", "time")
    step = uniform_step(file, table.values[:, at] * seconds, table.lines, table.title(at))
    channels = {i: channel for i, channel in known.items() if isinstance(channel, Channel)}
    _require_base_and_floors(file, tuple(channels.values()))
    rows = [
        _acceleration(file, _Column(table.title(i), table.values[:, i], table.units[i]), each, unit)
        for i, each in channels.items()
    ]
    return Histories(step, tuple(channels.values()), np.array(rows), file.path.name)


def _require_base_and_floors(file: TextFile, channels: tuple[Channel, ...]) -> None:
    floors = [channel.floor for channel in channels]
    if BASE not in floors:
        raise file.error(
            "there is no column base, and a response is measured against the base; name or map"
            " the base acceleration"
        )
    if all(floor == BASE for floor in floors):
        raise file.error("there is no floor beside the base; add columns 2F ... RF")


@dataclass(frozen=True, eq=False)
class _Column:
    """Numbers of a file, with the title that messages give them and the unit stated."""

    title: str
    values: Floats
    unit: str | None


def _acceleration(file: TextFile, column: _Column, channel: Channel, unit: str | None) -> Floats:
    """Return a column in m/s2; refuse one that holds no motion, or more than any earthquake."""
    stated = agreed_unit(file, column.unit, unit, column.title)
    values = column.values * si_factor(file, stated, "acceleration")
    if np.ptp(values) == 0.0:
        raise file.error(
            f"every value is {column.values[0]:g}: the channel was dead; "
            + ("a response needs a base that moves" if channel.floor == BASE else "leave it out"),
            column=column.title,
        )
    peak = float(np.abs(values).max())
    if channel.floor == BASE and peak > LARGEST_PEAK:
        raise file.error(
            f"the base peaks at {peak / STANDARD_GRAVITY:.3g} g when read in {stated}, which no"
            " strong-motion record has (up to 5 g); is the unit wrong?",
            column=column.title,
        )
    return values
