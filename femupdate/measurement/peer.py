"""PEER NGA records (AT2): a header with NPTS and DT, then numbers in wrapped rows."""

import re
from pathlib import Path

from femupdate.measurement.recording import RawChannel, positive, wrapped_numbers
from femupdate.measurement.text import TextFile

_HEADER_LINES = 12
_NAMED = re.compile(r"NPTS\s*=\s*(?P<n>[^\s,]+)[\s,]+DT\s*=\s*(?P<dt>[^\s,]+)", re.IGNORECASE)
_TRAILING = re.compile(r"^\s*(?P<n>\d+)[\s,]+(?P<dt>[\d.Ee+-]+)[\s,]+NPTS\s*,\s*DT", re.IGNORECASE)


def is_peer(file: TextFile) -> bool:
    """Return whether a file announces its values as PEER does."""
    head = [line for line in file.lines[:_HEADER_LINES] if not line.lstrip().startswith("#")]
    return any(_NAMED.search(line) or _TRAILING.search(line) for line in head)


def read_peer(file: TextFile) -> tuple[RawChannel, ...]:
    """Read a PEER AT2 file; the unit is what its third line states.

    Raises:
        MeasurementError: NPTS or DT is missing or wrong, the file holds velocity or displacement,
            or another number of values follows than announced.
    """
    at, match = _announcement(file)
    count = positive(file, match["n"], "NPTS", at)
    step = positive(file, match["dt"], "DT", at)
    head = " ".join(file.lines[:at])
    if re.search(r"\b(VELOCITY|DISPLACEMENT)\b", head, re.IGNORECASE):
        raise file.error("this is not an acceleration record; take the .AT2 file beside it")
    unit = re.search(r"UNITS OF\s+([^\s,]+)", head, re.IGNORECASE)
    values = wrapped_numbers(file, at + 1, int(count), at)
    return (RawChannel(_component(file), values, step, unit.group(1) if unit else None),)


def _announcement(file: TextFile) -> tuple[int, re.Match[str]]:
    for index, line in enumerate(file.lines[:_HEADER_LINES]):
        match = _NAMED.search(line) or _TRAILING.search(line)
        if match:
            return index, match
    raise file.error("the header does not give NPTS and DT; restore it or convert to CSV")


def _component(file: TextFile) -> str:
    """Name of the component: the last word of the second line, else the file's name."""
    last = file.lines[1].rpartition(",")[2].strip() if "," in file.lines[1] else ""
    return last or Path(file.path).stem
