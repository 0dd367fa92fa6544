"""Units as measured files write them, also of forces and of responses per force."""

import re

import numpy as np

from femupdate.arrays import Floats
from femupdate.errors import UnitError
from femupdate.measurement.text import TextFile
from femupdate.units import UNITS, factor

FORCES = {"N": 1.0, "kN": 1e3, "MN": 1e6, "lbf": 4.4482216152605, "kip": 4448.2216152605}
QUANTITIES = ("receptance", "mobility", "accelerance")
"""Displacement, velocity and acceleration per unit force, by their power of i omega."""
_FORCE = "|".join(FORCES)
_RATIO = re.compile(rf"\(?(?P<motion>[^()*]+?)\)?/\(?(?P<force>{_FORCE})\)?")
_PRODUCT = re.compile(rf"\(?1/(?P<force>{_FORCE})\)?[*·.]?\(?(?P<motion>[^()]+?)\)?")
_MASS = re.compile(r"1/\(?(?P<mass>kg|t|lb)\)?")
_VELOCITY = re.compile(r"(?P<length>[a-z]+)/s", re.IGNORECASE)


def newtons(file: TextFile, values: Floats, unit: str | None, column: str) -> Floats:
    """Forces in N."""
    if unit not in FORCES:
        raise file.error(
            f"the force's unit is {unit or 'not given'}; write one of {', '.join(FORCES)} behind"
            f" its name, such as force/RF (kN)",
            column=column,
        )
    found = np.asarray(values * FORCES[unit])
    # 1e10 N is the weight of a million tonnes.
    if found.size and np.abs(found).max() > 1e10:
        raise file.error(
            f"a force of {np.abs(found).max():.3g} N acts on no building; correct the value or the"
            " unit",
            column=column,
        )
    return found


def force_unit(text: str) -> tuple[int, float] | None:
    """The unit per force that a text such as `m/s2/N`, `g/kN` or `(1/N)*(m/s²)` names, or None.

    Returns:
        Power of i omega (see `QUANTITIES`), and factor to SI.
    """
    plain = re.sub(r"\s", "", text).replace("²", "2").replace("**", "").replace("^", "")
    mass = _MASS.fullmatch(plain)
    if mass is not None:
        return 2, 1.0 / UNITS["mass"][mass["mass"]]
    match = _PRODUCT.fullmatch(plain) or _RATIO.fullmatch(plain)
    if match is None:
        return None
    newton, lengths = FORCES[match["force"]], UNITS["length"]
    velocity = _VELOCITY.fullmatch(match["motion"])
    if match["motion"] in lengths:
        return 0, lengths[match["motion"]] / newton
    if velocity is not None and velocity["length"] in lengths:
        return 1, lengths[velocity["length"]] / newton
    try:
        return 2, factor(match["motion"], "acceleration") / newton
    except UnitError:
        return None


_EXPLAINED = re.compile(r"^([A-Za-z]+)\s*\(.*\)$")  # gal(cm/s/s), as JMA writes
RAW = re.compile(r"[mµμu]?V(olts?)?|counts?|cts|LSB", re.IGNORECASE)  # of a digitiser
_MEASURED = ("acceleration", "time", "frequency", "length")


def plain_unit(unit: str) -> str:
    """Return a unit's name without what files wrap around it: `gal(cm/s/s)`, `cm/sec2.`, `[g]`."""
    name = unit.strip().strip("[]").rstrip(".,; ").strip()
    if name.startswith("(") and name.endswith(")"):
        name = name[1:-1].strip()
    explained = _EXPLAINED.match(name)
    if explained:
        name = explained.group(1)
    return re.sub(r"(?<![^\W\d])sec(?:ond)?s?(?=\b|\d|\^|\*|²|-|⁻)", "s", name, flags=re.IGNORECASE)


def is_unit(text: str) -> bool:
    """Return whether a text names a unit of motion, time, frequency, force, or per force."""
    known = any(_known(plain_unit(text), kind) for kind in _MEASURED)
    return known or text in FORCES or bool(force_unit(text) or RAW.fullmatch(text))


def is_acceleration(unit: str) -> bool:
    """Return whether a text names a unit of acceleration."""
    return _known(plain_unit(unit), "acceleration")


def acceleration_factor(unit: str | None) -> float:
    """SI factor of a unit of acceleration, 1 of any other or none."""
    return _factor(plain_unit(unit), "acceleration") if unit and is_acceleration(unit) else 1.0


def split_unit(cell: str) -> tuple[str, str | None]:
    """Split a column's title into name and unit: `RF (m/s2)` gives `("RF", "m/s2")`."""
    name, unit = bracketed(cell)
    return (name, unit) if unit is not None and is_unit(unit) else (cell.strip(), None)


def bracketed(title: str) -> tuple[str, str | None]:
    """Split a title into a name and what stands in brackets behind it, or None: `damping (%)`.

    Without a pattern, which takes seconds to refuse a name with thousands of blanks.
    """
    text = title.strip()
    at = max(text.rfind("("), text.rfind("["))
    inside = text[at + 1 : -1].strip()
    if at < 1 or text[-1] not in ")]" or not inside or ")" in inside or "]" in inside:
        return text, None
    return text[:at].rstrip(), inside


def si_factor(file: TextFile, unit: str, kind: str, column: str | None = None) -> float:
    """Return the SI factor of a unit that a file or an option names."""
    try:
        return _factor(plain_unit(unit), kind)
    except UnitError as error:
        raise file.error(str(error), column=column) from None


def _known(name: str, kind: str) -> bool:
    try:
        _factor(name, kind)
    except UnitError:
        return False
    return True


def _factor(name: str, kind: str) -> float:
    several = re.fullmatch(r"(\d+\.?\d*(?:[eE][-+]?\d+)?)\s*\*?\s*([^\d\s.].*)", name)
    if several and kind == "acceleration":  # 4.7e-6 m/s2 is what a count of a digitiser may be
        return float(several[1]) * factor(several[2], kind)
    # The first digitised CSMIP records are written in tenths of g.
    if kind == "acceleration" and name.lower().replace(" ", "") == "g/10":
        return factor("g", kind) / 10.0
    return factor(name, kind)
