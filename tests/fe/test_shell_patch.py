"""Patch tests of the shell on MacNeal and Harder's distorted patch (1985), in any position."""

import numpy as np
import pytest
from femupdate.benchmarks.solver import membranes

from tests.fe import meshes

E, NU, THICKNESS = 1e6, 0.25, 0.001
# Membrane over bending stiffness is 1e5 here: a turned patch keeps 1e-16 * 1e5 and a little more.
EXACT = 1e-9


@pytest.mark.parametrize("name", ["membrane", "spin", "bending", "twist"])
@pytest.mark.parametrize("seed", [1, 2])
def test_inner_nodes_follow_the_field_exactly(name, seed):
    assert membranes.patch_error(name, meshes.random_rotation(seed)) < EXACT


@pytest.mark.parametrize("seed", [None, 3])
def test_constant_stress_gives_the_exact_energy(seed):
    rotation = np.eye(3) if seed is None else meshes.random_rotation(seed)
    shells = meshes.shells(membranes.PATCH_QUADS, THICKNESS, E, NU)
    matrices = shells.matrices(membranes.PATCH @ rotation.T)
    elasticity = E / (1 - NU**2) * np.array([[1, NU, 0], [NU, 1, 0], [0, 0, (1 - NU) / 2]])
    area = 0.24 * 0.12
    for name, generalised, rigidity in (
        ("membrane", [1e-3, 1e-3, 1e-3], THICKNESS),
        ("spin", [0.7e-3, 0.4e-3, 0.9e-3], THICKNESS),
        ("bending", [-1e-3, -1e-3, -1e-3], THICKNESS**3 / 12),
    ):
        field = membranes.turned(membranes.patch_field(name), rotation)
        values = field[membranes.PATCH_QUADS].reshape(5, 24)
        energy = np.einsum("ni,nij,nj->", values, matrices.stiffness, values)
        expected = rigidity * area * np.dot(generalised, elasticity @ generalised)
        assert energy == pytest.approx(expected, rel=1e-8)


def test_pure_in_plane_bending_of_a_rectangle_is_exact():
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
