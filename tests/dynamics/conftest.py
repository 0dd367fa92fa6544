"""Shear chains solved by hand, and a small frame building."""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from femupdate.building import from_document
from femupdate.effects import structure_of
from tests import documents
from tests.chains import Chain


@pytest.fixture(scope="session")
def chain():
    """Four unequal floors."""
    return Chain(np.array([3000.0, 2000.0, 1700.0, 900.0]), np.array([9e6, 5e6, 4e6, 1.5e6]))


@pytest.fixture(scope="session")
def tall_chain():
    """Thirty floors: most modes lie above any grid that is used here."""
    rng = np.random.default_rng(5)
    return Chain(1000.0 * rng.uniform(0.5, 1.5, 30), 1e7 * rng.uniform(0.5, 1.5, 30))


@pytest.fixture(scope="session")
def thetas():
    return np.array([[1.0, 1.0, 1.0, 1.0], [0.5, 2.1, 0.8, 1.3], [2.7, 0.4, 1.9, 0.6]])


@dataclass(frozen=True)
class Frame:
    """A frame building, meshed and assembled."""

    structure: object
    heights: tuple[float, ...]
    story_mass: tuple[float, ...]  # of columns, walls, beams and slab of each story, kg

    @property
    def mesh(self):
        return self.structure.mesh

    @property
    def operators(self):
        return self.structure.operators


@pytest.fixture(scope="session")
def small_frame():
    """Two unequal stories with a wall off the centre, or others: motion couples with torsion."""

    @cache
    def make(mesh_size, heights=(3.4, 2.9)):
        widths, depth = (5.0, 4.0), 6.0
        document = documents.frame(
            {"A": 0.0, "B": 5.0, "C": 9.0},
            {"P": 0.0, "Q": depth},
            {f"S{n}": height for n, height in enumerate(heights, 1)},
            size=mesh_size,
            walls=[{"along": "Q", "from": "A", "to": "B", "thickness": 0.15}],
            slabs=[{"x": ["A", "C"], "y": ["P", "Q"], "thickness": 0.15}],
            sensors={"direction": "x", "points": ["A-P", "C-Q"]},
        )
        structure = structure_of(from_document(document))
        wall = 0.15 * widths[0]
        upright = [2400.0 * h * (6 * 0.4 * 0.6 + wall) for h in heights]
        bars = 2 * sum(widths) + 3 * depth
        flat = 2400.0 * (bars * 0.3 * 0.5 + sum(widths) * depth * 0.15)
        return Frame(structure, heights, tuple(mass + flat for mass in upright))

    return make
