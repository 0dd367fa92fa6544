"""Units of responses per unit force: receptance, mobility and accelerance."""

import re
from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats
from femupdate.errors import UnitError
from femupdate.measurement.text import TextFile
from femupdate.measurement.thresholds import RESPONSE
from femupdate.units import UNITS, factor

FORCES = {"N": 1.0, "kN": 1e3, "MN": 1e6, "lbf": 4.4482216152605, "kip": 4448.2216152605}
QUANTITIES = ("receptance", "mobility", "accelerance")
"""Displacement, velocity and acceleration per unit force, by their power of i omega."""
_FORCE = "|".join(FORCES)
_RATIO = re.compile(rf"\(?(?P<motion>[^()*]+?)\)?/\(?(?P<force>{_FORCE})\)?")
_PRODUCT = re.compile(rf"\(?1/(?P<force>{_FORCE})\)?[*·.]?\(?(?P<motion>[^()]+?)\)?")
_MASS = re.compile(r"1/\(?(?P<mass>kg|t|lb)\)?")
_VELOCITY = re.compile(r"(?P<length>[a-z]+)/s", re.IGNORECASE)


def newtons(
    file: TextFile, values: Floats, unit: str | None, column: str, what: str = "force"
) -> Floats:
    """Forces in N.

    Args:
        what: "force" or "load".

    Raises:
        MeasurementError: the unit is missing or none of a force, or nothing pushes so strongly.
    """
    if unit not in FORCES:
        raise file.error(
            f"the {what}'s unit is {unit or 'not given'}; write one of {', '.join(FORCES)} behind"
            f" its name, such as {what}/RF (kN)",
            column=column,
        )
    found = np.asarray(values * FORCES[unit])
    if found.size and np.abs(found).max() > RESPONSE.largest_force_n:
        raise file.error(
            f"a {what} of {np.abs(found).max():.3g} N acts on no building; correct the value or the"
            " unit",
            column=column,
        )
    return found


@dataclass(frozen=True)
class ForceUnit:
    """A unit of a response per unit force.

    Attributes:
        power: 0 for displacement, 1 for velocity, 2 for acceleration.
        factor: to SI, per N.
    """

    power: int
    factor: float

    @property
    def quantity(self) -> str:
        """Its name."""
        return QUANTITIES[self.power]


def force_unit(text: str) -> ForceUnit | None:
    """The unit that a text such as `m/s2/N`, `g/kN`, `1/kg` or `(1/N)*(m/s²)` names, or None."""
    plain = re.sub(r"\s", "", text).replace("²", "2").replace("**", "").replace("^", "")
    mass = _MASS.fullmatch(plain)
    if mass is not None:
        return ForceUnit(2, 1.0 / UNITS["mass"][mass["mass"]])
    match = _PRODUCT.fullmatch(plain) or _RATIO.fullmatch(plain)
    if match is None:
        return None
    motion = _motion(match["motion"])
    if motion is None:
        return None
    power, si = motion
    return ForceUnit(power, si / FORCES[match["force"]])


def _motion(name: str) -> tuple[int, float] | None:
    """Power of i omega and SI factor of a unit of motion, or None."""
    if name in UNITS["length"]:
        return 0, UNITS["length"][name]
    velocity = _VELOCITY.fullmatch(name)
    if velocity is not None and velocity["length"] in UNITS["length"]:
        return 1, UNITS["length"][velocity["length"]]
    try:
        return 2, factor(name, "acceleration")
    except UnitError:
        return None
