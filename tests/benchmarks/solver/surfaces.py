"""Static tests of plates and curved shells.

Geometry and loads after MacNeal and Harder (1985); the three curved shells are those of the
obstacle course of Belytschko, Stolarski, Liu, Carpenter and Ong, Computer Methods in Applied
Mechanics and Engineering 51 (1985) 221-258. The hook is Raasch's, in Knight, AIAA Journal 35
(1997) 375-381.
"""

from typing import Literal

import numpy as np

from .meshes import (
    ALL,
    IN_PLANE,
    RX,
    RY,
    RZ,
    UX,
    UY,
    UZ,
    area_shares,
    displacement,
    grid,
    hold,
    line_weights,
    model,
    shells,
    stack,
    zeros,
)

Edges = Literal["ss", "cl"]
Loading = Literal["q", "p"]


def rectangular_plate(length: float, edges: Edges, loading: Loading, count: int) -> float:
    """Thin plate 2 x `length`, a quarter of it: deflection of the middle."""
    s, t, quads = grid(count, count)
    points = stack(s, 0.5 * length * t, 0 * s)
    held = {"ss": ((UZ, RX), (UZ, RY)), "cl": (ALL, ALL)}[edges]
    fixed = hold(
        len(s),
        (s >= 0, IN_PLANE),
        (s == 0, (RY,)),
        (t == 0, (RX,)),
        (s == 1, held[0]),
        (t == 1, held[1]),
    )
    middle = (s == 0) & (t == 0)
    load = zeros(len(s))
    if loading == "q":
        load[:, UZ] = 1e-4 * area_shares(points, quads)
    else:
        load[middle, UZ] = 1e-4
    u = displacement(model(points, fixed, shells=shells(quads, 1e-4, 1.7472e7, 0.3)), load)
    return float(u[middle, UZ].item())


def scordelis_lo(count: int) -> float:
    """Roof R = 25, L = 50 under its weight, a quarter of it: middle of the free edge, downwards."""
    s, t, quads = grid(count, count)
    angle = np.radians(40) * t
    points = stack(25 * s, 25 * np.sin(angle), 25 * np.cos(angle))
    fixed = hold(
        len(s),
        (s == 0, (UX, RY, RZ)),  # middle of the length
        (t == 0, (UY, RX, RZ)),  # crown
        (s == 1, (UY, UZ)),  # end diaphragm
    )
    load = zeros(len(s))
    load[:, UZ] = -90 * area_shares(points, quads)
    u = displacement(model(points, fixed, shells=shells(quads, 0.25, 4.32e8, 0.0)), load)
    return float(-u[(s == 0) & (t == 1), UZ].item())


def hemisphere(count: int) -> float:
    """Hemisphere R = 10 with an 18 degree hole, pulled and pushed at its foot: along the pull."""
    s, t, quads = grid(count, count)
    azimuth, elevation = 0.5 * np.pi * s, np.radians(72) * t
    points = 10 * stack(
        np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)
    )
    first, second = (s == 0) & (t == 0), (s == 1) & (t == 0)
    fixed = hold(len(s), (s == 0, (UY, RX, RZ)), (s == 1, (UX, RY, RZ)), (first, (UZ,)))
    load = zeros(len(s))
    load[first, UX], load[second, UY] = 1.0, -1.0
    u = displacement(model(points, fixed, shells=shells(quads, 0.04, 6.825e7, 0.3)), load)
    return float(u[first, UX].item())


def pinched_cylinder(count: int) -> float:
    """Cylinder R = 300, L = 600 between diaphragms, an octant of it: under the unit load."""
    s, t, quads = grid(count, count)
    angle = 0.5 * np.pi * t
    points = stack(300 * s, 300 * np.sin(angle), 300 * np.cos(angle))
    fixed = hold(
        len(s),
        (s == 0, (UX, RY, RZ)),
        (t == 0, (UY, RX, RZ)),
        (t == 1, (UZ, RX, RY)),
        (s == 1, (UY, UZ)),
    )
    loaded = (s == 0) & (t == 0)
    load = zeros(len(s))
    load[loaded, UZ] = -0.25
    u = displacement(model(points, fixed, shells=shells(quads, 3.0, 3e6, 0.3)), load)
    return float(-u[loaded, UZ].item())


def raasch_hook(across: int, along: int) -> float:
    """Arcs R = 14 and 46 of 60 and 150 degrees, a strip 20 x 2: tip across, under unit shear."""
    s, t, quads = grid(along, across)
    bend, turn = np.radians(60), np.radians(210) * s
    small, back = turn <= bend * (1 + 1e-9), 2 * bend - turn
    x = np.where(small, 14 * np.sin(turn), 60 * np.sin(bend) - 46 * np.sin(back))
    y = np.where(small, -14 * np.cos(turn), -60 * np.cos(bend) + 46 * np.cos(back))
    fixed = hold(len(s), (s == 0, ALL))
    load = zeros(len(s))
    load[:, UZ] = line_weights(s == 1, t)
    strip = shells(quads, 2.0, 3300.0, 0.35)
    u = displacement(model(stack(x, y, 20 * t), fixed, shells=strip), load)
    return float(load[:, UZ] @ u[:, UZ])
