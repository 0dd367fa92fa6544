"""What a measured file holds, whatever its format: histories, functions of frequency, modes."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from femupdate.arrays import Floats
from femupdate.errors import MeasurementError, brief
from femupdate.measurement.clock import (
    BRIDGED,
    counted_unit,
    even_step,
    interpolated,
    rate_ratio,
    resampled,
)
from femupdate.measurement.names import (
    DIRECTION_END,
    FORCES,
    RAW,
    TIME,
    TIME_NAME,
    floors_of,
    is_acceleration,
    parse_channel,
    parse_history,
    plain_unit,
    si_factor,
)
from femupdate.measurement.table import ColumnTable
from femupdate.measurement.text import TextFile
from femupdate.units import UNITS

_POINTS = {"N": 0.0, "E": 90.0, "S": 180.0, "W": 270.0, "NE": 45.0, "SE": 135.0, "SW": 225.0}
_POINTS |= {"NW": 315.0, "NS": 0.0, "EW": 90.0, "NORTH": 0.0, "EAST": 90.0, "SOUTH": 180.0}
_POINTS |= {"WEST": 270.0}
_VERTICAL = {"UP", "DOWN", "UD", "DU", "V", "Z", "VERT", "VERTICAL"}
_DEGREES = re.compile(r"^(\d{1,3})\s*(?:DEG(?:REES)?\.?|°)?$")
_QUADRANT = re.compile(r"^([NS])\s*(\d{1,2})\s*(?:DEG)?\s*([EW])$")


def azimuth_of(direction: str) -> float | None:
    """Degrees clockwise from north of `90 Deg`, `N-S`, `N35E` or `east`; None of other words."""
    word = _word(direction)
    degrees, quadrant = _DEGREES.match(word), _QUADRANT.match(word)
    if degrees and float(degrees.group(1)) <= 360.0:
        return float(degrees.group(1)) % 360.0
    if quadrant:
        north, angle, east = quadrant.groups()
        turned = float(angle) if north == "N" else 180.0 - float(angle)
        return (turned if east == "E" else -turned) % 360.0
    return _POINTS.get(word.replace("-", ""))


def _word(direction: str) -> str:
    # KiK-net numbers its directions by the depth of the sensor: NS1 in the borehole, NS2 above.
    return re.sub(r"^(NS|EW|UD)\d$", r"\1", " ".join(direction.upper().split()))


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordedChannel:
    """One history as the file gives it.

    Attributes:
        values: (n,) in `unit`.
        time_step: s.
        location: where the sensor sits, in the file's words; empty where it does not say.
        direction: in the file's words, such as `90 Deg` or `Up`; empty where it does not say.
        azimuth_deg: clockwise from north, where it is known.
        stated_peak: largest absolute value by the file's header, in `unit`.
        start: of the first sample on the file's clock, s; None where the file does not say.
        done: sentences on what was done to its times: rounded, interpolated, cut.
    """

    name: str
    values: Floats
    time_step: float
    unit: str | None
    quantity: str = "acceleration"
    location: str = ""
    direction: str = ""
    azimuth_deg: float | None = None
    stated_peak: float | None = None
    start: float | None = None
    done: tuple[str, ...] = ()

    @property
    def end(self) -> float:
        """Time of the last sample on the file's clock, s."""
        return (self.start or 0.0) + (self.values.size - 1) * self.time_step

    @property
    def vertical(self) -> bool:
        """Whether it is up or down, as its direction or its name says."""
        named = parse_channel(self.name)
        up = _word(self.direction).replace("-", "") in _VERTICAL
        return up or (named is not None and named.direction == "z")

    @property
    def horizontal(self) -> bool:
        """Whether it is a horizontal acceleration, as far as is told."""
        unit = self.unit or "counts"
        known = RAW.fullmatch(unit) is not None or is_acceleration(unit)
        return known and self.quantity in ("acceleration", "unknown") and not self.vertical

    def times(self, factor: float) -> "RecordedChannel":
        """The same multiplied by a factor, -1 for the opposite direction."""
        return self if factor == 1.0 else replace(self, values=factor * self.values)


