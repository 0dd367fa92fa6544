"""What a measured file holds, whatever its format."""

import re
from dataclasses import dataclass

from femupdate.errors import MeasurementError
from femupdate.measurement.channel import RecordedChannel
from femupdate.measurement.quantity import si_factor
from femupdate.measurement.sampling import uniform_step
from femupdate.measurement.table import Table
from femupdate.measurement.text import TextFile

TIME_NAME = re.compile(r"^(t|time)([_ .].*)?$|^sec(ond)?s?$|^時[刻間]", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Recording:
    """What a measured file holds.

    Attributes:
        file: where it was read, for messages.
        channels: its histories, where the format says what is one.
        table: its columns, where they mean what the user takes them for.
        notes: sentences on what else the file holds.
        format: name of the reader, set by `registry.read_measured`.
    """

    file: TextFile
    channels: tuple[RecordedChannel, ...] = ()
    table: Table | None = None
    notes: tuple[str, ...] = ()
    format: str = ""

    def histories(self) -> tuple[RecordedChannel, ...]:
        """Channels of the file; of a table, every column beside the one of times.

        Raises:
            MeasurementError: a table has no column of times, fewer than three rows, or its
                sampling is not uniform.
        """
        return self.channels if self.table is None else _columns(self.table)


def _columns(table: Table) -> tuple[RecordedChannel, ...]:
    count, width = table.values.shape
    if count < 3:
        raise table.file.error(
            f"{count} rows are no record; give the whole time history", int(table.lines[-1])
        )
    at = _time_column(table)
    seconds = si_factor(table.file, table.units[at] or "s", "time")
    step = uniform_step(table.file, table.values[:, at] * seconds, table.lines, table.title(at))
    return tuple(table.channel(column, step) for column in range(width) if column != at)


def _time_column(table: Table) -> int:
    if table.values.shape[1] == 1:
        raise table.file.error(
            "there is one column only; a record needs a column of times and one of acceleration"
        )
    named = [i for i, name in enumerate(table.names or ()) if TIME_NAME.match(name)]
    if named:
        return named[0]
    # No acceleration grows by the same step from row to row: such a first column is the time.
    try:
        uniform_step(table.file, table.values[:, 0], table.lines, table.title(0))
    except MeasurementError:
        if table.names is None:
            raise
        raise table.file.error(
            f"no column of times among {', '.join(table.names)}; call it time_s"
        ) from None
    return 0
