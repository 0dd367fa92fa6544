"""Modes, static displacement and factorisation."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csc_matrix, diags

from femupdate.errors import StructureError
from femupdate.fe import (
    PointMasses,
    Springs,
    assemble,
    factorize,
    lowest_modes,
    modes_below,
    static_displacement,
)
from tests.fe import meshes

ONE = np.ones(1)


def spring_chain(stiffness, mass, direction=0):
    """Masses in a row on springs from the ground, free along one direction only."""
    count = len(mass)
    fixed = np.ones((count, 6), dtype=bool)
    fixed[:, direction] = False
    springs = Springs(
        nodes=np.stack([np.arange(count), np.arange(-1, count - 1)], axis=1),
        direction=np.full(count, direction),
        stiffness=np.asarray(stiffness, dtype=float),
        group=np.zeros(count, dtype=np.int64),
    )
    masses = PointMasses(
        np.arange(count), np.asarray(mass, float), np.tile([7.0, 11.0, 13.0], (count, 1))
    )
    points = meshes.stack(np.arange(count), 0 * np.arange(count), 0 * np.arange(count))
    return meshes.model(points, fixed, springs=springs, masses=masses)


@pytest.mark.parametrize(("direction", "inertia"), [(0, 250.0), (2, 250.0), (3, 7.0), (5, 13.0)])
def test_one_mass_on_a_spring(direction, inertia):
    modes = lowest_modes(assemble(spring_chain([4e5], [250.0], direction)), ONE, 1)
    assert modes.frequency_hz == pytest.approx([np.sqrt(4e5 / inertia) / (2 * np.pi)], rel=1e-12)
    assert modes.shapes == pytest.approx(np.array([[1 / np.sqrt(inertia)]]), rel=1e-12)


def test_two_masses_against_the_textbook():
    k, m = np.array([3e5, 1e5]), np.array([200.0, 90.0])
    operators = assemble(spring_chain(k, m))
    values, vectors = eigh([[k.sum(), -k[1]], [-k[1], k[1]]], np.diag(m))
    modes = lowest_modes(operators, ONE, 2)
    assert modes.frequency_hz == pytest.approx(np.sqrt(values) / (2 * np.pi), rel=1e-12)
    np.testing.assert_allclose(np.abs(modes.shapes), np.abs(vectors), rtol=1e-10)
    assert (modes.shapes[np.abs(modes.shapes).argmax(axis=0), [0, 1]] > 0).all()


@pytest.fixture(scope="module")
def plate():
    """A cantilever plate of 1 188 free degrees of freedom, enough for the Lanczos method."""
    s, t, quads = meshes.grid(11, 17)
    points = meshes.stack(3 * s, 5 * t, 0.2 * s * t)
    fixed = meshes.hold(len(s), (s == 0, range(6)))
    return meshes.model(points, fixed, shells=meshes.shells(quads, 0.1, 30e9, 0.2, 2500.0))


@pytest.fixture(scope="module")
def plate_operators(plate):
    return assemble(plate)


def test_lanczos_agrees_with_a_dense_solution(plate_operators):
    modes = lowest_modes(plate_operators, ONE, 12)
    stiffness, mass = plate_operators.stiffness(ONE), plate_operators.mass
    values = eigh(stiffness.toarray(), mass.toarray(), eigvals_only=True)[:12]
    np.testing.assert_allclose(modes.frequency_hz, np.sqrt(values) / (2 * np.pi), rtol=1e-7)
    np.testing.assert_allclose(modes.shapes.T @ mass @ modes.shapes, np.eye(12), atol=1e-8)
    omega2 = (2 * np.pi * modes.frequency_hz) ** 2
    energy = modes.shapes.T @ stiffness @ modes.shapes
    np.testing.assert_allclose(energy, np.diag(omega2), atol=1e-7 * omega2.max())
    largest = np.abs(modes.shapes).argmax(axis=0)
    assert (modes.shapes[largest, np.arange(12)] > 0).all()


def equal_masts(count):
    """Masts that stand apart and are all alike, each a chain of springs: all modes are repeated."""
    each = 60
    number = np.arange(count * each).reshape(count, each)
    below = np.where(np.arange(each) == 0, -1, number - 1)
    directions = np.repeat([0, 1, 2], number.size)
    springs = Springs(
        nodes=np.tile(np.stack([number.ravel(), below.ravel()], axis=1), (3, 1)),
        direction=directions,
        stiffness=np.full(3 * number.size, 2e6),
        group=np.zeros(3 * number.size, dtype=np.int64),
    )
    inertia = np.zeros((number.size, 3))
    masses = PointMasses(number.ravel(), np.full(number.size, 50.0), inertia)
    fixed = np.tile([False] * 3 + [True] * 3, (number.size, 1))
    points = meshes.stack(*np.divmod(np.arange(number.size), each), np.zeros(number.size))
    return assemble(meshes.model(points, fixed, springs=springs, masses=masses))


@pytest.mark.parametrize("count", [1, 9, 20, 40])
def test_repeated_modes_are_all_found(count):
    """Four masts swing alike in three directions: every frequency occurs twelve times."""
    operators = equal_masts(4)
    assert len(operators.free) == 720  # beyond what is solved densely
    modes = lowest_modes(operators, ONE, count)
    chain = 2.0 * np.sqrt(2e6 / 50.0) / (2.0 * np.pi)
    each = chain * np.sin((2 * np.arange(4) + 1) * np.pi / (2 * (2 * 60 + 1)))
    np.testing.assert_allclose(modes.frequency_hz, np.repeat(each, 12)[:count], rtol=1e-9)
    overlap = modes.shapes.T @ operators.mass @ modes.shapes
    np.testing.assert_allclose(overlap, np.eye(count), atol=1e-6)


@pytest.mark.parametrize("shift", [-0.1, -5.0, -50.0])
def test_a_shift_changes_nothing(plate_operators, shift):
    plain = lowest_modes(plate_operators, ONE, 6)
    shifted = lowest_modes(plate_operators, ONE, 6, shift_hz=shift)
    np.testing.assert_allclose(shifted.frequency_hz, plain.frequency_hz, rtol=1e-7)
    np.testing.assert_allclose(shifted.shapes, plain.shapes, atol=1e-5 * np.abs(plain.shapes).max())


def test_six_zero_frequencies_of_a_free_structure():
    points, parts = meshes.frame_with_wall()
    rotation = meshes.random_rotation(8)
    up = parts["beams"].up @ rotation.T
    parts["beams"] = replace(parts["beams"], up=up)
    operators = assemble(meshes.model(points @ rotation.T, groups=2, **parts))
    modes = lowest_modes(operators, np.ones(2), 8, shift_hz=-1.0)
    assert modes.frequency_hz[:6].max() < 1e-3
    assert modes.frequency_hz[6] > 1.0
    # They span the rigid motions: translations come back from them with their whole mass.
    for direction in range(3):
        motion = operators.rigid_translation(direction)
        share = modes.shapes[:, :6].T @ operators.mass @ motion
        assert share @ share == pytest.approx(motion @ operators.mass @ motion, rel=1e-8)


def test_static_displacement_is_symmetric_and_linear(plate, plate_operators):
    """Maxwell and Betti: displacement at j under a force at i equals that at i under one at j."""
    i, j = 6 * 150 + 2, 6 * 60 + 1
    loads = np.zeros((plate.dof, 2))
    loads[i, 0] = loads[j, 1] = 1e4
    u = static_displacement(plate_operators, ONE, loads)
    assert u.shape == loads.shape
    assert u[j, 0] == pytest.approx(u[i, 1], rel=1e-7)
    assert not u[plate.fixed.ravel()].any()
    single = static_displacement(plate_operators, 2.0 * ONE, loads[:, 0])
    np.testing.assert_allclose(2.0 * single, u[:, 0], atol=1e-9 * np.abs(u[:, 0]).max())


@pytest.mark.parametrize("kind", ["definite", "indefinite", "complex", "zero diagonal"])
def test_factorize_solves_symmetric_systems(kind):
    rng = np.random.default_rng(5)
    dense = rng.standard_normal((40, 40))
    dense = dense @ dense.T + 40 * np.eye(40)
    if kind == "indefinite":
        dense -= 90 * np.diag(rng.uniform(size=40))
    if kind == "complex":
        dense = dense * (1 + 0.02j) - 60 * np.eye(40)
    if kind == "zero diagonal":
        np.fill_diagonal(dense, 0.0)
    rhs = rng.standard_normal((40, 3))
    solution = factorize(csc_matrix(dense)).solve(rhs)
    np.testing.assert_allclose(solution, np.linalg.solve(dense, rhs), rtol=1e-8)


def test_pivots_count_negative_eigenvalues():
    matrix = diags([np.full(50, 2.0), -np.ones(49), -np.ones(49)], [0, 1, -1]).tocsc()
    values = np.linalg.eigvalsh(matrix.toarray())
    shifted = (matrix - 1.1 * diags(np.ones(50))).tocsc()
    pivots = factorize(shifted).pivots()
    assert (pivots < 0).sum() == (values < 1.1).sum()


def test_factorize_refuses_a_singular_matrix():
    with pytest.raises(StructureError, match="singular"):
        factorize(csc_matrix(np.ones((3, 3))))


def test_pivots_of_an_indefinite_matrix_are_counted(plate_operators):
    stiffness, mass = plate_operators.stiffness(ONE), plate_operators.mass
    modes = lowest_modes(plate_operators, ONE, 4).frequency_hz
    between = (2 * np.pi) ** 2 * modes[2] * modes[3]
    pivots = factorize((stiffness - between * mass).tocsc()).pivots()
    assert np.count_nonzero(pivots < 0) == 3


def test_modes_below_take_a_factorisation_that_is_there(plate_operators):
    plain = modes_below(plate_operators, ONE, 60.0)
    known = factorize(plate_operators.stiffness(ONE))
    again = modes_below(plate_operators, ONE, 60.0, known)
    np.testing.assert_allclose(again.frequency_hz, plain.frequency_hz, rtol=1e-9)
