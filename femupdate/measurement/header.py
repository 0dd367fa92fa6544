"""Headers of records that announce values, and the values that follow, in fixed columns."""

import re

import numpy as np

from femupdate.arrays import Floats
from femupdate.measurement.text import TextFile


def header_value(file: TextFile, pattern: str, what: str) -> tuple[int, re.Match[str]]:
    """Return the index and the match of the first of the 60 header lines that fits a pattern."""
    for index, line in enumerate(file.lines[:60]):
        match = re.search(pattern, line, re.IGNORECASE)
        if match:
            return index, match
    raise file.error(f"the header does not give {what}; restore the header or convert to CSV")


def positive(file: TextFile, text: str, what: str, line: int) -> float:
    """Return a header number, of the line with that index, that must be finite and above zero."""
    value = finite(text)
    if value is None or value <= 0:
        raise file.error(f"{what} is {text!r}; it must be a number above zero", line + 1)
    return value


def finite(text: str) -> float | None:
    """Return the finite number that a text is, or None."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if np.isfinite(value) else None


def wrapped_numbers(file: TextFile, start: int, count: int, announced_at: int) -> Floats:
    """Return the numbers that fill the lines from index `start` to the end, row by row."""
    values: list[float] = []
    for index, line in enumerate(file.lines[start:], start=start):
        # Full columns of fixed-width output touch where a number is negative: 0.12E-01-0.34E-01.
        for word in re.sub(r"(?<=[\d.])(?=[-+])", " ", line).split():
            value = finite(word)
            if value is None:
                raise file.error(
                    f"{word!r} is not a number; fetch the record again or correct the value",
                    index + 1,
                )
            values.append(value)
    _check_count(file, len(values), count, announced_at)
    return np.array(values, dtype=np.float64)


def _check_count(
    file: TextFile, found: int, announced: int, announced_at: int, channel: str = ""
) -> None:
    """Refuse a file that holds fewer or more values than it announces."""
    if found == announced:
        return
    where = f" in channel {channel}" if channel else ""
    reason = "is cut off" if found < announced else "holds something else"
    raise file.error(
        f"the header announces {announced} values{where} but {found} follow: the file {reason};"
        " fetch it again or correct the header",
        announced_at + 1,
    )


_END = re.compile(r"^/&|^End-of-data|points of (accel|veloc|displ) data", re.IGNORECASE)


def fixed_columns(
    file: TextFile, at: int, count: int, layout: tuple[int, int], channel: str, whole: bool = False
) -> Floats:
    """Return numbers in columns of one width.

    Args:
        at: index of the line that announces them; they begin on the next.
        count: how many it announces.
        layout: numbers in a line, and characters of each.
        channel: what messages call them.
        whole: whether they are counts, without a decimal point.
    """
    per_line, width = layout

    def numbers(fields: list[str]) -> bool:
        """Whether all are numbers: one without its point is not where the format says."""
        return all((whole or "." in text) and finite(text) is not None for text in fields)

    after = at + 1 - (-count // per_line)
    values: list[str] = []
    for index in range(at + 1, after):
        row = file.lines[index].rstrip() if index < len(file.lines) else ""
        fields = [row[k : k + width] for k in range(0, len(row), width)]
        if _END.search(row):
            fields = []
        elif not numbers(fields):  # editors or mailers may have moved the columns
            words = row.split()
            fields = words if len(words) <= per_line and numbers(words) else fields
        for position, field in enumerate(fields, start=1):
            if not numbers([field]):
                raise file.error(
                    f"{field.strip()!r} is not a number in columns of {width} characters, as"
                    " the format says; fetch the record again",
                    index + 1,
                    str(position),
                )
        values += fields
        if len(fields) < per_line:
            break
    _check_count(file, len(values), count, at, channel)
    row = file.lines[after].rstrip() if after < len(file.lines) else ""
    more = [row[k : k + width] for k in range(0, len(row), width)]
    if more and numbers(more):
        _check_count(file, count + 1, count, at, channel)
    return np.array(values, dtype=np.float64)
