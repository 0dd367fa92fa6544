"""PEER NGA records (AT2): a header with NPTS and DT, then numbers in wrapped rows."""

import re
from collections.abc import Sequence
from pathlib import Path

from femupdate.measurement.recording import RecordedChannel, Recording
from femupdate.measurement.text import positive, read_text, wrapped_numbers

READS = "PEER NGA records (AT2)"

_ANNOUNCED = re.compile(
    r"^(?!\s*#).*?(?:NPTS\s*=\s*(?P<n>[^\s,]+)[\s,]+DT\s*=\s*(?P<dt>[^\s,]+)"
    r"|^\s*(?P<count>\d+)[\s,]+(?P<step>[\d.Ee+-]+)[\s,]+NPTS\s*,\s*DT)",
    re.IGNORECASE,
)


def _announcement(lines: Sequence[str]) -> tuple[int, re.Match[str]] | None:
    matches = ((index, _ANNOUNCED.match(line)) for index, line in enumerate(lines[:12]))
    return next(((index, match) for index, match in matches if match), None)


def recognises(head: str, suffix: str) -> bool:
    return _announcement(head.split("\n")) is not None


def read(path: Path) -> Recording:
    """The one channel; its unit is what the third line states."""
    file = read_text(path)
    found = _announcement(file.lines)
    if found is None:
        raise file.error("the header does not give NPTS and DT; restore it or convert to CSV")
    at, match = found
    count = positive(file, match["n"] or match["count"], "NPTS", at)
    step = positive(file, match["dt"] or match["step"], "DT", at)
    head = " ".join(file.lines[:at])
    if re.search(r"\b(VELOCITY|DISPLACEMENT)\b", head, re.IGNORECASE):
        raise file.error("this is not an acceleration record; take the .AT2 file beside it")
    unit = re.search(r"UNITS OF\s+([^\s,]+)", head, re.IGNORECASE)
    # The last word of the second line names the component.
    _, comma, last = (*file.lines, "", "")[1].rpartition(",")
    channel = RecordedChannel(
        name=(last.strip() if comma else "") or path.stem,
        values=wrapped_numbers(file, at + 1, int(count), at),
        time_step=step,
        unit=unit.group(1) if unit else None,
    )
    return Recording(file, (channel,))
