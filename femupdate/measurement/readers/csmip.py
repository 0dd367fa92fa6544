"""CSMIP/CESMD Volumes 1 and 2: several channels in one file, numbers in fixed-width columns.

Volume 1 (uncorrected) and the acceleration blocks of Volume 2 (corrected) are read; velocity and
displacement blocks are passed over.
"""

import re
from collections.abc import Iterator
from pathlib import Path

from femupdate.measurement.recording import RecordedChannel, Recording, azimuth_of
from femupdate.measurement.text import TextFile, fixed_columns, positive, read_text

READS = "CSMIP/CESMD Volumes 1 and 2"

_ANNOUNCED = [
    re.compile(pattern, re.IGNORECASE)
    for pattern in (
        # 31932 Accelerogram points at 100 pts/sec in units of g.  Format: (8f9.6)
        r"^\s*(?P<n>\d+)\s+accelerogram points at\s+(?P<rate>[\d.]+)\s*pts/sec(?P<rest>.*)",
        # 7500 points of accel data equally spaced at  .010 sec, in cm/sec2. (8f10.6)
        # 2000 POINTS OF ACCEL DATA EQUALLY SPACED AT  .020 SEC.  (UNITS: CM/SEC/SEC)
        r"^\s*(?P<n>\d+)\s+points of accel data equally spaced at\s+(?P<step>[\d.]+)\s*sec"
        r"(?P<rest>.*)",
    )
]
_FORMAT = re.compile(r"\((?:1p)?(?P<per>\d+)\s*\(?[fegd](?P<width>\d+)\.\d+", re.IGNORECASE)
_UNIT = re.compile(
    r"\b(?:in\s+units\s+of|units:|in)\s+(?P<unit>[^:()]+?)[\s.]*(?:\(|\)|Format|$)", re.I
)
_CHANNEL = re.compile(r"^Chan\s+(\d+):\s*(.*?)\s*(?:\(.*?\)\s*)?(?:Location:\s*(.*))?$", re.I)
_PEAK = re.compile(
    r"^Peak acceleration\s*=\s*(?P<cm>[-\d.]+)\s*cm/sec/sec"
    r"|^Units of uncor data.*\bMax\s*=\s*(?P<g>[-\d.]+)\s*g",
    re.IGNORECASE,
)
_MENTIONED = re.compile(r"accelerogram points|points of accel data", re.IGNORECASE)
_RAW = re.compile(r"^\s*uncorrected accelerogram data", re.IGNORECASE)
_PER_LINE = "8"  # values in a line of files that do not state their format


def recognises(head: str, suffix: str) -> bool:
    lines = head.split("\n")[:200]
    told = any(_MENTIONED.search(line) for line in lines if not line.startswith("#"))
    return told or _RAW.match(head) is not None


def read(path: Path) -> Recording:
    """Accelerations of all channels, by the column widths that the file states."""
    file = read_text(path)
    channels = tuple(_channels(file))
    if not channels and not any(_MENTIONED.search(line) for line in file.lines):
        raise file.error(
            "these are raw pairs of times and values as they were digitised; take the .V1 or .V2"
            " file beside it"
        )
    if not channels:
        at = next((i for i, line in enumerate(file.lines) if _MENTIONED.search(line)), 0)
        raise file.error(
            "the line that announces the values lacks their number or sampling; convert the record"
            " to CSV",
            at + 1,
        )
    return Recording(file, channels)


def _channels(file: TextFile) -> Iterator[RecordedChannel]:
    """What every header says; lines further down amend it."""
    name, direction, location, peak, unit = "", "", "", None, None
    count = 0
    for at, line in enumerate(file.lines):
        if channel := _CHANNEL.match(line):
            direction, location = (" ".join((text or "").split()) for text in channel.group(2, 3))
            name = direction or f"channel {channel.group(1)}"
            name = f"{name}, {location}" if location else name
            peak, unit = None, None
        elif stated := _PEAK.match(line):
            unit = "cm/s2" if stated["cm"] else "g"
            peak = abs(float(stated["cm"] or stated["g"]))
        elif announced := next((m for p in _ANNOUNCED if (m := p.match(line))), None):
            count += 1
            title = name or f"channel {count}"
            rest = announced["rest"]
            written, layout = _UNIT.search(rest), _FORMAT.search(rest)
            if announced.groupdict().get("rate"):
                step = 1.0 / positive(file, announced["rate"], "the sampling rate", at)
            else:
                step = positive(file, announced["step"], "the time step", at)
            # Files that do not state it have a first line of values that is full.
            first = file.lines[at + 1].rstrip() if at + 1 < len(file.lines) else ""
            per_line = layout["per"] if layout else _PER_LINE
            width = layout["width"] if layout else str(round(len(first) / int(_PER_LINE)))
            per = int(positive(file, per_line, "the number of values in a line", at))
            wide = int(positive(file, width, "the column width", at))
            yield RecordedChannel(
                name=title,
                values=fixed_columns(file, at, int(announced["n"]), (per, wide), title),
                time_step=step,
                unit=written["unit"].strip() if written else unit if name else None,
                location=location,
                direction=direction,
                azimuth_deg=azimuth_of(direction),
                stated_peak=peak if name else None,
            )