def acceleration_unit(file: TextFile, channel: RecordedChannel, asked: str | None) -> str:
    """Return the unit of a channel of acceleration, stated in the file or asked for by the user."""
    stated, column = channel.unit, repr(channel.name)
    if channel.quantity not in ("acceleration", "unknown"):
        raise file.error(
            f"{column} holds {channel.quantity}, not acceleration; choose another channel"
        )
    if stated is None and asked is None:
        raise file.error(
            "the file does not say its unit; give it by the unit option or in the second header"
            f" row (one of {', '.join(UNITS['acceleration'])})",
            column=column,
        )
    if stated is None or asked is None or RAW.fullmatch(stated):
        return asked or stated or ""
    if si_factor(file, stated, "acceleration") != si_factor(file, asked, "acceleration"):
        raise file.error(
            f"the file says {plain_unit(stated)} but the unit option says {asked}; leave the"
            " option out, or correct the file if it is wrong",
            column=column,
        )
    return stated


def in_m_s2(file: TextFile, channel: RecordedChannel, asked: str | None) -> Floats:
    """Values (n,) of a channel of acceleration in m/s2."""
    return channel.values * si_factor(file, acceleration_unit(file, channel, asked), "acceleration")


def channel_listing(file: TextFile, channels: Sequence[RecordedChannel], unit: str | None) -> str:
    """Return `1 = 90 Deg (peak 3.38 m/s2), 2 = ...`; `unit` is that of channels without one."""
    entries = []
    for number, each in enumerate(channels, start=1):
        stated = each.unit or unit
        peak = float(np.abs(each.values).max())
        if stated is None or not is_acceleration(stated):
            shown = f"{peak:.4g} {each.unit or 'in its own unit'}"
        else:
            shown = f"{peak * si_factor(file, stated, 'acceleration'):.4g} m/s2"
        entries.append(f"{number} = {each.name} (peak {shown})")
    return ", ".join(entries)


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordedFunction:
    """A function of frequency as the file gives it.

    Attributes:
        frequency_hz: (m,)
        values: (m,) real or complex, in `unit`.
        response: where and in which direction the response was measured.
        reference: likewise of the excitation or the reference.
    """

    kind: str
    name: str
    frequency_hz: Floats
    values: NDArray[np.inexact]
    unit: str | None
    response: str = ""
    reference: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordedMode:
    """An identified mode as the file gives it.

    Attributes:
        sensors: (s,) names of the components of the shape, such as `2F` or `point 3 +X`.
        shape: (s,) components, in the file's scale; NaN where one is missing.
        shape_sd: (s,) standard deviations in that scale, NaN where not known, or None.
    """

    frequency_hz: float
    sensors: tuple[str, ...]
    shape: NDArray[np.inexact]
    shape_sd: Floats | None = None
    frequency_sd_hz: float | None = None
    damping: float | None = None
    damping_sd: float | None = None
    name: str = ""


def mean_of_tests(modes: Sequence[RecordedMode]) -> RecordedMode:
    """Means of a mode over tests, their standard errors, shapes in the scale of the first."""
    if len(modes) == 1:
        return modes[0]

    def mean(name: str, of_sd: str) -> tuple[float | None, float | None]:
        pairs = [(getattr(mode, name), getattr(mode, of_sd)) for mode in modes]
        seen = np.array([value for value, _ in pairs if value is not None])
        stated = [sd for value, sd in pairs if None not in (value, sd)]
        if not seen.size:
            return None, None
        error = seen.std(ddof=1) / np.sqrt(seen.size) if seen.size > 1 else 0.0
        error = max(error, float(np.linalg.norm(stated)) / seen.size)
        return float(seen.mean()), float(error) or None

    frequency_hz, frequency_sd_hz = mean("frequency_hz", "frequency_sd_hz")
    damping, damping_sd = mean("damping", "damping_sd")
    shapes = np.array([mode.shape for mode in modes])
    known = ~np.isnan(shapes) & ~np.isnan(shapes[0])
    filled = np.where(known, shapes, 0.0)
    scale = (filled.conj() @ filled[0]) / np.maximum((np.abs(filled) ** 2).sum(axis=1), 1e-300)
    shapes = shapes * scale[:, None]
    count = (~np.isnan(shapes)).sum(axis=0)
    mean_shape = np.nansum(shapes, axis=0) / np.where(count, count, np.nan)
    scatter = np.nansum(np.abs(shapes - mean_shape) ** 2, axis=0)
    error = np.sqrt(scatter / np.where(count > 1, (count - 1) * count, np.nan))
    return replace(
        modes[0],
        frequency_hz=frequency_hz or np.nan,
        frequency_sd_hz=frequency_sd_hz,
        damping=damping,
        damping_sd=damping_sd,
        shape=mean_shape,
        shape_sd=np.where(error > 0.0, error, np.nan),
    )


