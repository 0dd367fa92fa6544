"""What the channels, columns and functions of a measured file stand for, by names of ours.

A name of ours stands in the file itself, or the user gives it to what the file calls otherwise
(`--columns ours=theirs`).
"""

import logging
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TypeVar

import numpy as np

from femupdate.measurement.names import (
    BASE,
    FREQUENCY,
    FREQUENCY_NAME,
    FRF_COLUMNS,
    HISTORY_COLUMNS,
    SECONDS_NAME,
    TIME,
    FloorChannel,
    FrfColumn,
    floor_height,
    floors_of,
    parse_frf_column,
    parse_history,
    split_unit,
)
from femupdate.measurement.recording import (
    RecordedChannel,
    Recording,
    channel_listing,
    channels_of,
    second_clocks,
)
from femupdate.measurement.table import ColumnTable
from femupdate.measurement.text import TextFile, closest

logger = logging.getLogger(__name__)

FEWEST_OF_SPECTRUM = 64  # samples of histories, four segments of 32: less is no spectrum
_Column = TypeVar("_Column")
Known = FloorChannel | FrfColumn
_ON_BASE = re.compile(rf"^{BASE}/|/{BASE}\b|/{BASE}_", re.IGNORECASE)
_KINDS: Mapping[str, tuple[Callable[[str], Known | None], str]] = {
    TIME: (parse_history, HISTORY_COLUMNS),
    FREQUENCY: (parse_frf_column, FRF_COLUMNS),
}


def positions(
    file: TextFile,
    what: str,
    names: Sequence[str],
    columns: Mapping[str, str],
    listing: str = "",
    turned: bool = False,
    numbered: bool = False,
) -> dict[str, int]:
    """Positions in a file of what the user gives our names to, each once.

    Args:
        what: one of them, such as `channel`.
        names: (c,) the file's, which are taken whole, before a comma, or by their first word.
        listing: all of them by numbers from 1, where they may be taken by number.
        turned: whether a minus may stand before a name or number.
        numbered: whether they may be taken by number without a listing.
    """
    at_name: dict[str, int] = {}
    for ours, theirs in columns.items():
        asked = theirs.removeprefix("-") if turned else theirs
        wanted, plain, *folded = (
            " ".join(name.casefold().split()) for name in (asked, split_unit(asked)[0], *names)
        )
        by_number = numbered or bool(listing)
        tries = (
            [name == asked for name in names],
            [name == wanted for name in folded],
            [by_number and wanted == str(number) for number in range(1, len(names) + 1)],
            [name == plain for name in folded],
            [name.split(",")[0] == wanted for name in folded],
            [name.split()[:1] == [wanted] for name in folded],
            [name.partition(", ")[2] == wanted != "" for name in folded],  # where it stands
        )
        best = next((match for match in tries if any(match)), ())
        at = [k for k, fits in enumerate(best) if fits]
        if len(at) != 1:
            problem = f"{len(at)} {what}s are called {theirs!r}"
            if not at:
                near = closest(theirs, names)
                problem = f"there is no {what} {theirs!r} to take for {ours}{near}"
            shown = ", ".join(names[:20]) + (", ..." if len(names) > 20 else "")
            offer = f"choose by number: {listing}" if listing else f"the file has {shown}"
            raise file.error(f"{problem}; {offer}")
        if at[0] in at_name.values():
            raise file.error(f"{what} {theirs!r} is mapped twice; map it to one name")
        at_name[ours] = at[0]
    return at_name


def without_factors(columns: Mapping[str, str]) -> tuple[dict[str, str], dict[str, float]]:
    """Our names to the file's, and what the values of some are multiplied by: `RF=a3*4.7e-6`."""
    plain, factors = dict(columns), {}
    for ours, theirs in columns.items():
        scaled = re.fullmatch(r"(.+?)\s*\*\s*([-+]?\d*\.?\d+(?:[eE][-+]?\d\d?)?)", theirs)
        if scaled:
            plain[ours], factors[ours] = scaled[1], float(scaled[2])
    return plain, factors


