"""A wall and a coupled wall in their own planes: what buildings ask of a membrane."""

from dataclasses import replace

import numpy as np

from femupdate.arrays import Floats
from femupdate.fe import FiniteElementModel, assemble, lowest_modes

from .meshes import (
    ALL,
    RX,
    RZ,
    UX,
    UY,
    displacement,
    grid,
    hold,
    line_weights,
    model,
    shells,
    stack,
    zeros,
)

E, NU, THICKNESS, DENSITY = 30e9, 0.2, 0.3, 2500.0
WIDTH, HEIGHT, STORIES, STORY = 6.0, 21.0, 6, 3.5


def plain_wall(columns: int, rows: int) -> float:
    """Wall 6 m x 21 m x 0.3 m under 1 MN at its top: displacement of the top, m."""
    s, t, quads = grid(columns, rows)
    load = zeros(len(s))
    load[:, UX] = 1e6 * line_weights(t == 1, s)
    fixed = hold(len(s), (t == 0, ALL))
    points = stack(WIDTH * s, 0 * s, HEIGHT * t)
    u = displacement(model(points, fixed, shells=shells(quads, THICKNESS, E, NU)), load)
    return float(u[t == 1, UX].mean())


def timoshenko_wall() -> float:
    """The same by beam theory with a shear area of 5/6 of the section (Timoshenko 1921), m."""
    area, inertia, shear_modulus = THICKNESS * WIDTH, THICKNESS * WIDTH**3 / 12, E / (2 + 2 * NU)
    return 1e6 * (HEIGHT**3 / (3 * E * inertia) + HEIGHT / (shear_modulus * area / 1.2))


def coupled_wall(fine: int) -> FiniteElementModel:
    """Piers of 2.4 m and lintels of 0.7 m over openings of 2.4 m, six stories of 3.5 m."""
    s, t, quads = grid(6 * fine, 30 * fine)
    centre = stack(s, t)[quads].mean(axis=1)
    opening = (np.abs(centre[:, 0] - 0.5) < 1 / 6) & (STORIES * centre[:, 1] % 1 < 0.8)
    used, numbers = np.unique(quads[~opening], return_inverse=True)
    s, t = s[used], t[used]
    return model(
        stack(7.2 * s, 0 * s, HEIGHT * t),
        hold(len(s), (t == 0, ALL)),
        shells=shells(numbers.reshape(-1, 4), THICKNESS, E, NU, DENSITY),
    )


def coupled_wall_top(wall: FiniteElementModel) -> float:
    """Displacement of the roof under 100 kN on every floor line, m."""
    load = zeros(len(wall.nodes))
    for floor in range(1, STORIES + 1):
        line = np.abs(wall.nodes[:, 2] - STORY * floor) < 1e-6
        load[:, UX] += 1e5 * line_weights(line, wall.nodes[:, 0])
    roof = np.abs(wall.nodes[:, 2] - HEIGHT) < 1e-6
    return float(displacement(wall, load)[roof, UX].mean())


def coupled_wall_frequencies(wall: FiniteElementModel) -> Floats:
    """First two frequencies in the plane of the wall, Hz."""
    aside = hold(len(wall.nodes), (wall.nodes[:, 2] > -1, (UY, RX, RZ)))
    flat = replace(wall, fixed=wall.fixed | aside)
    return lowest_modes(assemble(flat), np.ones(1), 2).frequency_hz
