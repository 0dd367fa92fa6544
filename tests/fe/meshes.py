"""Meshes, models and loads shared by the tests of the finite-element room."""

from dataclasses import replace

import numpy as np
from femupdate.benchmarks.solver.meshes import (  # noqa: F401 (tests take them from here)
    RX,
    RY,
    RZ,
    UX,
    UY,
    UZ,
    beams,
    chain,
    displacement,
    grid,
    hold,
    line_weights,
    model,
    shells,
    stack,
    zeros,
)

SECTION = {
    "area": 0.12,
    "shear_area_y": 0.1,
    "shear_area_z": 0.1,
    "inertia_y": 1.6e-3,
    "inertia_z": 0.9e-3,
    "torsion_constant": 1.9e-3,
    "youngs_modulus": 25e9,
    "density": 2400.0,
}


def random_rotation(seed):
    matrix, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    return matrix * np.linalg.det(matrix)


def frame_with_wall(fine=1):
    """A wall, a slab and a column that touch, nowhere symmetric: (model parts, points)."""
    s, t, quads = grid(3 * fine, 4 * fine)
    wall = stack(4.5 * s, 0 * s, 3.0 * t)
    u, v, floor = grid(3 * fine, 2 * fine)
    slab = stack(4.5 * u, 2.5 * v, 3.0 + 0 * u)
    column = stack(np.full(2, 4.5), np.full(2, 2.5), np.array([0.0, 1.5]))
    points = np.concatenate([wall, slab, column])
    points, index = np.unique(points.round(9), axis=0, return_inverse=True)
    quads = index[: len(wall)][quads], index[len(wall) : len(wall) + len(slab)][floor]
    top = index[len(wall) + np.flatnonzero((u == 1) & (v == 1))[0]]
    low, middle = index[-2:]
    both = shells(np.concatenate(quads), 0.2, 30e9, 0.2, 2500.0)
    group = np.repeat([0, -1], [len(quads[0]), len(quads[1])])
    parts = {
        "shells": replace(both, group=group, thickness=np.where(group == 0, 0.2, 0.15)),
        "beams": beams([[low, middle], [middle, top]], up=(1.0, 0.4, 0.0), group=1, **SECTION),
    }
    return points, parts
