"""One recorded history, its direction and its unit."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from femupdate.arrays import Floats
from femupdate.measurement.columns import parse_channel
from femupdate.measurement.quantity import is_acceleration, plain_unit, si_factor
from femupdate.measurement.text import TextFile
from femupdate.units import UNITS

_POINTS = {"N": 0.0, "E": 90.0, "S": 180.0, "W": 270.0, "NE": 45.0, "SE": 135.0, "SW": 225.0}
_POINTS |= {"NW": 315.0, "NS": 0.0, "EW": 90.0, "NORTH": 0.0, "EAST": 90.0, "SOUTH": 180.0}
_POINTS |= {"WEST": 270.0}
_VERTICAL = {"UP", "DOWN", "UD", "DU", "V", "Z", "VERT", "VERTICAL"}
_DEGREES = re.compile(r"^(\d{1,3})\s*(?:DEG(?:REES)?\.?|°)?$")
_QUADRANT = re.compile(r"^([NS])\s*(\d{1,2})\s*(?:DEG)?\s*([EW])$")


def azimuth_of(direction: str) -> float | None:
    """Degrees clockwise from north of `90 Deg`, `N-S`, `N35E` or `east`; None of other words."""
    word = _word(direction)
    degrees, quadrant = _DEGREES.match(word), _QUADRANT.match(word)
    if degrees and float(degrees.group(1)) <= 360.0:
        return float(degrees.group(1)) % 360.0
    if quadrant:
        north, angle, east = quadrant.groups()
        turned = float(angle) if north == "N" else 180.0 - float(angle)
        return (turned if east == "E" else -turned) % 360.0
    return _POINTS.get(word.replace("-", ""))


def _word(direction: str) -> str:
    # KiK-net numbers its directions by the depth of the sensor: NS1 in the borehole, NS2 above.
    return re.sub(r"^(NS|EW|UD)\d$", r"\1", " ".join(direction.upper().split()))


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordedChannel:
    """One history as the file gives it.

    Attributes:
        name: the file's name for it.
        values: (n,) in `unit`.
        time_step: s.
        unit: that the file states, or None.
        quantity: what was measured.
        location: where the sensor sits, in the file's words; empty where it does not say.
        direction: in the file's words, such as `90 Deg` or `Up`; empty where it does not say.
        azimuth_deg: clockwise from north, where it is known.
        stated_peak: largest absolute value by the file's header, in `unit`.
    """

    name: str
    values: Floats
    time_step: float
    unit: str | None
    quantity: str = "acceleration"
    location: str = ""
    direction: str = ""
    azimuth_deg: float | None = None
    stated_peak: float | None = None

    @property
    def vertical(self) -> bool:
        """Whether it is up or down, as its direction or its name says."""
        named = parse_channel(self.name)
        up = _word(self.direction).replace("-", "") in _VERTICAL
        return up or (named is not None and named.direction == "z")

    def turned(self) -> "RecordedChannel":
        """The same in the opposite direction."""
        return replace(self, values=-self.values)


def acceleration_unit(file: TextFile, channel: RecordedChannel, asked: str | None) -> str:
    """Return the unit of a channel of acceleration, stated in the file or asked for by the user.

    Raises:
        MeasurementError: the channel holds something else, or neither or both say, and differ.
    """
    stated, column = channel.unit, repr(channel.name)
    if channel.quantity not in ("acceleration", "unknown"):
        raise file.error(
            f"{column} holds {channel.quantity}, not acceleration; choose another channel"
        )
    if stated is None and asked is None:
        raise file.error(
            "the file does not say its unit; give it by the unit option or in the second header"
            f" row (one of {', '.join(UNITS['acceleration'])})",
            column=column,
        )
    if stated is None or asked is None:
        return stated or asked or ""
    if si_factor(file, stated, "acceleration") != si_factor(file, asked, "acceleration"):
        raise file.error(
            f"the file says {plain_unit(stated)} but the unit option says {asked}; leave the"
            " option out, or correct the file if it is wrong",
            column=column,
        )
    return stated


def in_m_s2(file: TextFile, channel: RecordedChannel, asked: str | None) -> Floats:
    """Values (n,) of a channel of acceleration in m/s2.

    Args:
        asked: its unit, where the file does not say it.

    Raises:
        MeasurementError: see `acceleration_unit`.
    """
    unit = acceleration_unit(file, channel, asked)
    return channel.values * si_factor(file, unit, "acceleration")


def channel_listing(file: TextFile, channels: Sequence[RecordedChannel], unit: str | None) -> str:
    """Return `1 = 90 Deg (peak 3.38 m/s2), 2 = ...`; `unit` is that of channels without one."""
    entries = []
    for number, each in enumerate(channels, start=1):
        stated = each.unit or unit
        peak = float(np.abs(each.values).max())
        if stated is None or not is_acceleration(stated):
            shown = f"{peak:.4g} {each.unit or 'in its own unit'}"
        else:
            shown = f"{peak * si_factor(file, stated, 'acceleration'):.4g} m/s2"
        entries.append(f"{number} = {each.name} (peak {shown})")
    return ", ".join(entries)
