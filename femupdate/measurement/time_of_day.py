"""Times of a table that are dates or times of day, as seconds since the first row."""

import re

import numpy as np

from femupdate.measurement.cells import Row, cells_of
from femupdate.measurement.columns import TIME

# 2020-01-31 12:00:00.005, also with T and Z, or 12:00:00.005 alone.
_MOMENT = re.compile(
    r"(?P<date>\d{4}[-/]\d\d[-/]\d\d)?[T ]?(?P<time>\d\d:\d\d:\d\d(?:[.,]\d{1,9})?)Z?"
)


def in_seconds(rows: list[Row], delimiter: str | None) -> list[Row]:
    """Rows whose first cells are times in seconds since the first, where all are moments.

    Their column is called `time_s`.

    Args:
        rows: of a table, its header first or not.
        delimiter: of the cells.
    """
    if not _MOMENT.fullmatch(cells_of(rows[-1][1], delimiter)[0]):
        return rows  # as nearly all tables: not a row more need be looked at
    first = [cells_of(text, delimiter)[0] for _, text in rows]
    found = [_MOMENT.fullmatch(cell) for cell in first]
    start = next((k for k, one in enumerate(found) if one), len(rows))
    plain = all(text.strip().startswith(cell) for (_, text), cell in zip(rows, first, strict=True))
    if start == len(rows) or not all(found[start:]) or not plain:
        return rows
    moments = np.array(
        [
            f"{(one['date'] or '2000-01-01').replace('/', '-')}T{one['time'].replace(',', '.')}"
            for one in found[start:]
            if one
        ],
        dtype="datetime64[ns]",
    )
    seconds = (moments - moments[0]) / np.timedelta64(1, "s")
    comma = "," if delimiter != "," else "."
    timed = [
        (line, f"{value:.9f}".replace(".", comma) + text.strip()[len(cell) :])
        for (line, text), cell, value in zip(rows[start:], first[start:], seconds, strict=True)
    ]
    head = [(line, TIME + text.strip()[len(first[0]) :]) for line, text in rows[: min(start, 1)]]
    return [*head, *rows[1:start], *timed]
