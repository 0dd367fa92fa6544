"""Plain tables of a record: a column of times and one or several of acceleration."""

import re

from femupdate.errors import MeasurementError
from femupdate.measurement.quantity import si_factor
from femupdate.measurement.recording import RawChannel
from femupdate.measurement.sampling import uniform_step
from femupdate.measurement.table import Table, cells_of, find_delimiter, is_number, read_table
from femupdate.measurement.text import TextFile

_TIME = re.compile(r"^(t|time)([_ .].*)?$|^sec(ond)?s?$|^時[刻間]", re.IGNORECASE)
_LOOKED_AT = 50


def is_plain(file: TextFile) -> bool:
    """Return whether a file begins like a table: with a column of times or rows of numbers."""
    heads = [cells_of(text, find_delimiter(text)) for _, text in file.rows()[:_LOOKED_AT]]
    return bool(_TIME.match(heads[0][0])) or any(all(map(is_number, cells)) for cells in heads)


def read_plain(file: TextFile) -> tuple[RawChannel, ...]:
    """Read a table with a column of times; every other column is a channel.

    Raises:
        MeasurementError: there is no column of times, fewer than three rows, or the sampling is
            not uniform.
    """
    table = read_table(file)
    count, width = table.values.shape
    if count < 3:
        raise file.error(
            f"{count} rows are no record; give the whole time history", int(table.lines[-1])
        )
    at = _time_column(table)
    time_unit = table.units[at] or "s"
    time = table.values[:, at] * si_factor(file, time_unit, "time")
    step = uniform_step(file, time, table.lines, table.title(at))
    names = table.names or tuple(str(column) for column in range(width))
    return tuple(
        RawChannel(names[column], table.values[:, column], step, table.units[column])
        for column in range(width)
        if column != at
    )


def _time_column(table: Table) -> int:
    named = [i for i, name in enumerate(table.names or ()) if _TIME.match(name)]
    width = table.values.shape[1]
    if width == 1:
        raise table.file.error(
            "there is one column only; a record needs a column of times and one of acceleration"
        )
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
