"""CSMIP/CESMD Volumes 1 and 2: several channels in one file, numbers in fixed-width columns.

Volume 1 (uncorrected) and the acceleration blocks of Volume 2 (corrected) are read; velocity and
displacement blocks are passed over.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.measurement.channel import RecordedChannel
from femupdate.measurement.header import check_count, finite, positive
from femupdate.measurement.reader import Reader
from femupdate.measurement.recording import Recording
from femupdate.measurement.text import TextFile, read_text

# "31932 Accelerogram points at 100 pts/sec in units of g.  Format: (8f9.6)"
_VOLUME_1 = re.compile(
    r"^\s*(?P<n>\d+)\s+accelerogram points at\s+(?P<rate>[\d.]+)\s*pts/sec,?\s*in units of\s+"
    r"(?P<unit>[^:]+?)\s*\.?\s*Format:\s*\((?P<per>\d+)[fe](?P<width>\d+)\.\d+\)",
    re.IGNORECASE,
)
# "7500 points of accel data equally spaced at  .010 sec, in cm/sec2. (8f10.6)"
_VOLUME_2 = re.compile(
    r"^\s*(?P<n>\d+)\s+points of accel data equally spaced at\s+(?P<step>[\d.]+)\s*sec,?\s*in\s+"
    r"(?P<unit>[^:]+?)\s*\.?\s*\((?P<per>\d+)[fe](?P<width>\d+)\.\d+\)",
    re.IGNORECASE,
)
_CHANNEL = re.compile(r"^Chan\s+(\d+):\s*(.*)$", re.IGNORECASE)
_MENTIONED = re.compile(r"accelerogram points|points of accel data", re.IGNORECASE)

_END = re.compile(r"^/&|points of (accel|veloc|displ) data", re.IGNORECASE)
_HEADER_LINES = 200


@dataclass(frozen=True)
class _Block:
    """Where a channel's numbers stand and how they are laid out."""

    at: int  # index of the line that announces them
    name: str
    count: int
    time_step: float
    unit: str
    per_line: int
    width: int

    @property
    def lines(self) -> range:
        return range(self.at + 1, self.at + 1 - (-self.count // self.per_line))


def _recognises(head: str, suffix: str) -> bool:
    lines = head.split("\n")[:_HEADER_LINES]
    return any(_MENTIONED.search(line) for line in lines if not line.startswith("#"))


def _read(path: Path) -> Recording:
    """Accelerations of all channels, by the column widths that the file states.

    Raises:
        MeasurementError: a layout is not understood, a channel holds fewer or more values than
            announced, or a field is not a number.
    """
    file = read_text(path)
    blocks = _blocks(file)
    if not blocks:
        at = next((i for i, line in enumerate(file.lines) if _MENTIONED.search(line)), 0)
        raise file.error(
            "the line that announces the values lacks their number, sampling, unit or format"
            " such as (8f9.6); convert the record to CSV",
            at + 1,
        )
    return Recording(
        file,
        tuple(
            RecordedChannel(
                name=block.name,
                values=_values(file, block),
                time_step=block.time_step,
                unit=block.unit,
            )
            for block in blocks
        ),
    )


def _blocks(file: TextFile) -> list[_Block]:
    blocks: list[_Block] = []
    name = ""
    for index, line in enumerate(file.lines):
        channel = _CHANNEL.match(line)
        if channel:
            name = _channel_name(channel)
        match = _VOLUME_1.match(line) or _VOLUME_2.match(line)
        if match:
            blocks.append(_block(file, index, match, name or f"channel {len(blocks) + 1}"))
    return blocks


def _block(file: TextFile, at: int, match: re.Match[str], name: str) -> _Block:
    found = match.groupdict()
    if found.get("rate"):
        step = 1.0 / positive(file, found["rate"], "the sampling rate", at)
    else:
        step = positive(file, found["step"], "the time step", at)
    per_line = int(positive(file, found["per"], "the number of values in a line", at))
    width = int(positive(file, found["width"], "the column width", at))
    return _Block(at, name, int(found["n"]), step, found["unit"], per_line, width)


def _channel_name(match: re.Match[str]) -> str:
    """`90 Deg`, with the sensor's place behind it where the file gives one."""
    head, _, place = match.group(2).partition("Location:")
    name = " ".join(head.partition("(")[0].split()) or f"channel {match.group(1)}"
    return f"{name}, {' '.join(place.split())}" if place.strip() else name


def _values(file: TextFile, block: _Block) -> Floats:
    fields: list[str] = []
    for index in block.lines:
        row = file.lines[index].rstrip() if index < len(file.lines) else ""
        row = "" if _END.search(row) else row
        starts = range(0, len(row), block.width)
        fields += _checked(file, index, [row[s : s + block.width] for s in starts], block)
        if len(starts) < block.per_line:
            break
    check_count(file, len(fields), block.count, block.at, block.name)
    after = block.lines.stop
    if after < len(file.lines) and _holds_numbers(file.lines[after], block.width):
        check_count(file, block.count + 1, block.count, block.at, block.name)
    return np.array(fields, dtype=np.float64)


def _checked(file: TextFile, index: int, fields: list[str], block: _Block) -> list[str]:
    """Return the fields of a row when each is a finite number with its decimal point."""
    for position, field in enumerate(fields):
        # A field without its point means that the columns are not where the format says.
        if "." not in field or finite(field) is None:
            raise file.error(
                f"{field.strip()!r} is not a number in columns of {block.width} characters, as"
                " the format says; fetch the record again",
                index + 1,
                str(position + 1),
            )
    return fields


def _holds_numbers(line: str, width: int) -> bool:
    row = line.rstrip()
    fields = [row[s : s + width] for s in range(0, len(row), width)]
    return bool(fields) and all("." in field and finite(field) is not None for field in fields)


READER = Reader("csmip", "CSMIP/CESMD Volumes 1 and 2", _recognises, _read)
