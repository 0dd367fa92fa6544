"""Patch tests of the shell on MacNeal and Harder's distorted patch (1985), in any position."""

import numpy as np
import pytest

from femupdate.fe import assemble, factorize

E, NU, THICKNESS = 1e6, 0.25, 0.001
CORNERS = [(0.0, 0.0), (0.24, 0.0), (0.24, 0.12), (0.0, 0.12)]
INNER = [(0.04, 0.02), (0.18, 0.03), (0.16, 0.08), (0.08, 0.08)]
QUADS = [(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7)]
POINTS = np.array([(*p, 0.0) for p in CORNERS + INNER])
X, Y = POINTS[:, 0], POINTS[:, 1]
# Membrane over bending stiffness is 1e5 here: a turned patch keeps 1e-16 * 1e5 and a little more.
EXACT = 1e-9


def membrane_field():
    """u = 1e-3 (x + y / 2), v = 1e-3 (y + x / 2): no spin."""
    field = np.zeros((8, 6))
    field[:, 0] = 1e-3 * (X + Y / 2)
    field[:, 1] = 1e-3 * (Y + X / 2)
    return field


def spinning_field():
    """An asymmetric gradient: strain and spin together, so that a sign of the rotation shows."""
    field = np.zeros((8, 6))
    field[:, 0] = 1e-3 * (0.7 * X - 1.1 * Y)
    field[:, 1] = 1e-3 * (2.0 * X + 0.4 * Y)
    field[:, 5] = 0.5e-3 * (2.0 + 1.1)
    return field


def bending_field():
    """w = 1e-3 (x^2 + x y + y^2) / 2 with rx = dw/dy and ry = -dw/dx."""
    field = np.zeros((8, 6))
    field[:, 2] = 1e-3 * (X**2 + X * Y + Y**2) / 2
    field[:, 3] = 1e-3 * (Y + X / 2)
    field[:, 4] = -1e-3 * (X + Y / 2)
    return field


def turned(field, rotation):
    return np.concatenate([field[:, :3] @ rotation.T, field[:, 3:] @ rotation.T], axis=1)


def solve_patch(meshes, points, field):
    """Prescribe the field at the four corners, solve for the four nodes inside, (4, 6)."""
    operators = assemble(
        meshes.model(points, shells=meshes.shells(QUADS, THICKNESS, E, NU, density=1.0))
    )
    stiffness = operators.stiffness(np.ones(1))
    inner = np.arange(24, 48)
    outer = np.arange(24)
    force = -stiffness[inner][:, outer] @ field.ravel()[outer]
    solution = factorize(stiffness[inner][:, inner].tocsc()).solve(force)
    return solution.reshape(4, 6)


@pytest.mark.parametrize("make", [membrane_field, spinning_field, bending_field])
@pytest.mark.parametrize("seed", [None, 1, 2])
def test_inner_nodes_follow_the_field_exactly(meshes, make, seed):
    rotation = np.eye(3) if seed is None else meshes.random_rotation(seed)
    field = turned(make(), rotation)
    inner = solve_patch(meshes, POINTS @ rotation.T + 3.0, field)
    size = np.abs(field[:, :3]).max()
    np.testing.assert_allclose(inner[:, :3], field[4:, :3], rtol=0, atol=EXACT * size)
    size /= 0.12  # rotations go with displacements over the patch's height
    np.testing.assert_allclose(inner[:, 3:], field[4:, 3:], rtol=0, atol=EXACT * size)


@pytest.mark.parametrize("seed", [None, 3])
def test_constant_stress_gives_the_exact_energy(meshes, seed):
    rotation = np.eye(3) if seed is None else meshes.random_rotation(seed)
    matrices = meshes.shells(QUADS, THICKNESS, E, NU).matrices(POINTS @ rotation.T)
    elasticity = E / (1 - NU**2) * np.array([[1, NU, 0], [NU, 1, 0], [0, 0, (1 - NU) / 2]])
    area = 0.24 * 0.12
    for make, generalised, rigidity in (
        (membrane_field, [1e-3, 1e-3, 1e-3], THICKNESS),
        (spinning_field, [0.7e-3, 0.4e-3, 0.9e-3], THICKNESS),
        (bending_field, [-1e-3, -1e-3, -1e-3], THICKNESS**3 / 12),
    ):
        values = turned(make(), rotation)[QUADS].reshape(5, 24)
        energy = np.einsum("ni,nij,nj->", values, matrices.stiffness, values)
        expected = rigidity * area * np.dot(generalised, elasticity @ generalised)
        assert energy == pytest.approx(expected, rel=1e-8)


def test_pure_in_plane_bending_of_a_rectangle_is_exact(meshes):
    """One row of QM6 carries linear bending stress: deflection M L^2 / (2 E I)."""
    s, t, quads = meshes.grid(3, 1)
    points = np.stack([3 * s, 0.5 * t, 0 * s], axis=1)
    fixed = meshes.hold(len(s), (s == 0, (0,)), ((s == 0) & (t == 0), (1,)), (s >= 0, (2, 3, 4)))
    load = np.zeros((len(s), 6))
    load[s == 1, 0] = np.where(t[s == 1] > 0.5, -1.0, 1.0)
    shells = meshes.shells(quads, 0.1, 2e5, 0.3)
    u = meshes.displacement(meshes.model(points, fixed, shells=shells), load)
    inertia = 0.1 * 0.5**3 / 12
    # Moment of the couple 1 x 0.5; the rotations stay free to follow, so nothing stiffens.
    expected = 0.5 * 3.0**2 / (2 * 2e5 * inertia)
    assert u[s == 1, 1].mean() == pytest.approx(expected, rel=1e-9)
    assert u[s == 1, 5].mean() == pytest.approx(0.5 * 3.0 / (2e5 * inertia), rel=1e-9)
