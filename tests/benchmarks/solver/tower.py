"""The building of the speed comparison: 5 x 3 bays of 6 m, six stories of 3.5 m, five walls.

Slabs of 0.20 m, walls of 0.30 m in a core of three and two at the ends, beams of 0.3 m x 0.6 m on
all grid lines, columns of 0.6 m x 0.6 m where no wall stands; concrete of 30 GPa, 2500 kg/m3.
"""

from typing import Any

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.fe import FiniteElementModel

from .meshes import ALL, beams, grid, hold, model, shells

BAYS_X, BAYS_Y, STORIES = 5, 3, 6
BAY, STORY = 6.0, 3.5
SIZES = {"small": 4, "medium": 9, "large": 17}  # elements a bay: 1680, 8640 and 31110 shells
# Ends of the walls on the grid.
_WALLS = (((2, 1), (3, 1)), ((2, 1), (2, 2)), ((3, 1), (3, 2)), ((0, 1), (0, 2)), ((5, 1), (5, 2)))
_CONCRETE: dict[str, Any] = {"youngs_modulus": 30e9, "poisson_ratio": 0.2, "density": 2500.0}


def tower(per_bay: int) -> FiniteElementModel:
    """The building with that many elements a bay; one stiffness parameter scales all of it."""
    parts = [_slab(per_bay, level) for level in range(1, STORIES + 1)]
    walls = [_wall(per_bay, ends, story) for ends in _WALLS for story in range(STORIES)]
    lines = [
        _line(per_bay, *ends, STORY * level)
        for level in range(1, STORIES + 1)
        for ends in _grid_lines()
    ]
    columns = [_column(place, story) for place in _columns() for story in range(STORIES)]
    everything = [*parts, *walls, *lines, *columns]
    counts = np.cumsum([0, *(len(points) for points, _ in everything)])
    points = np.concatenate([points for points, _ in everything])
    nodes, index = np.unique(points.round(6), axis=0, return_inverse=True)
    elements = [
        index.ravel()[start + each] for start, (_, each) in zip(counts, everything, strict=False)
    ]
    first, second, third = np.cumsum([len(parts), len(walls), len(lines)])
    quads = np.concatenate(elements[:second])
    thickness = np.where(np.arange(len(quads)) < sum(map(len, elements[:first])), 0.20, 0.30)
    pairs = np.concatenate(elements[second:])
    along = np.arange(len(pairs)) < sum(map(len, elements[second:third]))
    return model(
        nodes,
        hold(len(nodes), (nodes[:, 2] == 0.0, ALL)),
        shells=shells(quads, thickness, 30e9, 0.2, 2500.0),
        beams=beams(
            pairs,
            up=np.where(along[:, None], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]),
            **_section(np.where(along, 0.3, 0.6), 0.6),
            **_CONCRETE,
        ),
    )


def _section(width: Floats, depth: float) -> dict[str, Any]:
    """Full rectangles; torsion by Saint-Venant's approximation (Roark)."""
    area = width * depth
    ratio = width / depth
    return {
        "area": area,
        "shear_area_y": area / 1.2,
        "shear_area_z": area / 1.2,
        "inertia_y": width * depth**3 / 12,
        "inertia_z": depth * width**3 / 12,
        "torsion_constant": depth * width**3 * (1 / 3 - 0.21 * ratio * (1 - ratio**4 / 12)),
    }


def _slab(per_bay: int, level: int) -> tuple[Floats, Integers]:
    s, t, quads = grid(per_bay * BAYS_X, per_bay * BAYS_Y)
    return np.stack([BAY * BAYS_X * s, BAY * BAYS_Y * t, 0 * s + STORY * level], axis=1), quads


def _wall(
    per_bay: int, ends: tuple[tuple[int, int], tuple[int, int]], story: int
) -> tuple[Floats, Integers]:
    s, t, quads = grid(per_bay, max(1, round(per_bay * STORY / BAY)))
    foot = BAY * (np.outer(1 - s, ends[0]) + np.outer(s, ends[1]))
    return np.column_stack([foot, STORY * (story + t)]), quads


def _grid_lines() -> list[tuple[tuple[int, int], tuple[int, int]]]:
    along_x = [((i, j), (i + 1, j)) for i in range(BAYS_X) for j in range(BAYS_Y + 1)]
    along_y = [((i, j), (i, j + 1)) for i in range(BAYS_X + 1) for j in range(BAYS_Y)]
    return along_x + along_y


def _line(
    per_bay: int, first: tuple[int, int], second: tuple[int, int], height: float
) -> tuple[Floats, Integers]:
    s = np.linspace(0, 1, per_bay + 1)
    plan = BAY * (np.outer(1 - s, first) + np.outer(s, second))
    number = np.arange(per_bay)
    return np.column_stack([plan, 0 * s + height]), np.stack([number, number + 1], axis=1)


def _columns() -> list[tuple[int, int]]:
    walls = {place for ends in _WALLS for place in ends}
    return [(i, j) for i in range(BAYS_X + 1) for j in range(BAYS_Y + 1) if (i, j) not in walls]


def _column(place: tuple[int, int], story: int) -> tuple[Floats, Integers]:
    plan = BAY * np.array([place, place], dtype=float)
    return np.column_stack([plan, STORY * np.array([story, story + 1])]), np.array([[0, 1]])
