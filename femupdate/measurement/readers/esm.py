"""ASCII files of the Engineering Strong-Motion database (ESM, ITACA): KEY: value, then numbers."""

from pathlib import Path

from femupdate.measurement.recording import RecordedChannel, Recording, azimuth_of
from femupdate.measurement.text import finite, positive, read_text, wrapped_numbers

READS = "ESM and ITACA ASCII"

_STEP = "SAMPLING_INTERVAL_S"


def recognises(head: str, suffix: str) -> bool:
    return head.startswith("EVENT_NAME:") and f"\n{_STEP}:" in head


def read(path: Path) -> Recording:
    """The one channel; its direction is the last letter of the stream, such as HNE."""
    file = read_text(path)
    header: dict[str, tuple[str, int]] = {}
    start = 0
    for start, line in enumerate(file.lines):
        if ":" not in line and line.split() and finite(line.split()[0]) is not None:
            break
        key, _, value = line.partition(":")
        header[key.strip().upper()] = (value.strip(), start)
    else:
        start = 0
    if not start:
        raise file.error("no value follows the header; fetch the record again")
    if header.get("DATA_TYPE", ("ACCELERATION", 0))[0].upper() != "ACCELERATION":
        raise file.error("this is not an acceleration record; take the .ACC file beside it")
    missing = [k for k in (_STEP, "NDATA", "STREAM", "UNITS") if not header.get(k, ("", 0))[0]]
    if missing:
        raise file.error(
            f"the header does not give {missing[0]}; restore the header or convert to CSV"
        )
    (step, step_at), (count, count_at) = header[_STEP], header["NDATA"]
    stream = header["STREAM"][0]
    direction = "Up" if stream[-1:] == "Z" else stream[-1:]
    peak = next((value for key, (value, _) in header.items() if key.startswith("PGA")), "")
    stated = finite(peak)
    channel = RecordedChannel(
        name=stream,
        values=wrapped_numbers(
            file, start, int(positive(file, count, "NDATA", count_at)), count_at
        ),
        time_step=positive(file, step, _STEP, step_at),
        unit=header["UNITS"][0],
        location=header.get("STATION_NAME", ("", 0))[0],
        direction=direction,
        azimuth_deg=azimuth_of(direction),
        stated_peak=None if stated is None else abs(stated),
    )
    return Recording(file, (channel,))
