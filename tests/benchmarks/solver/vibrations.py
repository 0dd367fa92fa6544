"""Free vibration tests of NAFEMS for beams and plates: frequencies of our model, lowest first.

Geometry and supports after NAFEMS, "Selected benchmarks for natural frequency analysis" (R0015,
1987) and "The standard NAFEMS benchmarks" (1990), as quoted in the verification manuals of Altair
OptiStruct and Abaqus. Steel throughout: E = 200 GPa, nu = 0.3, 8000 kg/m3; lengths in m.
"""

from typing import Any

import numpy as np

from femupdate.arrays import Flags, Floats
from femupdate.fe import FiniteElementModel, PointMasses, assemble, lowest_modes

from .meshes import (
    ALL,
    IN_PLANE,
    OUT_OF_PLANE,
    RX,
    RY,
    UX,
    UY,
    UZ,
    beams,
    chain,
    grid,
    hold,
    model,
    shells,
    stack,
)

E, NU, DENSITY = 200e9, 0.3, 8000.0
_STEEL: dict[str, Any] = {"youngs_modulus": E, "poisson_ratio": NU, "density": DENSITY}
_SHIFT_HZ = -0.5  # admits the rigid motions of a plate that floats


def frequencies(structure: FiniteElementModel, count: int, floating: int = 0) -> Floats:
    """The lowest `count` frequencies above `floating` rigid motions, Hz."""
    operators = assemble(structure)
    shift = _SHIFT_HZ if floating else None
    modes = lowest_modes(operators, np.ones(1), count + floating, shift)
    return modes.frequency_hz[floating:]


def double_cross(elements: int = 4) -> FiniteElementModel:
    """FV2: eight arms of 5 m, 0.125 m square, pinned at their ends, in their plane."""
    side = 0.125
    angle = np.arange(8) * np.pi / 4
    along = np.linspace(0, 5, elements + 1)[1:]
    arms = along[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)[:, None]
    points = np.vstack(
        [np.zeros(3), np.column_stack([arms.reshape(-1, 2), np.zeros(8 * elements)])]
    )
    number = 1 + np.arange(8 * elements).reshape(8, elements)
    nodes = np.column_stack([np.zeros(8, dtype=np.int64), number])
    pairs = np.stack([nodes[:, :-1], nodes[:, 1:]], axis=-1).reshape(-1, 2)
    ends = np.isin(np.arange(len(points)), number[:, -1])
    fixed = hold(len(points), (np.ones(len(points), bool), OUT_OF_PLANE), (ends, (UX, UY)))
    section = square_section(side, slender=True)
    return model(points, fixed, beams=beams(pairs, **section, **_STEEL))


def off_centre_masses(elements: int = 5) -> FiniteElementModel:
    """FV4: cantilever of 10 m, 0.5 m round, 10 t and 1 t on rigid arms of 2 m at its tip.

    The arms are massless beams ten thousand times as stiff.
    """
    diameter = 0.5
    area, inertia = np.pi * diameter**2 / 4, np.pi * diameter**4 / 64
    shear_area = area * 6 * (1 + NU) / (7 + 6 * NU)  # round section (Cowper 1966)
    pairs = np.vstack([chain(elements), [[elements, elements + 1], [elements, elements + 2]]])
    shaft = np.arange(elements + 2) < elements
    rods = beams(
        pairs,
        area=area,
        inertia_y=inertia,
        inertia_z=inertia,
        torsion_constant=2 * inertia,
        shear_area_y=np.where(shaft, shear_area, np.inf),
        shear_area_z=np.where(shaft, shear_area, np.inf),
        youngs_modulus=np.where(shaft, E, 1e4 * E),
        poisson_ratio=NU,
        density=np.where(shaft, DENSITY, 0.0),
    )
    axis = np.linspace(0, 10, elements + 1)[:, None] * [1.0, 0.0, 0.0]
    points = np.vstack([axis, [[10.0, 2.0, 0.0], [10.0, -2.0, 0.0]]])
    masses = PointMasses(
        np.array([elements + 1, elements + 2]), np.array([10e3, 1e3]), np.zeros((2, 3))
    )
    fixed = hold(len(points), (points[:, 0] == 0, ALL))
    return model(points, fixed, beams=rods, masses=masses)


