"""Headers of records that announce values, and the values that follow, in fixed columns."""

import re
from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats
from femupdate.measurement.text import TextFile

_LINES = 60  # of a header


def header_value(file: TextFile, pattern: str, what: str) -> tuple[int, re.Match[str]]:
    """Return the index and the match of the first header line that fits a pattern."""
    for index, line in enumerate(file.lines[:_LINES]):
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
    check_count(file, len(values), count, announced_at)
    return np.array(values, dtype=np.float64)


def check_count(
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
        width: characters of a column.
        whole: whether they are counts, without a decimal point.
    """

    at: int
    count: int
    per_line: int
    width: int
    channel: str
    whole: bool = False

    @property
    def lines(self) -> range:
        """Indices of the lines that hold them."""
        return range(self.at + 1, self.at + 1 - (-self.count // self.per_line))


def block_values(file: TextFile, block: NumberBlock) -> Floats:
    """Return the numbers of a block."""
    fields: list[str] = []
    for index in block.lines:
        row = file.lines[index].rstrip() if index < len(file.lines) else ""
        row = "" if _END.search(row) else row
        found = _fields(row, block.width)
        found = _by_blanks(row, found, block)
        fields += _checked(file, index, found, block)
        if len(found) < block.per_line:
            break
    check_count(file, len(fields), block.count, block.at, block.channel)
    after = block.lines.stop
    if after < len(file.lines) and _holds_numbers(file.lines[after].rstrip(), block):
        check_count(file, block.count + 1, block.count, block.at, block.channel)
    return np.array(fields, dtype=np.float64)


def _by_blanks(row: str, found: list[str], block: NumberBlock) -> list[str]:
    """Fields of a row; by its blanks where editors or mailers have moved the columns."""
    words = row.split()
    moved = not all(_is_value(field, block.whole) for field in found)
    fits = len(words) <= block.per_line and all(_is_value(word, block.whole) for word in words)
    return words if moved and fits else found


def _fields(row: str, width: int) -> list[str]:
    return [row[start : start + width] for start in range(0, len(row), width)]


def _checked(file: TextFile, index: int, fields: list[str], block: NumberBlock) -> list[str]:
    for position, field in enumerate(fields):
        # A field without its point means that the columns are not where the format says.
        if not _is_value(field, block.whole):
            raise file.error(
                f"{field.strip()!r} is not a number in columns of {block.width} characters, as"
                " the format says; fetch the record again",
                index + 1,
                str(position + 1),
            )
    return fields


def _holds_numbers(row: str, block: NumberBlock) -> bool:
    fields = _fields(row, block.width)
    return bool(fields) and all(_is_value(field, block.whole) for field in fields)


def _is_value(field: str, whole: bool = False) -> bool:
    return (whole or "." in field) and finite(field) is not None
