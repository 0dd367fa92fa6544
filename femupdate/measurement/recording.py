"""What a measured file holds, whatever its format."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from femupdate.arrays import Floats
from femupdate.errors import MeasurementError
from femupdate.measurement.channel import RecordedChannel
from femupdate.measurement.columns import TIME_NAME
from femupdate.measurement.sampling import uniform_step
from femupdate.measurement.table import Table
from femupdate.measurement.text import TextFile


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordedFunction:
    """A function of frequency as the file gives it.

    Attributes:
        kind: what it is, such as `frequency response` or `coherence`.
        name: the file's name for it.
        frequency_hz: (m,)
        values: (m,) real or complex, in `unit`.
        unit: that the file states, or None.
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
        frequency_hz: natural frequency.
        sensors: (s,) names of the components of the shape, such as `2F` or `point 3 +X`.
        shape: (s,) components, in the file's scale; NaN where one is missing.
        shape_sd: (s,) standard deviations in that scale, NaN where not known, or None.
        frequency_sd_hz: standard deviation of the frequency, or None.
        damping: ratio of critical damping, or None.
        damping_sd: standard deviation of it, or None.
        name: that the file gives it.
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
        >>> from femupdate.measurement.registry import read_measured
        >>> recording = read_measured("run.csv")
        >>> isinstance(recording, femupdate.Recording), recording.format
        (True, 'plain')

    Attributes:
        file: where it was read, for messages.
        channels: its histories, where the format says what is one.
        table: its columns, where they mean what the user takes them for.
        functions: its functions of frequency.
        modes: its identified modes.
        mode_table: a table of identified modes, whose columns mean what the user takes them for;
            NaN where a cell is blank.
        points: coordinates of its measuring points by their numbers, in the file's unit.
        notes: sentences on what else the file holds.
        format: name of the reader, set by `registry.read_measured`.
    """

    file: TextFile
    channels: tuple[RecordedChannel, ...] = ()
    table: Table | None = None
    functions: tuple[RecordedFunction, ...] = ()
    modes: tuple[RecordedMode, ...] = ()
    mode_table: Table | None = None
    points: Mapping[int, tuple[float, float, float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    format: str = ""

    def __post_init__(self) -> None:
        """Refuse a channel with a gap: samples that are not finite, such as NaN.

        Raises:
            MeasurementError: there is such a channel.
        """
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
        """Channels of the file; of a table, every column beside the one of times.

        Raises:
            MeasurementError: a table has no column of times, fewer than three rows, or its
                sampling is not uniform.
        """
        if self.table is None:
            return self.channels
        return tuple(self.table.channels(_time_column(self.table)).values())


def _time_column(table: Table) -> int:
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
