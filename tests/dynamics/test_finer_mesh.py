"""A reduced model on a finer mesh, against the full equations of that mesh."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from femupdate.dynamics import ReductionTarget, on_finer_mesh, on_nodes_of, reduce_structure
from femupdate.dynamics.snapshots import log_even_samples
from femupdate.effects import structure_of

GRID = 0.2 * np.arange(1, 151)
TARGET = ReductionTarget(np.full(2, 1 / 3), np.full(2, 3.0), GRID, 0.01, 0.02, 16)


@pytest.fixture(scope="module")
def coarse(small_frame):
    return small_frame(2.0).structure


@pytest.fixture(scope="module")
def fine(coarse):
    return structure_of(coarse.building, halved=True)


@pytest.fixture(scope="module")
def carried(coarse, fine):
    thetas = log_even_samples(replace(TARGET, samples=20))
    return on_finer_mesh(coarse.mesh, reduce_structure(coarse, TARGET).model, fine, TARGET, thetas)


def driven(squared, modes, floors, force):
    """Frequencies, Hz, of modes below the top of the grid, and what the floors show of them."""
    shown = (floors @ modes) * (modes.T @ force)
    size = np.abs(shown).max(axis=0)
    kept = (size > 0.05 * size.max()) & (squared < (2 * np.pi * GRID[-1]) ** 2)
    return np.sqrt(squared[kept]) / (2 * np.pi), shown[:, kept]


@pytest.mark.parametrize("theta", [(1.0, 1.0), (0.41, 2.3), (2.7, 0.9)])
def test_its_modes_are_those_of_the_finer_mesh(coarse, fine, carried, theta):
    theta = np.array(theta)
    K, M = fine.stiffness(theta).toarray(), fine.mass.toarray()
    own, shown = driven(*eigh(K, M), fine.floor_rows, fine.rigid_force[:, 0])
    model = carried.model
    found = driven(*np.linalg.eigh(model.stiffness(theta)), model.floor_shapes, model.excitation)
    K, M = coarse.stiffness(theta).toarray(), coarse.mass.toarray()
    before, _ = driven(*eigh(K, M), coarse.floor_rows, coarse.rigid_force[:, 0])
    assert len(own) == len(found[0]) >= 2
    # On no more shapes than the coarse one has they err by 2.6e-4 and .0026.
    np.testing.assert_allclose(found[0], own, rtol=2e-4)
    np.testing.assert_allclose(found[1], shown, atol=1e-3 * np.abs(shown).max())
    assert before[0] > 1.002 * own[0]  # the coarse mesh is farther off by far
    nodes = coarse.mesh.model.nodes
    np.testing.assert_array_equal(fine.mesh.model.nodes[: len(nodes)], nodes)
    seen = on_nodes_of(coarse.mesh, carried).node_shapes
    np.testing.assert_array_equal(seen, model.node_shapes[: len(nodes)])