def deep_beam(elements: int = 5) -> FiniteElementModel:
    """FV5: simply supported beam of 10 m, 2 m x 2 m.

    The published torsion of 77.542 Hz takes the polar moment for the torsion constant.
    """
    points = np.linspace(0, 10, elements + 1)[:, None] * [1.0, 0.0, 0.0]
    first, last = points[:, 0] == 0, points[:, 0] == 10
    fixed = hold(elements + 1, (first, (UX, UY, UZ, RX)), (last, (UY, UZ)))
    return model(points, fixed, beams=beams(chain(elements), **square_section(2.0), **_STEEL))


def square_section(side: float, slender: bool = False) -> dict[str, Any]:
    """A full square section that twists as if its sections stayed plane."""
    area, inertia = side**2, side**4 / 12
    shear_area = np.inf if slender else area / 1.2
    return {
        "area": area,
        "inertia_y": inertia,
        "inertia_z": inertia,
        "torsion_constant": 2 * inertia,
        "shear_area_y": shear_area,
        "shear_area_z": shear_area,
    }


def square_plate(count: int, thickness: float, support: str) -> FiniteElementModel:
    """FV12, FV13, FV16, FV21 and FV52: plate 10 m x 10 m of count x count elements."""
    s, t, quads = grid(count, count)
    x_edge, y_edge = (s == 0) | (s == 1), (t == 0) | (t == 1)
    plane = (s >= 0, IN_PLANE)
    rules: dict[str, list[tuple[Flags, tuple[int, ...]]]] = {
        "free": [plane],
        "hard": [plane, (x_edge, (UZ, RX)), (y_edge, (UZ, RY))],
        "clamped": [plane, (s == 0, ALL)],
        "soft": [(x_edge | y_edge, (UZ,))],
    }
    return model(
        stack(10 * s, 10 * t, 0 * s),
        hold(len(s), *rules[support]),
        shells=shells(quads, thickness, E, NU, DENSITY),
    )


def distorted_cantilever() -> FiniteElementModel:
    """FV16, test 2: the cantilever plate on the distorted 4 x 4 mesh of the test.

    The places of the inner nodes were checked with OpenSees: on this mesh ShellMITC4, ShellDKGQ
    and ASDShellQ4 find the 18 frequencies that were known from the published mesh to all digits.
    """
    s, t, quads = grid(4, 4)
    points = stack(10 * s, 10 * t, 0 * s)
    points.reshape(5, 5, 3)[1:4, 1:4, :2] = [
        [(2.25, 2.25), (2.5, 4.75), (2.25, 7.25)],
        [(4.75, 2.5), (5.0, 5.0), (5.25, 7.25)],
        [(7.25, 2.75), (7.5, 4.75), (7.75, 7.25)],
    ]
    fixed = hold(len(s), (s >= 0, IN_PLANE), (s == 0, ALL))
    return model(points, fixed, shells=shells(quads, 0.05, E, NU, DENSITY))


def rhombic_plate(count: int, thickness: float) -> FiniteElementModel:
    """FV15 and FV22: clamped rhombus with sides of 10 m and a skew of 45 degrees."""
    s, t, quads = grid(count, count)
    edge = (s == 0) | (s == 1) | (t == 0) | (t == 1)
    points = stack(10 * (s + t * np.sqrt(0.5)), 10 * t * np.sqrt(0.5), 0 * s)
    fixed = hold(len(s), (s >= 0, IN_PLANE), (edge, ALL))
    return model(points, fixed, shells=shells(quads, thickness, E, NU, DENSITY))


def tapered_membrane(columns: int, rows: int) -> FiniteElementModel:
    """FV32: cantilever membrane of 10 m, 5 m to 1 m deep, 0.05 m thick."""
    s, t, quads = grid(columns, rows)
    points = stack(10 * s, (t - 0.5) * (5 - 4 * s), 0 * s)
    fixed = hold(len(s), (s >= 0, OUT_OF_PLANE), (s == 0, ALL))
    return model(points, fixed, shells=shells(quads, 0.05, E, NU, DENSITY))