def given_channels(
    file: TextFile,
    channels: Sequence[RecordedChannel],
    columns: Mapping[str, str],
    unit: str | None = None,
) -> dict[FloorChannel, RecordedChannel]:
    """The channels to which the user gives our names.

    Args:
        columns: our column name to the file's channel or its number; a minus before it turns the
            channel round, and `*4.7e-6` behind it multiplies its values.

    Raises:
        MeasurementError: there is none, it is vertical, or floors are upside down by the file.
    """
    columns, factors = without_factors(columns)
    known = _known(file, tuple(columns), {}, TIME)
    names, listing = [channel.name for channel in channels], channel_listing(file, channels, unit)
    at = positions(file, "channel", names, columns, listing, turned=True)
    horizontal = {
        at[ours]: motion.floor
        for ours, motion in zip(columns, known.values(), strict=True)
        if isinstance(motion, FloorChannel) and motion.direction != "z"
    }
    for k in horizontal:
        require_horizontal(file, channels[k])
    told = floors_of([channel.location or channel.name for channel in channels])
    rising = sorted((k for k in horizontal if told[k]), key=lambda k: floor_height(horizontal[k]))
    for lower, upper in pairwise(rising):
        low, high = (floor_height(told[k] or BASE) for k in (lower, upper))
        if horizontal[lower] != horizontal[upper] and low > high:
            raise file.error(
                f"channel {names[lower]!r} is taken for {horizontal[lower]} and {names[upper]!r}"
                f" for {horizontal[upper]}, which stands above it: numbers of channels differ from"
                " file to file; map them by their names or places"
            )
    chosen: dict[FloorChannel, RecordedChannel] = {}
    for (ours, theirs), motion in zip(columns.items(), known.values(), strict=True):
        if isinstance(motion, FloorChannel):
            sign = -1.0 if theirs.startswith("-") else 1.0
            chosen[motion] = channels[at[ours]].times(sign * factors.get(ours, 1.0))
    return chosen


def require_horizontal(file: TextFile, channel: RecordedChannel) -> None:
    """Refuse a channel that its file calls vertical."""
    if channel.vertical:
        raise file.error(
            f"channel {channel.name!r} is vertical, as the file says; choose a horizontal one"
        )


def placed_channels(
    recording: Recording, columns: Mapping[str, str] | None, unit: str | None = None
) -> dict[FloorChannel, RecordedChannel]:
    """The histories in a file, by what they are of a building."""
    file, channels = recording.file, recording.channels
    if recording.table is not None:
        table = resolved(recording.table, columns)
        if table.axis != TIME:
            raise file.error("these are response functions; modes come from a record of the floors")
        return table_channels(table)
    if not channels:
        raise file.error("there are no histories in the file; give the record of the floors")
    if not columns:
        raise file.error(
            "the file does not say which floors its channels are; say it by the columns option,"
            f" such as base=1,RF=2; its channels are {channel_listing(file, channels, unit)}"
        )
    return given_channels(file, channels, columns, unit)


def table_channels(table: ColumnTable) -> dict[FloorChannel, RecordedChannel]:
    """The columns of histories in a table."""
    read = channels_of(table, table.at, FEWEST_OF_SPECTRUM, "spectrum")
    return {ours: read[i] for i, ours in table.known.items() if isinstance(ours, FloorChannel)}


def resolved(table: ColumnTable, columns: Mapping[str, str] | None) -> ColumnTable:
    """A table with what its columns stand for, without a first row at zero frequency.

    Args:
        columns: our column name to the file's, which are numbers from 1 where it has no header;
            `time_s` may be a rate, such as `200 Hz`. Once it is given, other columns count only
            where they bear one of our names.
    """
    columns, factors = without_factors(columns or {})
    table, columns = table.with_times(columns)
    file, names = table.file, table.names
    if names is None:
        raise file.error(
            f"the first row must name the columns ({HISTORY_COLUMNS}); or say them by --columns,"
            " such as time_s=1,base=2,RF=3, or base=1,RF=2 with --rate 200 where times are missing",
            1,
        )
    given = renamed_columns(table, columns)
    if factors:
        by = np.array([factors.get(given.get(k, ""), 1.0) for k in range(len(names))])
        table = replace(table, values=table.values * by)
    axes = axes_of([given.get(k, name) for k, name in enumerate(names)])
    if len(axes) != 1:
        first = names[0]
        cure = f"rename it or map it by --columns {TIME}={first},..."
        if parse_history(given.get(0, first)):
            cure = "give the samples a second by --rate 200 where times are missing"
        raise file.error(
            f"one column must be {TIME} or {FREQUENCY}, the first is {first!r}; {cure}"
            f" (`femupdate inspect {file.path}` proposes all)"
        )
    ((at, axis),) = axes.items()
    if axis == FREQUENCY and table.values[0, at] == 0.0:  # where nothing accelerates
        table = replace(table, values=table.values[1:], lines=table.lines[1:])
    unused = [at]
    if axis == TIME:
        unused += [k for k in second_clocks(table, at) if k not in given]
    else:
        table.require_filled(range(table.values.shape[1]))
    return replace(table, at=at, axis=axis, known=_known(file, names, given, axis, unused))


