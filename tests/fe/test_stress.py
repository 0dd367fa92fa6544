"""Forces inside shells from fields that are known."""

import numpy as np
import pytest
from femupdate.benchmarks.solver.shell_forces import shell_forces

E, NU, THICKNESS = 2e6, 0.25, 0.1
QUADS = [(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7)]
PLAN = [(0, 0), (0.24, 0), (0.24, 0.12), (0, 0.12)]
PLAN += [(0.04, 0.02), (0.18, 0.03), (0.16, 0.08), (0.08, 0.08)]
X, Y = np.array(PLAN).T
ELASTICITY = E / (1 - NU**2) * np.array([[1, NU, 0], [NU, 1, 0], [0, 0, (1 - NU) / 2]])


def patch(meshes):
    return meshes.model(
        meshes.stack(X, Y, 0 * X), shells=meshes.shells(QUADS, THICKNESS, E, NU), groups=1
    )


def in_global_axes(values, axes):
    """Tensors (x, y, xy) of each element turned from its axes to the global ones."""
    tensor = np.zeros((*values.shape[:2], 2, 2))
    tensor[..., 0, 0], tensor[..., 1, 1] = values[..., 0], values[..., 1]
    tensor[..., 0, 1] = tensor[..., 1, 0] = values[..., 2]
    turn = axes[:, :2, :2]
    turned = np.einsum("nia,ncij,njb->ncab", turn, tensor, turn)
    return np.stack([turned[..., 0, 0], turned[..., 1, 1], turned[..., 0, 1]], axis=-1)


@pytest.mark.parametrize("theta", [1.0, 0.4])
def test_constant_strain_gives_constant_forces(meshes, theta):
    """An asymmetric gradient with its spin, on distorted elements turned against each other."""
    motion = meshes.zeros(8)
    motion[:, 0], motion[:, 1] = 1e-3 * (0.7 * X - 1.1 * Y), 1e-3 * (2.0 * X + 0.4 * Y)
    motion[:, 5] = 1.55e-3
    model = patch(meshes)
    forces = shell_forces(model, motion, np.array([theta]))
    expected = theta * THICKNESS * ELASTICITY @ [0.7e-3, 0.4e-3, 0.9e-3]
    found = in_global_axes(forces.membrane, forces.axes)
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=1e-9)
    assert np.abs(forces.moment).max() < 1e-12


def test_constant_curvature_stretches_the_upper_face_where_the_moment_is_positive(meshes):
    """w = -(x^2 + 3 y^2 + x y) / 2: the plate is a dome, its upper face in tension."""
    motion = meshes.zeros(8)
    motion[:, 2] = -(X**2 + 3 * Y**2 + X * Y) / 2
    motion[:, 3], motion[:, 4] = -(3 * Y + X / 2), X + Y / 2  # rx = w,y and ry = -w,x
    forces = shell_forces(patch(meshes), motion.ravel(), np.ones(1))
    expected = THICKNESS**3 / 12 * ELASTICITY @ [1.0, 3.0, 1.0]
    found = in_global_axes(forces.moment, forces.axes)
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=1e-9)
    upper = in_global_axes(forces.stress(face=1.0), forces.axes)
    assert (upper[..., :2] > 0.0).all()
    np.testing.assert_allclose(forces.stress(face=-1.0), -forces.stress(face=1.0))
