"""What a measured file holds, whatever its format: histories, functions of frequency, modes."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from femupdate.arrays import Floats
from femupdate.errors import MeasurementError
from femupdate.measurement.names import TIME_NAME, parse_channel
from femupdate.measurement.quantity import FORCES, is_acceleration, plain_unit, si_factor
from femupdate.measurement.table import ColumnTable, uniform_step
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

    @property
    def vertical(self) -> bool:
        """Whether it is up or down, as its direction or its name says."""
        named = parse_channel(self.name)
        up = _word(self.direction).replace("-", "") in _VERTICAL
        return up or (named is not None and named.direction == "z")

    def turned(self) -> "RecordedChannel":
        """The same in the opposite direction."""
        return replace(self, values=-self.values)


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
    if stated is None or asked is None:
        return stated or asked or ""
    if si_factor(file, stated, "acceleration") != si_factor(file, asked, "acceleration"):
        raise file.error(
            f"the file says {plain_unit(stated)} but the unit option says {asked}; leave the"
            " option out, or correct the file if it is wrong",
            column=column,
        )
    return stated


def in_m_s2(file: TextFile, channel: RecordedChannel, asked: str | None) -> Floats:
    """Values (n,) of a channel of acceleration in m/s2."""
    unit = acceleration_unit(file, channel, asked)
    return channel.values * si_factor(file, unit, "acceleration")


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
            None if one is None else replace(one, file=file)
            for one in (self.table, self.mode_table)
        )
        return replace(self, file=file, table=table, mode_table=modes)

    def histories(self) -> tuple[RecordedChannel, ...]:
        """Channels of the file; of a table, every column beside the one of times."""
        if self.table is None:
            return self.channels
        return tuple(channels_of(self.table, _time_column(self.table)).values())


def channels_of(
    table: ColumnTable, at: int, fewest: int = 3, what: str = "record"
) -> dict[int, RecordedChannel]:
    """The columns of a table as histories by their positions, but for that of the times.

    Args:
        fewest, what: rows that there must be, and for what.
    """
    count, width = table.values.shape
    if count < fewest:
        raise table.file.error(
            f"{count} rows are too short for a {what}; give at least {fewest}",
            int(table.lines[-1]),
        )
    seconds = si_factor(table.file, table.units[at] or "s", "time")
    step = uniform_step(table.file, table.values[:, at] * seconds, table.lines, table.title(at))
    return {
        column: RecordedChannel(
            name=table.names[column] if table.names else str(column),
            values=table.values[:, column],
            time_step=step,
            unit=table.units[column],
            quantity="force" if table.units[column] in FORCES else "acceleration",
        )
        for column in range(width)
        if column != at
    }


def _time_column(table: ColumnTable) -> int:
    if table.values.shape[1] == 1:
        raise table.file.error(
            "there is one column only; a record needs a column of times and one of acceleration"
        )
    named = [i for i, name in enumerate(table.names or ()) if TIME_NAME.match(name)]
    if named or len(table.values) < 3:  # so few rows are refused wherever their times are
        return named[0] if named else 0
    # No acceleration grows by the same step from row to row: such a first column is the time.
    try:
        uniform_step(table.file, table.values[:, 0], table.lines, table.title(0))
    except MeasurementError:
        if table.names is None and (np.diff(table.values[:, 0]) > 0.0).all():
            raise
        if table.names is None:
            raise table.file.error(
                "no column grows as times do; put one of times, in s, before the others"
            ) from None
        raise table.file.error(
            f"no column of times among {', '.join(table.names)}; call it time_s"
        ) from None
    return 0
