"""Measured files as text: decoding, headers, numbers, and errors that say where."""

import codecs
import importlib
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femupdate.errors import MeasurementError, close
from femupdate.storage import read_file

if TYPE_CHECKING:  # commands read heads of files before anything heavy is imported
    from femupdate.arrays import Floats

_UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")
_ZIP_MARK = b"PK\x03\x04"
# JMA writes station names in Shift-JIS; latin-1 accepts every byte and comes last.
_CONTROLS = bytes(range(0x80, 0xA0))
_ENCODINGS = ("utf-8-sig", "cp932", "latin-1")


@dataclass(frozen=True)
class TextFile:
    """The lines of a text file, numbered from 1 in messages.

    Attributes:
        lines: (n,) its lines without their ends; none of a file that is not text.
        row_name: what messages call a line of it.
    """

    path: Path
    lines: tuple[str, ...] = ()
    row_name: str = "line"

    def error(
        self, message: str, line: int | None = None, column: str | None = None
    ) -> MeasurementError:
        """Return the error with the file's name, line and column in front of the message."""
        where = str(self.path)
        if line is not None:
            where += f", {self.row_name} {line}"
        if column is not None:
            where += f", column {column}"
        return MeasurementError(f"{where}: {message}")

    def rows(self) -> list[tuple[int, str]]:
        """Return (line number, text) of the lines that are neither blank nor comments (#, %)."""
        numbered = enumerate(self.lines, start=1)
        return [(n, line) for n, line in numbered if (s := line.strip()) and s[0] not in "#%"]


def reading_package(file: TextFile, module: str, package: str, what: str) -> Any:
    """The module of an optional package that reads a format.

    Args:
        what: files of the format, for the message.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        raise file.error(
            f"{what} are read by {package}, which is not installed; install it with"
            " pip install 'femupdate[formats]'"
        ) from None


def read_text(path: str | Path) -> TextFile:
    """Read a text file in UTF-8 (with or without mark), UTF-16 with mark, or Shift-JIS."""
    return text_of(Path(path), read_bytes(path))


def text_of(path: Path, data: bytes) -> TextFile:
    """Return the text in the bytes of a file, or of a member of an archive."""
    if data.startswith(_ZIP_MARK):
        raise MeasurementError(
            f"{path}: this is a workbook or an archive, not text; export it as CSV or unpack it"
        )
    if b"\0" in data and not data.startswith(_UTF16_MARKS):
        raise MeasurementError(f"{path}: this is not a text file; export the record as text")
    file = TextFile(path, tuple(_lines(_decode(data))))
    if not file.rows():
        raise file.error("the file holds no data; write it again from its source")
    return file


def read_head(path: str | Path) -> str:
    """Return the beginning of a file as text, with line ends as \\n; binary ones as latin-1."""
    limit = 65536
    data = read_bytes(path, limit)
    if b"\0" in data and not data.startswith(_UTF16_MARKS):
        return data.decode("latin-1")
    return "\n".join(_lines(_decode(data, whole=len(data) < limit)))


def closest(name: str, known: Iterable[str]) -> str:
    """Return " (did you mean 'x'?)" for the known name nearest to `name`, or an empty string."""
    hint = close(name, known)
    return f" ({hint[2:]})" if hint else ""


def read_bytes(path: str | Path, limit: int = -1) -> bytes:
    """Return the bytes of a file, at most `limit` of them."""
    # 300 MB of text make a table of some three times that in memory.
    data = read_file(path, 300 * 1_000_000, MeasurementError, limit)
    if not data.strip():
        raise MeasurementError(f"{path}: the file is empty; write it again from its source")
    return data


def _lines(text: str) -> list[str]:
    # str.splitlines would also split at form feeds and other marks inside old headers.
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _decode(data: bytes, whole: bool = True) -> str:
    """Text of bytes; the last character may be cut where they are not the whole file."""
    if data.startswith(_UTF16_MARKS):
        return data.decode("utf-16", errors="replace")
    # Japanese text has bytes that are control characters, which no text has, in Latin-1.
    japanese = len(data.translate(None, _CONTROLS)) < len(data)
    for encoding in _ENCODINGS:
        if encoding == "cp932" and not japanese:
            continue
        try:
            return codecs.getincrementaldecoder(encoding)().decode(data, whole)
        except UnicodeDecodeError:
            continue
    raise AssertionError("latin-1 decodes every byte")


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
    return value if math.isfinite(value) else None


def wrapped_numbers(file: TextFile, start: int, count: int, announced_at: int) -> "Floats":
    """Return the numbers that fill the lines from index `start` to the end, row by row."""
    import numpy as np

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
) -> "Floats":
    """Return numbers in columns of one width.

    Args:
        at: index of the line that announces them; they begin on the next.
        count: how many it announces.
        layout: numbers in a line, and characters of each.
        channel: what messages call them.
        whole: whether they are counts, without a decimal point.
    """
    import numpy as np

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
