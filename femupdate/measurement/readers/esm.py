"""ASCII files of the Engineering Strong-Motion database (ESM, ITACA): KEY: value, then numbers."""

from pathlib import Path

from femupdate.measurement.header import finite, positive, wrapped_numbers
from femupdate.measurement.recording import RecordedChannel, Recording, azimuth_of
from femupdate.measurement.text import TextFile, read_text

READS = "ESM and ITACA ASCII"

_STEP = "SAMPLING_INTERVAL_S"


def recognises(head: str, suffix: str) -> bool:
    return head.startswith("EVENT_NAME:") and f"\n{_STEP}:" in head


def read(path: Path) -> Recording:
    """The one channel; its direction is the last letter of the stream, such as HNE."""
    file = read_text(path)
    start = next((i for i, line in enumerate(file.lines) if _begins_values(line)), 0)
    if not start:
        raise file.error("no value follows the header; fetch the record again")
    header = _header(file, start)
    if header.get("DATA_TYPE", ("ACCELERATION", 0))[0].upper() != "ACCELERATION":
        raise file.error("this is not an acceleration record; take the .ACC file beside it")
    step_text, step_at = _required(file, header, _STEP)
    count_text, count_at = _required(file, header, "NDATA")
    stream, _ = _required(file, header, "STREAM")
    count = int(positive(file, count_text, "NDATA", count_at))
    direction = "Up" if stream[-1:] == "Z" else stream[-1:]
    peak = next((value for key, (value, _) in header.items() if key.startswith("PGA")), "")
    stated = finite(peak)
    channel = RecordedChannel(
        name=stream,
        values=wrapped_numbers(file, start, count, count_at),
        time_step=positive(file, step_text, _STEP, step_at),
        unit=_required(file, header, "UNITS")[0],
        location=header.get("STATION_NAME", ("", 0))[0],
        direction=direction,
        azimuth_deg=azimuth_of(direction),
        stated_peak=None if stated is None else abs(stated),
    )
    return Recording(file, (channel,))


def _begins_values(line: str) -> bool:
    return ":" not in line and bool(line.split()) and finite(line.split()[0]) is not None


def _header(file: TextFile, end: int) -> dict[str, tuple[str, int]]:
    """Value and line index of every key."""
    found = {}
    for index, line in enumerate(file.lines[:end]):
        key, _, value = line.partition(":")
        found[key.strip().upper()] = (value.strip(), index)
    return found


def _required(file: TextFile, header: dict[str, tuple[str, int]], key: str) -> tuple[str, int]:
    value, at = header.get(key, ("", 0))
    if not value:
        raise file.error(f"the header does not give {key}; restore the header or convert to CSV")
    return value, at