@dataclass(frozen=True, eq=False)
class Recording:
    """What a measured file holds.

        >>> import femupdate
        >>> from femupdate.measurement.reader import read_measured
        >>> recording = read_measured("run.csv")
        >>> isinstance(recording, femupdate.Recording), recording.format
        (True, 'plain')

    Attributes:
        channels: its histories, where the format says what is one.
        table: its columns, where they mean what the user takes them for.
        mode_table: a table of identified modes, whose columns mean what the user takes them for;
            NaN where a cell is blank.
        points: coordinates of its measuring points by their numbers, in the file's unit.
    """

    __repr__ = brief

    file: TextFile
    channels: tuple[RecordedChannel, ...] = ()
    table: ColumnTable | None = None
    functions: tuple[RecordedFunction, ...] = ()
    modes: tuple[RecordedMode, ...] = ()
    mode_table: ColumnTable | None = None
    points: Mapping[int, tuple[float, float, float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    format: str = ""

    def __post_init__(self) -> None:
        """Refuse a channel with a gap: samples that are not finite, such as NaN."""
        for channel in self.channels:
            gaps = np.flatnonzero(~np.isfinite(channel.values))
            if gaps.size:
                raise self.file.error(
                    f"{channel.name} holds no finite number at {gaps[0] * channel.time_step:.6g} s"
                    f" ({gaps.size} such samples); cut the record there, or fill the gap"
                )

    def without_text(self) -> "Recording":
        """The same without the lines of its file, which are of no use once it is read."""
        file = replace(self.file, lines=())
        table, modes = (
            None if table is None else replace(table, file=file)
            for table in (self.table, self.mode_table)
        )
        return replace(self, file=file, table=table, mode_table=modes)

    def histories(self, columns: Mapping[str, str] | None = None) -> tuple[RecordedChannel, ...]:
        """Channels of the file; of a table, every column beside the one of times.

        Args:
            columns: our column name to the file's, as the user says it.
        """
        if self.table is None:
            return self.channels
        table, given = self.table.with_times(columns or {})
        names, values = table.names or (), table.values
        if values.shape[1] == 1:
            raise table.file.error(
                "there is one column only; a record needs a column of times and one of acceleration"
            )
        at = next(
            (k for k, name in enumerate(names) if TIME_NAME.match(name) or name == given.get(TIME)),
            None,
        )
        # So few rows as two are refused wherever their times are. No acceleration grows by the same
        # step from row to row: such a first column is the time.
        if at is None and len(values) > 2:
            try:
                even_step(table.file, values[:, 0], table.lines, table.title(0))
            except MeasurementError:
                if not names and (np.diff(values[:, 0]) > 0.0).all():
                    raise
                rate = "give the rate: --rate 200; of periods give frequencies"
                raise table.file.error(
                    f"no column of times among {', '.join(names)}; call it time_s, or {rate}"
                    if names
                    else f"no column grows as times do; put one of times, in s, first, or {rate}"
                ) from None
        return tuple(in_step(self.file, channels_of(table, at or 0)).values())


def channels_of(
    table: ColumnTable, at: int, fewest: int = 3, what: str = "record"
) -> dict[int, RecordedChannel]:
    """The columns of a table as histories by their positions, but for those of times.

    Args:
        at: position of the times.
        fewest, what: rows that there must be, and for what.
    """
    count, width = table.values.shape
    if count < fewest:
        raise table.file.error(
            f"{count} rows are too short for a {what}; give at least {fewest}", int(table.lines[-1])
        )
    table.require_filled([at])
    twice = np.flatnonzero((np.diff(table.values, axis=0) == 0.0).all(axis=1)) + 1
    repeated: tuple[str, ...] = ()
    if 0 < twice.size < 0.01 * count:
        line = table.lines[twice[0]]
        repeated = (f"Rows that are there twice are left out, first line {line}.",)
        kept = np.delete(np.arange(count), twice)
        table = replace(table, values=table.values[kept], lines=table.lines[kept])
    time, counted = _seconds(table, at)
    counted = (*counted, *repeated)
    step, even, words = even_step(table.file, time, table.lines, table.title(at))
    values, begin = table.values, float(time[0])
    if even is not None:
        table.require_filled(range(width))
        values, begin = interpolated(values, time, even), float(even[0])
    lost = bool(np.isnan(values[:, at]).any())
    clocks = _other_clocks(table, at, time)
    channels: dict[int, RecordedChannel] = {}
    for column in range(width):
        if column == at or column in clocks.values():
            continue
        clock, of_column = clocks.get(column), step
        start, done = begin, (*counted, *words)
        if clock is not None:
            other, counted = _seconds(table, clock)
            of_column, _, words = even_step(table.file, other, table.lines, table.title(clock))
            start, done = float(other[0]), (*counted, *words)
        name = table.names[column] if table.names else str(column)
        end = None if parse_history(name) else DIRECTION_END.search(name)
        direction = end[1].upper() if end else ""
        first, every, seen, blank = _filled(table, column, values[:, column], of_column)
        channels[column] = RecordedChannel(
            name=name,
            values=seen,
            time_step=of_column * every,
            unit=table.units[column],
            quantity="force" if table.units[column] in FORCES else "acceleration",
            direction=direction,
            azimuth_deg=azimuth_of(direction),
            start=start + first * of_column,
            done=(*done, *(() if lost else blank)),
        )
    return channels


def _seconds(table: ColumnTable, at: int) -> tuple[Floats, tuple[str, ...]]:
    """A column of times in s, and a sentence where its numbers alone tell their unit."""
    values = table.values[:, at]
    unit, counted = counted_unit(table.names[at] if table.names else "", table.units[at], values)
    return values * si_factor(table.file, unit, "time"), counted


def _other_clocks(table: ColumnTable, at: int, time: Floats) -> dict[int, int]:
    """Position of the clock of each column that has one of its own; -1 of a clock of no use."""
    names = table.names or ()
    clocks: dict[int, int] = {}
    for clock in second_clocks(table, at):
        apart = _seconds(table, clock)[0] - time
        length, step = float(np.ptp(time)), float(np.ptp(time)) / max(len(time) - 1, 1)
        offset = abs(float(np.median(apart)))
        if float(np.ptp(apart)) < 0.5 * step and (offset < 0.01 * step or offset > length):
            clocks[-clock - 1] = clock  # the same times once more, or counted from elsewhere
            continue
        place = re.split(r"[_ .]", names[clock], maxsplit=1)[-1]
        floors = floors_of([place, *names])
        owners = [k for k, floor in enumerate(floors[1:]) if floor and floor == floors[0]]
        owners = [k for k in owners if k not in (at, clock)]
        if not owners:
            raise table.file.error(
                f"{names[at]} and {names[clock]} are two clocks, {offset:.3g} s apart, and it is"
                " not said which columns go by which; give the columns of each clock in a file of"
                " their own"
            )
        clocks |= dict.fromkeys(owners, clock)
    return clocks


def second_clocks(table: ColumnTable, at: int) -> list[int]:
    """Positions of other columns that are called as times and grow as times do."""
    return [
        k
        for k, name in enumerate(table.names or ())
        if k != at and TIME_NAME.match(name) and (np.diff(table.values[:, k]) > 0.0).all()
    ]


def _filled(
    table: ColumnTable, column: int, values: Floats, step: float
) -> tuple[int, int, Floats, tuple[str, ...]]:
    """First row, rows from value to value, and values of a column with blank cells, and words."""
    where = np.flatnonzero(np.isfinite(values))
    if where.size == values.size:
        return 0, 1, values, ()
    title = table.title(column)
    apart = np.diff(where)
    if where.size > 2 and apart[0] > 1 and (apart == apart[0]).all():
        every = int(apart[0])
        words = f"{title} has a value in every {every}. row only: {1.0 / (step * every):g} Hz."
        return int(where[0]), every, values[where], (words,)
    within = where.size > 1024 and where[0] == 0 and where[-1] == values.size - 1
    if within and apart.max() <= BRIDGED + 1 and where.size > 0.99 * values.size:
        words = f"{title}: blank cells, {values.size - where.size} in all, are interpolated."
        rows = np.arange(float(values.size))
        return 0, 1, interpolated(values[where, None], rows[where], rows)[:, 0], (words,)
    runs = np.split(where, np.flatnonzero(apart > 1) + 1)
    longest = max(runs, key=len)
    # Of a gap within, the longer side is worth its while; one blank cell in a short table is not.
    if longest.size < (3 if len(runs) == 1 else max(1024, values.size // 2)):
        table.require_filled([column])
    first, last = int(longest[0]), int(longest[-1])
    words = (
        f"{title} has blank cells: it is used from {first * step:.4g} to {last * step:.4g} s after"
        " the first row."
    )
    return first, 1, values[first : last + 1], (words,)


def told_apart(channels: Sequence[RecordedChannel]) -> tuple[RecordedChannel, ...]:
    """The channels, those of one name with their location or number behind it."""
    count = Counter(each.name for each in channels)
    return tuple(
        each
        if count[each.name] == 1
        else replace(each, name=f"{each.name}, {each.location or f'channel {number}'}")
        for number, each in enumerate(channels, start=1)
    )


_Key = TypeVar("_Key")


def in_step(
    file: TextFile, channels: Mapping[_Key, RecordedChannel], one_rate: bool = False
) -> dict[_Key, RecordedChannel]:
    """Channels over the time that all of them have, where each says when it starts.

    Args:
        one_rate: whether those of a higher rate are brought to the lowest.
    """
    found = dict(channels)
    steps = {each.time_step for each in found.values()}
    slow = next((each for each in found.values() if each.time_step == max(steps)), None)
    if slow is None:
        return found
    done: list[str] = []
    if all(each.start is not None for each in found.values()):
        latest = max(each.start or 0.0 for each in found.values())
        ahead = (latest - (slow.start or 0.0)) / slow.time_step
        begin = (slow.start or 0.0) + np.ceil(ahead - 1e-3) * slow.time_step
        end = min(each.end for each in found.values())
        if end <= begin:
            raise file.error("the channels have no time in common; give records of the same event")
        places = {
            key: (begin - (each.start or 0.0)) / each.time_step for key, each in found.items()
        }
        counts: dict[float, int] = {}  # of samples, by their step
        for key, each in found.items():
            most = int((end - begin) / each.time_step + 1e-3) + 1
            most = min(most, each.values.size - round(places[key]))
            counts[each.time_step] = min(most, counts.get(each.time_step, most))
        for key, each in found.items():
            values = each.values[round(places[key]) :][: counts[each.time_step]]
            found[key] = replace(each, values=values, start=begin)
        if any(each.values.size < channels[key].values.size - 1 for key, each in found.items()):
            earliest = min(each.start or 0.0 for each in channels.values())
            late = [each for each in channels.values() if (each.start or 0.0) > earliest]
            names = ", ".join(f"{e.name} {(e.start or 0.0) - earliest:.4g} s" for e in late[:6])
            done.append(
                f"Cut to the time that all channels have, {begin - earliest:.4g} to"
                f" {end - earliest:.4g} s"
                + (f": by the file, {names} later than the first." if late else ".")
            )
        apart = max(abs(place - round(place)) for place in places.values())
        # From a tenth of a step on it is worth a word.
        if apart > 0.1 and len(steps) == 1:
            done.append(
                f"Channels begin up to {apart:.2g} of a sample apart; resample them to one clock."
            )
    if one_rate and len(steps) > 1:
        for key, each in found.items():
            ratio = rate_ratio(each.time_step, slow.time_step, each.values.size)
            if ratio is None:
                raise file.error(
                    f"{each.name} is sampled at {1.0 / each.time_step:g} Hz, {slow.name} at"
                    f" {1.0 / slow.time_step:g} Hz; bring them to one rate"
                )
            mean = each.values.mean()
            values = each.values if ratio == 1 else resampled(each.values - mean, ratio) + mean
            found[key] = replace(each, values=values, time_step=slow.time_step)
        sizes = [each.values.size for each in found.values()]
        if max(sizes) - min(sizes) > 2:
            raise file.error(
                "the channels have unlike rates and lengths, and the file does not say when they"
                " start; cut them to the same times"
            )
        found = {key: replace(c, values=c.values[: min(sizes)]) for key, c in found.items()}
        done.append(
            f"Channels of unlike rates, {', '.join(f'{1.0 / step:g}' for step in sorted(steps))}"
            f" Hz, are all taken at {1.0 / slow.time_step:g} Hz, that of {slow.name}."
        )
    return {key: replace(each, done=(*each.done, *done)) for key, each in found.items()}
