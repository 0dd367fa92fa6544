"""K-NET and KiK-net ASCII: 17 header lines of one channel, then counts in rows of eight."""

import re
from pathlib import Path

from femupdate.measurement.channel import RecordedChannel
from femupdate.measurement.direction import azimuth_of
from femupdate.measurement.header import header_value, positive, wrapped_numbers
from femupdate.measurement.reader import Reader
from femupdate.measurement.recording import Recording
from femupdate.measurement.text import read_text

_SCALE = r"^Scale Factor\s+([\d.Ee+-]+)\s*\(gal\)\s*/\s*([\d.Ee+-]+)"


def _recognises(head: str, suffix: str) -> bool:
    return any(re.search(_SCALE, line) for line in head.split("\n")[:20])


def _read(path: Path) -> Recording:
    """Acceleration = count times scale factor, gal, the offset included.

    Raises:
        MeasurementError: a header line is missing, or duration times sampling frequency is not
            the number of values that follow.
    """
    file = read_text(path)
    at, rate = header_value(file, r"^Sampling Freq\(Hz\)\s+([^\sH]+)", "Sampling Freq(Hz)")
    frequency = positive(file, rate.group(1), "Sampling Freq(Hz)", at)
    at, lasts = header_value(file, r"^Duration Time\(s\)\s+(\S+)", "Duration Time(s)")
    count = round(positive(file, lasts.group(1), "Duration Time(s)", at) * frequency)
    scale_at, scale = header_value(file, _SCALE, "Scale Factor")
    factor = positive(file, scale.group(1), "Scale Factor", scale_at)
    divisor = positive(file, scale.group(2), "Scale Factor", scale_at)
    _, direction = header_value(file, r"^Dir\.\s+(\S+)", "Dir.")
    memo, _ = header_value(file, r"^Memo\.", "the line 'Memo.' before its data")
    values = wrapped_numbers(file, memo + 1, count, at) * (factor / divisor)
    channel = RecordedChannel(
        name=direction.group(1),
        values=values,
        time_step=1.0 / frequency,
        unit="gal",
        direction=direction.group(1),
        azimuth_deg=azimuth_of(direction.group(1)),
    )
    return Recording(file, (channel,))


READER = Reader("knet", "K-NET and KiK-net ASCII", _recognises, _read)
