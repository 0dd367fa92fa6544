"""Headers of records that announce values, and the values that follow, in fixed columns."""

import re
from dataclasses import dataclass

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


@dataclass(frozen=True)
class NumberBlock:
    """Where numbers stand and how they are laid out.

    Attributes:
        at: index of the line that announces them; they begin on the next.
        count: how many it announces.
        per_line: of them.
        width: of a column, in characters.
        channel: what messages call them.
        whole: whether they are counts, without a decimal point.
    """

    at: int
    count: int
    per_line: int
    width: int
    channel: str
    whole: bool = False

    def fields(self, row: str) -> list[str]:
        """Fields of a row; by its blanks where editors or mailers have moved the columns."""
        row, words = row.rstrip(), row.split()
        fields = [row[k : k + self.width] for k in range(0, len(row), self.width)]
        moved = not all(map(self.holds, fields))
        return (
            words
            if moved and len(words) <= self.per_line and all(map(self.holds, words))
            else (fields)
        )

    def holds(self, field: str) -> bool:
        """Whether a field is a number: one without its point is not where the format says."""
        return (self.whole or "." in field) and finite(field) is not None


def block_values(file: TextFile, block: NumberBlock) -> Floats:
    """Return the numbers of a block."""
    after = block.at + 1 - (-block.count // block.per_line)
    values: list[str] = []
    for index in range(block.at + 1, after):
        row = file.lines[index] if index < len(file.lines) else ""
        fields = [] if _END.search(row) else block.fields(row)
        for position, field in enumerate(fields, start=1):
            if not block.holds(field):
                raise file.error(
                    f"{field.strip()!r} is not a number in columns of {block.width} characters, as"
                    " the format says; fetch the record again",
                    index + 1,
                    str(position),
                )
        values += fields
        if len(fields) < block.per_line:
            break
    _check_count(file, len(values), block.count, block.at, block.channel)
    row = file.lines[after].rstrip() if after < len(file.lines) else ""
    more = [row[k : k + block.width] for k in range(0, len(row), block.width)]
    if more and all(map(block.holds, more)):
        _check_count(file, block.count + 1, block.count, block.at, block.channel)
    return np.array(values, dtype=np.float64)
