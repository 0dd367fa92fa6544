"""SMC files of the USGS: eleven lines of text, six of integers, ten of numbers, then comments.

After the description in USGS Open-File Report 98-206: cm and s, eight numbers of ten characters to
a line; the first line says whether they are accelerations, velocities or displacements.
"""

import re
from pathlib import Path

from femupdate.measurement.recording import RecordedChannel, Recording
from femupdate.measurement.text import TextFile, finite, fixed_columns, positive, read_text

READS = "SMC files of the USGS"

_FIRST = re.compile(
    r"^\s*\d?\s*(UN)?CORRECTED ACCELEROGRAM\s*$|^\s*\d\s*(CORRECTED )?(VELOCITY|DISPLACEMENT)"
)
_QUANTITIES = {
    "ACCELEROGRAM": ("acceleration", "cm/s2"),
    "VELOCITY": ("velocity", "cm/s"),
    "DISPLACEMENT": ("displacement", "cm"),
}
_TEXT_LINES, _INTEGER_LINES, _REAL_LINES = 11, 6, 10
_INTEGER_WIDTH, _REAL_WIDTH = 10, 15
_COUNT, _COMMENTS, _AZIMUTH, _TILT, _SAMPLING = 16, 15, 13, 12, 1  # positions in the headers


def recognises(head: str, suffix: str) -> bool:
    lines = head.split("\n")
    starred = len(lines) > _TEXT_LINES and lines[1].strip() == "*" == lines[10].strip()
    return starred and _FIRST.match(lines[0].upper()) is not None


def read(path: Path) -> Recording:
    """The one channel, with its place from the comment `<loclbl=>`."""
    file = read_text(path)
    quantity, unit = next(
        each for word, each in _QUANTITIES.items() if word in file.lines[0].upper()
    )
    integers = _numbers(file, _TEXT_LINES, _INTEGER_LINES, _INTEGER_WIDTH)
    reals = _numbers(file, _TEXT_LINES + _INTEGER_LINES, _REAL_LINES, _REAL_WIDTH)
    count = positive(file, integers[_COUNT], "the number of values", _TEXT_LINES + 2)
    rate = positive(file, reals[_SAMPLING], "the sampling rate", _TEXT_LINES + _INTEGER_LINES)
    # What is not known is written as 1.7e38.
    if rate > 1e38:
        raise file.error(
            "there is no sampling rate: these are raw pairs of times and values as they were"
            " digitised; take the corrected accelerogram (volume 2)"
        )
    comments = int(finite(integers[_COMMENTS]) or 0)
    start = _TEXT_LINES + _INTEGER_LINES + _REAL_LINES + comments
    values = fixed_columns(file, start - 1, int(count), (8, 10), "")
    head = "\n".join(file.lines[:start])
    tilt, azimuth = finite(integers[_TILT]), finite(integers[_AZIMUTH])
    vertical = tilt is not None and tilt in (0.0, 180.0)
    if azimuth is not None and not 0.0 <= azimuth <= 360.0:  # unknown ones are -32768
        azimuth = None
    direction = "Up" if vertical else f"{azimuth:.0f} Deg" if azimuth is not None else ""
    location = _found(r"<loclbl=>\s*(.*?)\s*(?:<end>|$)", head)
    location = location or _found(r"^station =\s*(.*?)\s*(?:component=|$)", head)
    name = _found(r"component=\s*(\S+)", head) or direction or path.stem
    peak = finite(_found(r"pk acc\s*=\s*(\S+)", head)) if quantity == "acceleration" else None
    channel = RecordedChannel(
        name=f"{name}, {location}" if location else name,
        values=values,
        time_step=1.0 / rate,
        unit=unit,
        quantity=quantity,
        location=location,
        direction=direction,
        azimuth_deg=None if vertical or azimuth is None else azimuth % 360.0,
        stated_peak=None if peak is None else abs(peak),
    )
    return Recording(file, (channel,))


def _numbers(file: TextFile, start: int, lines: int, width: int) -> list[str]:
    """Fields of the header lines from index `start` on."""
    rows = [line.rstrip() for line in file.lines[start : start + lines]]
    per_line = len(rows[0]) // width if rows else 0
    fields = [row[k : k + width].strip() for row in rows for k in range(0, len(row), width)]
    if not per_line or len(fields) != lines * per_line or None in map(finite, fields):
        raise file.error(
            f"the header's {lines} lines of numbers are not whole; fetch the record again",
            start + 1,
        )
    return fields


def _found(pattern: str, text: str) -> str:
    match = re.search(pattern, text, re.IGNORECASE | re.MULTILINE)
    return match.group(1) if match else ""
