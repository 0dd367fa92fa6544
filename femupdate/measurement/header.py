"""Headers of records that announce values, and the values that follow."""

import re

import numpy as np

from femupdate.arrays import Floats
from femupdate.measurement.text import TextFile

_LINES = 60  # of a header


def header_value(file: TextFile, pattern: str, what: str) -> tuple[int, re.Match[str]]:
    """Return the index and the match of the first header line that fits a pattern.

    Raises:
        MeasurementError: no line does; `what` names what is missing.
    """
    for index, line in enumerate(file.lines[:_LINES]):
        match = re.search(pattern, line, re.IGNORECASE)
        if match:
            return index, match
    raise file.error(f"the header does not give {what}; restore the header or convert to CSV")


def positive(file: TextFile, text: str, what: str, line: int) -> float:
    """Return a header number, of the line with that index, that must be finite and above zero.

    Raises:
        MeasurementError: it is not.
    """
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
    """Return the numbers that fill the lines from index `start` to the end, row by row.

    Args:
        file: the record.
        start: index of the first line of numbers.
        count: how many the header announces.
        announced_at: index of the line that announces them.

    Raises:
        MeasurementError: a word is not a finite number, or there are fewer or more of them.
    """
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
    check_count(file, len(values), count, announced_at)
    return np.array(values, dtype=np.float64)


def check_count(
    file: TextFile, found: int, announced: int, announced_at: int, channel: str = ""
) -> None:
    """Refuse a file that holds fewer or more values than it announces.

    Raises:
        MeasurementError: the numbers differ.
    """
    if found == announced:
        return
    where = f" in channel {channel}" if channel else ""
    reason = "is cut off" if found < announced else "holds something else"
    raise file.error(
        f"the header announces {announced} values{where} but {found} follow: the file {reason};"
        " fetch it again or correct the header",
        announced_at + 1,
    )
