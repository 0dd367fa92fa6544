"""Directions as measured files write them: azimuths, compass points, up."""

import re

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


def is_vertical(direction: str) -> bool:
    """Whether a direction is up or down."""
    return _word(direction).replace("-", "") in _VERTICAL


def _word(direction: str) -> str:
    # KiK-net numbers its directions by the depth of the sensor: NS1 in the borehole, NS2 above.
    return re.sub(r"^(NS|EW|UD)\d$", r"\1", " ".join(direction.upper().split()))
