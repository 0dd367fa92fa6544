"""K-NET and KiK-net ASCII: 17 header lines of one channel, then counts in rows of eight."""

import re

from femupdate.measurement.recording import RawChannel, header_value, positive, wrapped_numbers
from femupdate.measurement.text import TextFile

_SCALE = r"^Scale Factor\s+([\d.Ee+-]+)\s*\(gal\)\s*/\s*([\d.Ee+-]+)"


def is_knet(file: TextFile) -> bool:
    """Return whether a file has the scale factor that K-NET headers carry."""
    return any(re.search(_SCALE, line) for line in file.lines[:20])


def read_knet(file: TextFile) -> tuple[RawChannel, ...]:
    """Read a K-NET file: acceleration = count times scale factor, gal, the offset included.

    Raises:
        MeasurementError: a header line is missing, or duration times sampling frequency is not
            the number of values that follow.
    """
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
    return (RawChannel(direction.group(1), values, 1.0 / frequency, "gal"),)
