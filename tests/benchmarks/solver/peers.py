"""What other four-node elements score: value over target, coarse meshes as in our own tests.

Measured by the authors with OpenSees 3.7.1 (ShellMITC4, ASDShellQ4, ShellDKGQ), torch-fem 0.14,
Pynite 3.2 (DKMQ), pyfe3d 0.11 and, on some rows, MYSTRAN 18; figures of other programs are those
of their verification manuals, as named. pyfe3d's element does not pass the patch test (its error
is 11 % in membrane and 23 % in bending) and is listed for completeness.

MYSTRAN 18.0.0.1, `PARAM,QUAD4TYP`, ran on 2026-11-25, on some rows.
"""

import csv
from functools import cache
from pathlib import Path

from .score import Peer, best_peer

# Roof displacement (mm) and first frequency (Hz) by mesh; ratios to the limits are made below.
_COUPLED: dict[int, dict[str, tuple[float, float]]] = {
    1: {"ShellMITC4": (5.604, 7.355), "ASDShellQ4": (7.321, 6.406), "ShellDKGQ": (7.126, 6.499)},
    2: {"ShellMITC4": (7.084, 6.518), "ASDShellQ4": (7.989, 6.135), "ShellDKGQ": (7.954, 6.150)},
    4: {"ShellMITC4": (8.058, 6.109), "ASDShellQ4": (8.436, 5.972), "ShellDKGQ": (8.411, 5.981)},
    8: {"ShellMITC4": (8.502, 5.949), "ASDShellQ4": (8.641, 5.901), "ShellDKGQ": (8.626, 5.906)},
}
COUPLED_LIMITS = (8.8, 5.85)  # mm and Hz, extrapolated from those runs (Richardson)


@cache
def _rows(name: str) -> list[dict[str, str]]:
    """Of a table beside this file, without its empty cells."""
    with Path(__file__).with_name(name).open(encoding="utf-8", newline="") as file:
        return [{k: v for k, v in row.items() if v} for row in csv.DictReader(file)]


def static_peer(key: str) -> Peer | None:
    """The best element on a row of the table of static tests; None of an unknown row."""
    found = next((row for row in _rows("static_peers.csv") if row["test"] == key), {})
    return best_peer({name: float(value) for name, value in found.items() if name != "test"})


def coupled_wall_peers(fine: int, quantity: int) -> dict[str, float]:
    """Ratios for the coupled wall: 0 the roof's displacement, 1 the first frequency."""
    limit = COUPLED_LIMITS[quantity]
    if fine not in _COUPLED:
        return {}
    return {name: values[quantity] / limit for name, values in _COUPLED[fine].items()}


def frequency_peer(test: str, mode: int) -> Peer | None:
    """The best element on one distinct frequency of a NAFEMS test, on the published mesh."""
    rows = [row for row in _rows("frequency_peers.csv") if row["test"] == test]
    return best_peer({row["element"]: float(row[f"mode {mode + 1}"]) for row in rows})
