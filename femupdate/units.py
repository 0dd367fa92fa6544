"""Unit names to SI factors, in one place.

Inside the library everything is SI (m, kg, s, N, rad). Files and options state their units; this
module is the only place that knows what those names mean.
"""

import math
import re
import unicodedata
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from femupdate.errors import UnitError

STANDARD_GRAVITY = 9.80665  # m/s2, ISO 80000-3

_LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3, "in": 0.0254, "ft": 0.3048}
_ACCELERATION = {
    "m/s2": 1.0,
    "cm/s2": 1e-2,
    "mm/s2": 1e-3,
    "gal": 1e-2,
    "g": STANDARD_GRAVITY,
    "mg": STANDARD_GRAVITY * 1e-3,
    "ug": STANDARD_GRAVITY * 1e-6,
    "%g": STANDARD_GRAVITY * 1e-2,
    "in/s2": 0.0254,
    "ft/s2": 0.3048,
}
UNITS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "length": _LENGTH,
        "area": {"m2": 1.0, "cm2": 1e-4, "mm2": 1e-6},
        "inertia": {"m4": 1.0, "cm4": 1e-8, "mm4": 1e-12},
        "mass": {"kg": 1.0, "t": 1e3, "g": 1e-3, "lb": 0.45359237},
        "stress": {
            "Pa": 1.0,
            "kPa": 1e3,
            "MPa": 1e6,
            "GPa": 1e9,
            "N/m2": 1.0,
            "N/mm2": 1e6,
            "kN/m2": 1e3,
            "kN/mm2": 1e9,
            "psi": 6894.757293168,
            "ksi": 6894757.293168,
        },
        "density": {"kg/m3": 1.0, "t/m3": 1e3},
        "stiffness": {"N/m": 1.0, "kN/m": 1e3, "MN/m": 1e6, "N/mm": 1e3, "kN/mm": 1e6},
        "rotational stiffness": {"N m/rad": 1.0, "kN m/rad": 1e3, "MN m/rad": 1e6, "GN m/rad": 1e9},
        "damping": {"N s/m": 1.0, "kN s/m": 1e3, "MN s/m": 1e6, "kN s/mm": 1e6},
        "rotational damping": {
            "N m s/rad": 1.0,
            "kN m s/rad": 1e3,
            "MN m s/rad": 1e6,
            "GN m s/rad": 1e9,
        },
        "stiffness per mass": {"1/s2": 1.0, "N/m/kg": 1.0, "kN/m/t": 1.0},
        "frequency": {"Hz": 1.0, "kHz": 1e3, "rad/s": 0.5 / math.pi},
        "force": {
            "N": 1.0,
            "kN": 1e3,
            "MN": 1e6,
            "kgf": STANDARD_GRAVITY,
            "tf": 1e3 * STANDARD_GRAVITY,
            "lbf": 4.4482216152605,
            "kip": 4448.2216152605,
        },
        "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "d": 86400.0},
        "share": {"%": 0.01},
        "acceleration": _ACCELERATION,
    }
)

# The number is atomic: without that "2.8" would be read as 2 of a unit named "8".
_QUANTITY = re.compile(r"((?>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?))\s*(\S.*)")


def listed(names: Sequence[str]) -> str:
    """Names in a row; of more than six the ends, and how many there are."""
    return ", ".join(names) if len(names) <= 6 else f"{names[0]} to {names[-1]} ({len(names)})"


def percent(share: float, digits: int = 0) -> str:
    """A share for people, such as "9.8 %"."""
    return f"{100.0 * share:.{digits}f} %"


def capital(text: str) -> str:
    """A text that begins with a capital letter; the others stay as they are."""
    return f"{text[:1].upper()}{text[1:]}"


def factor(unit: str, kind: str) -> float:
    """Return the SI factor of a unit.

    Args:
        unit: its name; `m/s^2`, `m/s/s`, `m s-2` and `m·s⁻²` are read as `m/s2`.
        kind: what it must measure, a key of `UNITS`.

    Raises:
        UnitError: the name is not a unit of that kind.
    """
    known = UNITS[kind]
    # NFKC makes ² a 2, ⁻ a minus, and both signs of micro one.
    name = " ".join(unicodedata.normalize("NFKC", unit).split())
    name = name.replace("−", "-").replace("\u03bc", "u")
    name = re.sub(r"[\s·.*]*s\(?-2\)?$", "/s2", re.sub(r"\*\*|\^", "", name))
    name = re.sub(r"\s*/\s*", "/", name).replace("/s/s", "/s2").replace("% g", "%g")
    if name in known:
        return known[name]
    folded = {key.lower(): value for key, value in known.items()}
    # Case carries meaning for stresses (MPa, mPa): only accelerations are written in any case.
    if kind == "acceleration" and name.lower() in folded:
        return folded[name.lower()]
    raise UnitError(f"unknown unit {unit!r} for {kind}; use one of {', '.join(known)}")


def parse_quantity(text: str, kind: str) -> float:
    """Return the SI value of a text such as `"180 mm"`.

    Raises:
        UnitError: no number, no unit, a unit of another kind, or a number beyond all bounds.
    """
    match = _QUANTITY.fullmatch(text.strip())
    if match is None:
        example = next(iter(UNITS[kind]))
        raise UnitError(f"{text!r} is not a {kind} with its unit, such as '1.5 {example}'")
    value = float(match.group(1)) * factor(match.group(2), kind)
    if not math.isfinite(value):
        raise UnitError(f"{text!r} is too large for a number; correct it")
    return value
