"""K-NET and KiK-net ASCII: 17 header lines of one channel, then counts in rows of eight."""

import re
from pathlib import Path

from femupdate.measurement.recording import RecordedChannel, Recording, azimuth_of
from femupdate.measurement.text import finite, header_value, positive, read_text, wrapped_numbers

READS = "K-NET and KiK-net ASCII"

# KiK-net numbers its six channels: the sensor in the borehole first, then that on the ground.
_KIKNET = {
    str(k + 3 * number): (along, place)
    for number, place in enumerate(("borehole", "ground surface"))
    for k, along in enumerate(("N-S", "E-W", "U-D"), start=1)
}
_SCALE = r"^Scale Factor\s+([\d.Ee+-]+)\s*\(gal\)\s*/\s*([\d.Ee+-]+)"


def recognises(head: str, suffix: str) -> bool:
    return any(re.match(r"Scale Factor.*gal|Duration Time\(s\)", x) for x in head.split("\n")[:20])


def read(path: Path) -> Recording:
    """Acceleration = count times scale factor, gal, the offset included."""
    file = read_text(path)
    at, rate = header_value(file, r"^Sampling Freq\(Hz\)\s+([^\sH]+)", "Sampling Freq(Hz)")
    frequency = positive(file, rate.group(1), "Sampling Freq(Hz)", at)
    at, lasts = header_value(file, r"^Duration Time\(s\)\s+(\S+)", "Duration Time(s)")
    count = round(positive(file, lasts.group(1), "Duration Time(s)", at) * frequency)
    scale_at, scale = header_value(file, _SCALE, "Scale Factor")
    factor = positive(file, scale.group(1), "Scale Factor", scale_at)
    divisor = positive(file, scale.group(2), "Scale Factor", scale_at)
    _, direction = header_value(file, r"^Dir\.\s+(\S+)", "Dir.")
    stated = re.search(r"^Max\. Acc\. \(gal\)\s+(\S+)", "\n".join(file.lines[:20]), re.MULTILINE)
    memo, _ = header_value(file, r"^Memo\.", "the line 'Memo.' before its data")
    values = wrapped_numbers(file, memo + 1, count, at) * (factor / divisor)
    along, place = _KIKNET.get(direction.group(1), (direction.group(1), ""))
    channel = RecordedChannel(
        name=f"{along}, {place}" if place else along,
        values=values,
        time_step=1.0 / frequency,
        unit="gal",
        location=place,
        direction=along,
        azimuth_deg=azimuth_of(along),
        stated_peak=finite(stated[1]) if stated else None,
    )
    return Recording(file, (channel,))
