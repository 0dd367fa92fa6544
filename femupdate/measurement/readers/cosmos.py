"""COSMOS strong-motion files, Volumes 0 to 2: text, integer and real headers, then the values.

After the format's description, version 1.20 (COSMOS 2001): the sampling interval is real header 62
in ms, or 34 in s; the peak 64; the azimuth integer header 54. Velocity and displacement are passed
over.
"""

import re
from collections.abc import Iterator
from pathlib import Path

from femupdate.measurement.recording import RecordedChannel, Recording, azimuth_of
from femupdate.measurement.text import TextFile, finite, fixed_columns, positive, read_text

READS = "COSMOS Volumes 0 to 2"

# 12725 acceleration pts, approx 63 secs, units=cm/sec2(04),Format=(8F10.5)
# 20000 raw accel.   pts, approx  100 secs, units=counts (50),Format=(10I8)
_ANNOUNCED = re.compile(
    r"^\s*(?P<n>\d+)\s+(?:raw )?accel(?:eration|\.)\s+pts,\s*approx\s+(?P<lasts>\d+)\s*secs,"
    r"\s*units=\s*(?P<unit>[^,(]+?)\s*(?:\(\s*\d+\s*\)|,)[\s,]*Format\s*=\s*\((?P<per>\d+)(?P<kind>[IFE])"
    r"(?P<width>\d+)",
    re.IGNORECASE,
)
_MENTIONED = re.compile(
    r"^\s*\d+\s+(raw )?(accel(eration|\.)|velocity|displacement)\s+pts,", re.I | re.M
)
_HEADER = re.compile(
    r"^\s*(?P<n>\d+)\s+(?P<kind>Integer|Real)-header values follow on\s+(?P<lines>\d+)\s+lines\s*,"
    r"\s*Format\s*=\s*\(\d+[IFE](?P<width>\d+)",
    re.IGNORECASE,
)
_CHANNEL = re.compile(
    r"^Sta Chan?\s*:?\s*(\d+|\?):\s*(.*?)\s*(?:\(.*?\)\s*)?(?:Location:\s*(.*))?$", re.IGNORECASE
)
# |<SCNL>BMR.BNZ.AK.--  says the channel's code, which ends with its direction
_CODE = re.compile(r"^\|\s*<?SCNL>?:?\s*[^.\s]*\.[A-Z][A-Z]([ENZ])\.")
# Integer header 54: an azimuth, or one of these.
_VERTICAL = {400.0: "Up", 401.0: "Down", 402.0: "Vertical"}
_NOTHING = {"other", "unknown", "?", ""}


def recognises(head: str, suffix: str) -> bool:
    return "-header values follow on" in head or _MENTIONED.search(head) is not None


def read(path: Path) -> Recording:
    """Accelerations of all channels, by the column widths that the file states."""
    file = read_text(path)
    channels = tuple(_channels(file))
    if not channels:
        raise file.error(
            "the file announces no acceleration; take Volume 0, 1 or 2 of the acceleration, not"
            " velocity, displacement or spectra (Volume 3)"
        )
    return Recording(file, channels)


def _channels(file: TextFile) -> Iterator[RecordedChannel]:
    direction, location, number, code = "", "", "1", ""
    header: dict[str, list[float | None]] = {"integer": [], "real": []}
    for at, line in enumerate(file.lines):
        if match := _CHANNEL.match(line):
            number, direction, location = (" ".join((t or "").split()) for t in match.groups())
            code = ""
        elif match := _CODE.match(line):
            code = match.group(1)
        elif match := _HEADER.match(line):
            header[match["kind"].lower()] = _header(file, at, match)
        elif match := _ANNOUNCED.match(line):
            along = _direction(direction, _item(header["integer"], 54), code)
            name = along or f"channel {number}"
            name = f"{name}, {location}" if location else name
            count, per_line = int(match["n"]), int(positive(file, match["per"], "Format", at))
            width = int(positive(file, match["width"], "Format", at))
            peak = _item(header["real"], 64)
            whole = match["kind"].upper() == "I"
            numbers = fixed_columns(file, at, count, (per_line, width), name, whole)
            factor, unit = _scale(file, at, match["unit"], header["real"])
            yield RecordedChannel(
                name=name,
                values=factor * numbers,
                time_step=_step(file, at, match, header["real"]),
                unit=unit,
                location=location,
                direction=along,
                azimuth_deg=azimuth_of(along),
                stated_peak=None if peak is None else abs(factor * peak),
            )


def _direction(said: str, azimuth: float | None, code: str) -> str:
    """What the header says in words, in numbers, or by the last letter of the channel's code."""
    if said.lower() not in _NOTHING:
        return said
    if azimuth in _VERTICAL:
        return _VERTICAL[azimuth]
    if azimuth is not None and 0.0 < azimuth <= 360.0:
        return f"{azimuth:.0f} deg"
    return "Up" if code == "Z" else code


def _header(file: TextFile, at: int, match: re.Match[str]) -> list[float | None]:
    width, lines = int(match["width"]), file.lines[at + 1 : at + 1 + int(match["lines"])]
    starts = [(line, k) for line in lines for k in range(0, len(line.rstrip()), max(width, 1))]
    return [finite(line[k : k + width]) for line, k in starts]


def _scale(file: TextFile, at: int, unit: str, real: list[float | None]) -> tuple[float, str]:
    """What values are multiplied by, and their unit then."""
    if not unit.lower().startswith("count"):
        return 1.0, unit
    microvolts, sensitivity = _item(real, 22), _item(real, 42)
    if not microvolts or not sensitivity:
        raise file.error(
            "the values are counts, and the headers do not give what a count is (real headers 22"
            " and 42); take Volume 1 or 2",
            at + 1,
        )
    gain = _item(real, 47) or 1.0
    return microvolts * 1e-6 / sensitivity / gain, "g"


def _item(header: list[float | None], number: int) -> float | None:
    """Item of a header by its number from 1; None where it is unknown."""
    value = header[number - 1] if len(header) >= number else None
    return None if value == -999.0 else value


def _step(file: TextFile, at: int, announced: re.Match[str], real: list[float | None]) -> float:
    """Sampling interval, s, that agrees with the length announced in whole seconds."""
    ms, seconds = _item(real, 62), _item(real, 34)
    lasts, count = float(announced["lasts"]), int(announced["n"])
    for step in (None if ms is None else ms / 1000.0, seconds):
        if step is not None and step > 0.0 and abs(count * step - lasts) <= 1.0 + 0.01 * lasts:
            return step
    raise file.error(
        f"the headers give no sampling interval with which {count} values last {lasts:g} s;"
        " restore the real header 62 (ms)",
        at + 1,
    )
