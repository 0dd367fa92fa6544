"""Units as measured files write them."""

import re

from femupdate.errors import UnitError
from femupdate.measurement.force_unit import FORCES, force_unit
from femupdate.measurement.text import TextFile
from femupdate.units import UNITS, factor

_EXPLAINED = re.compile(r"^([A-Za-z]+)\s*\(.*\)$")  # gal(cm/s/s), as JMA writes
_MEASURED = ("acceleration", "time", "frequency", "length")


def plain_unit(unit: str) -> str:
    """Return a unit's name without what files wrap around it: `gal(cm/s/s)`, `cm/sec2.`, `[g]`."""
    name = unit.strip().strip("[]").rstrip(".,; ").strip()
    if name.startswith("(") and name.endswith(")"):
        name = name[1:-1].strip()
    explained = _EXPLAINED.match(name)
    if explained:
        name = explained.group(1)
    return re.sub(r"\bsec\b|(?<=/)sec(?=\d|\^|\*)", "s", name, flags=re.IGNORECASE)


def is_unit(text: str) -> bool:
    """Return whether a text names a unit of motion, time, frequency, force, or per force."""
    known = any(_known(plain_unit(text), kind) for kind in _MEASURED)
    return known or text in FORCES or force_unit(text) is not None


def is_acceleration(unit: str) -> bool:
    """Return whether a text names a unit of acceleration."""
    return _known(plain_unit(unit), "acceleration")


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


def si_factor(file: TextFile, unit: str, kind: str) -> float:
    """Return the SI factor of a unit that a file or an option names.

    Raises:
        MeasurementError: the name is not a unit of that kind.
    """
    try:
        return _factor(plain_unit(unit), kind)
    except UnitError as error:
        raise file.error(str(error)) from None


def agreed_unit(file: TextFile, stated: str | None, asked: str | None, column: str) -> str:
    """Return the acceleration unit of a column, stated in the file or asked for by the user.

    Raises:
        MeasurementError: neither says, or they contradict each other.
    """
    if stated is None and asked is None:
        known = ", ".join(UNITS["acceleration"])
        raise file.error(
            "the file does not say its unit; give it by the unit option or in the second header"
            f" row (one of {known})",
            column=column,
        )
    if stated is None or asked is None:
        return stated or asked or ""
    inside = si_factor(file, stated, "acceleration")
    if inside != si_factor(file, asked, "acceleration"):
        raise file.error(
            f"the file says {plain_unit(stated)} but the unit option says {asked}; leave the"
            " option out, or correct the file if it is wrong",
            column=column,
        )
    return stated


def _known(name: str, kind: str) -> bool:
    try:
        _factor(name, kind)
    except UnitError:
        return False
    return True


def _factor(name: str, kind: str) -> float:
    # The first digitised CSMIP records are written in tenths of g.
    if kind == "acceleration" and name.lower().replace(" ", "") == "g/10":
        return factor("g", kind) / 10.0
    return factor(name, kind)
