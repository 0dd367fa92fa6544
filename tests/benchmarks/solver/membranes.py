"""Static tests of flat and twisted strips: patch, cantilevers, Cook's membrane.

Geometry and loads after MacNeal and Harder, "A proposed standard set of problems to test finite
element accuracy", Finite Elements in Analysis and Design 1 (1985) 3-20, and after Cook (1974).
"""

from typing import Literal

import numpy as np

from femupdate.arrays import Floats
from femupdate.fe import Elements, assemble, factorize

from .meshes import (
    ALL,
    OUT_OF_PLANE,
    displacement,
    grid,
    hold,
    line_weights,
    model,
    shells,
    stack,
    zeros,
)

Shape = Literal["rect", "trap", "para"]
CANTILEVER_CASES = ("extension", "in-plane", "out-of-plane", "twist")

PATCH = np.array(
    [
        *((0.0, 0.0, 0.0), (0.24, 0.0, 0.0), (0.24, 0.12, 0.0), (0.0, 0.12, 0.0)),
        *((0.04, 0.02, 0.0), (0.18, 0.03, 0.0), (0.16, 0.08, 0.0), (0.08, 0.08, 0.0)),
    ]
)
PATCH_QUADS = np.array([(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7)])
PATCH_FIELDS = ("membrane", "spin", "bending", "twist", "shear")


def patch_error(name: str, turn: Floats | None = None, block: Elements | None = None) -> float:
    """Largest error of the nodes inside a distorted patch, over the largest motion.

    The corners follow a field of constant strain, curvature or transverse shear; the nodes inside
    must follow it too. Rotations count times the height of the patch. Under constant shear the
    rotations are held, for no plate is in equilibrium under it without moments along its surface.

    Args:
        turn: (3, 3) rotation of patch and motion; default none.
        block: elements on the nodes of the patch; default five shells.
    """
    turn = np.eye(3) if turn is None else turn
    points, field = PATCH @ turn.T, turned(patch_field(name), turn)
    operators = assemble(model(points, shells=block or shells(PATCH_QUADS, 0.001, 1e6, 0.25)))
    free = np.zeros((len(points), 6), dtype=bool)
    free[4:, : 3 if name == "shear" else 6] = True
    inner, outer = np.flatnonzero(free), np.flatnonzero(~free)
    stiffness = operators.stiffness(np.ones(1))
    force = -stiffness[inner][:, outer] @ field.ravel()[outer]
    found = field.copy()
    found[free] = factorize(stiffness[inner][:, inner].tocsc()).solve(force)
    scale = np.array([1.0] * 3 + [0.12] * 3)
    return float(np.abs((found - field) * scale).max() / np.abs(field * scale).max())


def turned(field: Floats, turn: Floats) -> Floats:
    """Displacements and rotations (n, 6) after a rotation (3, 3)."""
    return (field.reshape(-1, 3) @ turn.T).reshape(-1, 6)


def patch_field(name: str) -> Floats:
    """Motion (8, 6) of the nodes of the patch: constant strain, curvature or transverse shear."""
    x, y, _ = PATCH.T
    field = zeros(len(x))
    if name == "membrane":
        field[:, 0], field[:, 1] = x + y / 2, y + x / 2
    elif name == "spin":
        field[:, 0], field[:, 1], field[:, 5] = 0.7 * x - 1.1 * y, 2.0 * x + 0.4 * y, 1.55
    elif name == "bending":
        field[:, 2], field[:, 3], field[:, 4] = (x**2 + x * y + y**2) / 2, y + x / 2, -x - y / 2
    elif name == "twist":
        field[:, 2], field[:, 3], field[:, 4] = x * y, x, -y
    else:  # constant transverse shear without rotation
        field[:, 2] = x + 2 * y
    return 1e-3 * field


def cook(count: int) -> float:
    """Cook's membrane (48, 44, 16): vertical displacement of the middle of the loaded edge."""
    s, t, quads = grid(count, count)
    points = stack(48 * s, 44 * s + t * (44 - 28 * s), 0 * s)
    fixed = hold(len(s), (s == 0, ALL), (s >= 0, OUT_OF_PLANE))
    load = zeros(len(s))
    load[:, 1] = line_weights(s == 1, t)
    u = displacement(model(points, fixed, shells=shells(quads, 1.0, 1.0, 1 / 3)), load)
    return float(u[(s == 1) & (t == 0.5), 1].item())


def straight_cantilever(shape: Shape, case: str, refine: int = 1) -> float:
    """Strip 6 x 0.2 x 0.1 in six elements: displacement along a unit tip load, or tip twist."""
    s, t, quads = grid(6 * refine, refine)
    inner = (s > 0) & (s < 1)
    sway = {"rect": 0.0 * s, "para": 1.0 + 0.0 * s, "trap": _zigzag(s, 6)}[shape]
    points = stack(6 * s + inner * sway * (0.2 * t - 0.1), 0.2 * t, 0 * s)
    tip, shares = s == 1, line_weights(s == 1, t)
    load = zeros(len(s))
    direction = {"extension": 0, "in-plane": 1, "out-of-plane": 2, "twist": 2}[case]
    if case == "twist":  # a couple of forces at the corners
        load[tip & (t == 0), 2], load[tip & (t == 1), 2] = -5.0, 5.0
    else:
        load[:, direction] = shares
    fixed = hold(len(s), (s == 0, ALL))
    u = displacement(model(points, fixed, shells=shells(quads, 0.1, 1e7, 0.3)), load)
    if case == "twist":
        return float(np.ptp(u[tip & ((t == 0) | (t == 1)), 2]) / 0.2)
    return float(u[tip, direction].mean())


def _zigzag(s: Floats, periods: int) -> Floats:
    """+1 and -1 in turns at multiples of 1 / periods, linear between them."""
    phase = periods * s
    low = np.floor(phase)
    return (-1.0) ** low * (1.0 - 2.0 * (phase - low))


def curved_cantilever(case: str) -> float:
    """Strip of radii 4.12 to 4.32 over 90 degrees in six elements: along a unit tip load."""
    s, t, quads = grid(6, 1)
    radius, angle = 4.12 + 0.2 * t, 0.5 * np.pi * (1 - s)
    points = stack(radius * np.cos(angle), radius * np.sin(angle), 0 * s)
    direction = {"in-plane": 1, "out-of-plane": 2}[case]
    load = zeros(len(s))
    load[s == 1, direction] = 0.5
    fixed = hold(len(s), (s == 0, ALL))
    u = displacement(model(points, fixed, shells=shells(quads, 0.1, 1e7, 0.25)), load)
    return float(u[s == 1, direction].mean())


def twisted_beam(thickness: float, along: str, refine: int = 1) -> float:
    """Strip 12 x 1.1 turned by 90 degrees, 12 x 2 warped elements: along the tip load.

    The load is 1, or 1e-6 on the thin strip; it acts along the tip's "width" or "thickness".
    """
    s, t, quads = grid(12 * refine, 2 * refine)
    angle, width = 0.5 * np.pi * s, 1.1 * (t - 0.5)
    points = stack(12 * s, width * np.cos(angle), width * np.sin(angle))
    direction = {"width": 2, "thickness": 1}[along]
    load = zeros(len(s))
    load[:, direction] = line_weights(s == 1, t) * (1.0 if thickness > 0.1 else 1e-6)
    fixed = hold(len(s), (s == 0, ALL))
    u = displacement(model(points, fixed, shells=shells(quads, thickness, 29e6, 0.22)), load)
    return float(u[(s == 1) & (t == 0.5), direction].item())
