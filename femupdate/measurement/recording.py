"""What every record format delivers, and what several of them share."""

import re
from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats
from femupdate.measurement.text import TextFile


@dataclass(frozen=True, eq=False)
class RawChannel:
    """One channel of a record as the file gives it.

    Attributes:
        name: the file's name for it.
        values: (n,) acceleration in `unit`.
        time_step: s.
        unit: the unit that the file states, or None.
    """

    name: str
    values: Floats
    time_step: float
    unit: str | None


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
    # Full columns of fixed-width output touch where a number is negative: 0.12E-01-0.34E-01.
    text = re.sub(r"(?<=[\d.])(?=[-+])", " ", " ".join(file.lines[start:]))
    try:
        values = np.array(text.split(), dtype=np.float64)
    except ValueError:
        values = np.array([np.nan])
    if not np.isfinite(values).all():
        _blame_word(file, start)
    check_count(file, values.size, count, announced_at)
    return values


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


def header_value(
    file: TextFile, pattern: str, what: str, lines: int = 60
) -> tuple[int, re.Match[str]]:
    """Return the index and the match of the first header line that fits a pattern.

    Raises:
        MeasurementError: no line does; `what` names what is missing.
    """
    for index, line in enumerate(file.lines[:lines]):
        match = re.search(pattern, line, re.IGNORECASE)
        if match:
            return index, match
    raise file.error(f"the header does not give {what}; restore the header or convert to CSV")


def positive(file: TextFile, text: str, what: str, line: int) -> float:
    """Return a header number that must be finite and greater than zero.

    Raises:
        MeasurementError: it is not.
    """
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not (np.isfinite(value) and value > 0):
        raise file.error(f"{what} is {text!r}; it must be a number above zero", line + 1)
    return value


def _blame_word(file: TextFile, start: int) -> None:
    for index, line in enumerate(file.lines[start:], start=start):
        for word in re.sub(r"(?<=[\d.])(?=[-+])", " ", line).split():
            try:
                bad = not np.isfinite(float(word))
            except ValueError:
                bad = True
            if bad:
                raise file.error(
                    f"{word!r} is not a number; fetch the record again or correct the value",
                    index + 1,
                )