def axes_of(names: Sequence[str]) -> dict[int, str]:
    """Positions of times and frequencies: where our names stand, or where the first means them."""
    axes = {k: name.lower() for k, name in enumerate(names) if name.lower() in (TIME, FREQUENCY)}
    if not axes and SECONDS_NAME.match(names[0]):
        return {0: TIME}
    return {0: FREQUENCY} if not axes and FREQUENCY_NAME.match(names[0]) else axes


def in_parts(positions: Mapping[str, int]) -> dict[str, tuple[int, int | None]]:
    """Positions of columns by their names; `x_re` and `x_im` together are `x`."""
    parts: dict[str, tuple[int, int | None]] = {}
    for name, at in positions.items():
        whole = re.sub("_(re|im)$", "", name)
        real, imaginary = (positions.get(f"{whole}{part}") for part in ("_re", "_im"))
        if real is not None and imaginary is not None:
            parts[whole] = real, imaginary
        else:
            parts[name] = at, None
    return parts


def whole_or_parts(
    file: TextFile, name: str, columns: Mapping[str, _Column], what: str
) -> tuple[_Column, _Column | None]:
    """A column, or those of the real and the imaginary part where there are both."""
    whole, real, imaginary = (columns.get(f"{name}{part}") for part in ("", "_re", "_im"))
    if whole is not None and real is None and imaginary is None:
        return whole, None
    if whole is None and real is not None and imaginary is not None:
        return real, imaginary
    raise file.error(
        f"{what} must have either the column {name} or both {name}_re and {name}_im; complete the"
        " one or remove the other"
    )


def renamed_columns(table: ColumnTable, columns: Mapping[str, str]) -> dict[int, str]:
    """Our name of each column that the user gives one, by its position."""
    names = table.names or ()
    parts = in_parts({name: k for k, name in enumerate(names)})
    options = (*names, *(name for name in parts if name not in names))
    renamed: dict[int, str] = {}
    for ours, at in positions(table.file, "column", options, columns, numbered=True).items():
        real, imaginary = (at, None) if at < len(names) else parts[options[at]]
        renamed[real] = ours if imaginary is None else f"{ours}_re"
        if imaginary is not None:
            renamed[imaginary] = f"{ours}_im"
    return renamed


def _known(
    file: TextFile,
    names: Sequence[str],
    given: Mapping[int, str],
    axis: str,
    unused: Sequence[int] = (),
) -> dict[int, Known]:
    """What channels or columns stand for, by their positions."""
    parse, columns = _KINDS[axis]
    common = (BASE, "RF", *(f"{n}F" for n in range(2, 13)))
    known: dict[int, Known] = {}
    for position, title in enumerate(names):
        name = given.get(position, title)
        parsed = parse(name)
        if position in unused:
            continue
        if parsed is None and given and position not in given:
            logger.info("%s: column %r is left out", file.path, name)
        elif parsed is None and _ON_BASE.search(name):
            raise file.error(
                f"{name!r} is of a force or a sensor on the base itself, which is not read; leave"
                " the column out"
            )
        elif parsed is None:
            raise file.error(
                f"unknown column {name!r}{closest(name, common)}; columns are {columns}:"
                " rename it or map it by --columns"
            )
        elif parsed in known.values():
            raise file.error(f"column {name!r} is there twice; rename or remove one")
        else:
            known[position] = parsed
    return known
