"""Shells against closed forms: one element, patches of them, and strips."""

import numpy as np
import pytest
from femupdate.benchmarks.solver import membranes
from hypothesis import given, settings
from hypothesis import strategies as st

from femupdate.errors import StructureError
from femupdate.fe import Shells
from tests.fe import meshes

E, NU, DENSITY = 3.0e10, 0.2, 2500.0
SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
# Corners moved by up to 0.2 of the side leave every quadrilateral convex.
nudges = st.lists(st.floats(-0.2, 0.2), min_size=8, max_size=8)
heights = st.floats(-0.1, 0.1)
sides = st.floats(0.2, 5.0)
thicknesses = st.floats(0.03, 0.3)
seeds = st.integers(0, 10_000)


def quadrilateral(nudge, height, side, rotation):
    corners = SQUARE.copy()
    corners[:, :2] += np.reshape(nudge, (4, 2))
    corners[:, 2] += height * np.array([1, -1, 1, -1])
    return (corners * [side, 1.0, 1.0]) @ rotation.T + [3.0, -2.0, 7.0]


def shells(count, thickness, modulus, poisson, density, nodes=None):
    """Shells on nodes of their own, with one value for all or one each."""
    every = {"youngs_modulus": modulus, "poisson_ratio": poisson, "density": density}
    return Shells(
        nodes=np.arange(4 * count).reshape(-1, 4) if nodes is None else nodes,
        thickness=thickness * np.ones(count),
        group=np.zeros(count, dtype=np.int64),
        kind=np.full(count, "wall"),
        **{name: value * np.ones(count) for name, value in every.items()},
    )


def matrices(corners, thickness):
    return shells(1, thickness, E, NU, DENSITY).matrices(corners)


def rigid_modes(corners):
    modes = np.zeros((4, 6, 6))
    modes[:, [0, 1, 2], [0, 1, 2]] = 1.0
    modes[:, [3, 4, 5], [3, 4, 5]] = 1.0
    arm = corners - corners.mean(axis=0)
    for axis in range(3):
        modes[:, :3, 3 + axis] = np.cross(np.eye(3)[axis], arm)
    return modes.reshape(24, 6)


@given(nudge=nudges, height=heights, side=sides, thickness=thicknesses, seed=seeds)
@settings(max_examples=150, deadline=None)
def test_six_rigid_modes_and_no_more(nudge, height, side, thickness, seed):
    corners = quadrilateral(nudge, height, side, meshes.random_rotation(seed))
    stiffness = matrices(corners, thickness).stiffness[0]
    np.testing.assert_array_equal(stiffness, stiffness.T)
    modes = rigid_modes(corners)
    # Rounding: 24 terms of the largest entry.
    assert np.abs(stiffness @ modes).max() < 1e-12 * np.abs(stiffness).max() * np.abs(modes).max()
    scale = 1 / np.sqrt(np.diag(stiffness))
    values = np.linalg.eigvalsh(scale[:, None] * stiffness * scale)
    assert np.abs(values[:6]).max() < 1e-13
    # The softest strain pattern is bending: (t / side)^2 of the rest, at least 1e-5 here.
    assert values[6] > 1e-7


@given(nudge=nudges, side=sides, thickness=thicknesses, seed=seeds)
@settings(max_examples=100, deadline=None)
def test_mass_of_a_flat_shell(nudge, side, thickness, seed):
    """Mass, centre of mass and moments of inertia of a solid plate of that outline."""
    corners = quadrilateral(nudge, 0.0, side, meshes.random_rotation(seed))
    mass = matrices(corners, thickness).mass[0]
    modes = rigid_modes(corners)
    rigid = modes.T @ mass @ modes
    area, first, second = outline_moments(corners)
    total = DENSITY * thickness * area
    normal = np.cross(corners[1] - corners[0], corners[3] - corners[0])
    normal /= np.linalg.norm(normal)
    np.testing.assert_allclose(rigid[:3, :3], total * np.eye(3), atol=1e-10 * total)
    # Linear momentum of a turn about the corners' mean is total * (axis x centre of mass).
    moment = DENSITY * thickness * first
    expected = np.array([np.cross(axis, moment) for axis in np.eye(3)]).T
    np.testing.assert_allclose(rigid[:3, 3:], expected, atol=1e-10 * total * side)
    thin = DENSITY * thickness * (np.trace(second) * np.eye(3) - second)
    rotary = total * thickness**2 / 12
    # About in-plane axes rho t^3 / 12; about the normal only the hundredth of it that keeps the
    # drilling rotation from being massless.
    thick = rotary * (np.eye(3) - 0.99 * np.outer(normal, normal))
    np.testing.assert_allclose(rigid[3:, 3:], thin + thick, atol=1e-9 * total * max(side, 1) ** 2)
    assert np.linalg.eigvalsh(mass).min() > 0.0


def outline_moments(corners):
    """Area, first and second moments about the corners' mean, from two triangles."""
    arm = corners - corners.mean(axis=0)
    area, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for triangle in (arm[[0, 1, 2]], arm[[0, 2, 3]]):
        size = 0.5 * np.linalg.norm(np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0]))
        middles = 0.5 * (triangle + np.roll(triangle, 1, axis=0))  # exact for quadratics
        area += size
        first += size * middles.mean(axis=0)
        second += size * middles.T @ middles / 3
    return area, first, second


@given(nudge=nudges, height=heights, seed=seeds, start=st.integers(1, 3))
@settings(max_examples=80, deadline=None)
def test_numbering_and_position_do_not_matter(nudge, height, seed, start):
    """Same element from another first node, other side up, and turned in space."""
    corners = quadrilateral(nudge, height, 1.7, np.eye(3))
    reference = matrices(corners, 0.1)
    rotation = meshes.random_rotation(seed)
    turn = np.kron(np.eye(8), rotation)
    moved = matrices(corners @ rotation.T, 0.1)
    for order in (np.roll(np.arange(4), start), np.arange(4)[::-1]):
        index = (6 * order[:, None] + np.arange(6)).ravel()
        renumbered = matrices(corners[order], 0.1)
        for name in ("stiffness", "mass"):
            wanted = getattr(reference, name)[0]
            size = np.abs(wanted).max()
            got = getattr(renumbered, name)[0]
            np.testing.assert_allclose(got, wanted[np.ix_(index, index)], atol=1e-12 * size)
            turned = turn @ wanted @ turn.T
            np.testing.assert_allclose(getattr(moved, name)[0], turned, atol=1e-12 * size)


def test_a_batch_equals_its_elements():
    corners = np.stack(
        [quadrilateral(np.linspace(-0.1, 0.15, 8) * k, 0.05 * k, k, np.eye(3)) for k in (1, 2, 3)]
    )
    thickness, modulus = np.array([0.1, 0.2, 0.3]), E * np.array([1.0, 1.5, 0.5])
    poisson, density = np.array([0.1, 0.2, 0.3]), np.array([2500.0, 0.0, 7800.0])
    batch = shells(3, thickness, modulus, poisson, density).matrices(corners.reshape(-1, 3))
    for k in range(3):
        one = shells(1, thickness[k], modulus[k], poisson[k], density[k])
        single = one.matrices(corners[k])
        np.testing.assert_allclose(batch.stiffness[k], single.stiffness[0], rtol=1e-12, atol=1e-3)
        np.testing.assert_allclose(batch.mass[k], single.mass[0], rtol=1e-12, atol=1e-9)


SHAPES = {
    "bow tie": [[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0]],
    "concave": [[0, 0, 0], [1, 0, 0], [0.2, 0.2, 0], [0, 1, 0]],
    "double node": [[0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0]],
    "line": [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]],
    "point": [[1, 2, 3]] * 4,
    "triangle with a node in its side": [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]],
}


@pytest.mark.parametrize("shape", SHAPES)
def test_an_impossible_shape_is_refused_by_name(shape):
    points, numbers = np.zeros((93, 3)), np.array([[0, 1, 2, 3], [14, 15, 92, 65]])
    points[numbers[0]] = SQUARE
    points[numbers[1]] = np.array(SHAPES[shape], dtype=float) @ meshes.random_rotation(5).T
    with pytest.raises(StructureError, match=r"shell 1 \(nodes 14, 15, 92, 65\).*convex"):
        shells(2, 0.1, E, NU, 1.0, nodes=numbers).matrices(points)


@pytest.mark.parametrize(
    ("name", "position", "value"),
    [
        ("thickness", 0, 0.0),
        ("thickness", 0, np.nan),
        ("Young's modulus", 1, -1.0),
        ("Poisson's ratio", 2, 0.51),
        ("density", 3, -1.0),
        ("density", 3, np.inf),
    ],
)
def test_an_impossible_property_is_refused_by_name(name, position, value):
    properties = [np.full(2, v) for v in (0.1, E, NU, DENSITY)]
    properties[position][1] = value
    with pytest.raises(StructureError, match=rf"shell 1 \(nodes 4, 5, 6, 7\) has {name}"):
        shells(2, *properties).matrices(np.concatenate([SQUARE, SQUARE + 1]))


MODULUS, POISSON, THICKNESS = 1e6, 0.25, 0.001
# Membrane over bending stiffness is 1e5 here: a turned patch keeps 1e-16 * 1e5 and a little more.
EXACT = 1e-9


@pytest.mark.parametrize("name", ["membrane", "spin", "bending", "twist"])
@pytest.mark.parametrize("seed", [1, 2])
def test_inner_nodes_follow_the_field_exactly(name, seed):
    assert membranes.patch_error(name, meshes.random_rotation(seed)) < EXACT


@pytest.mark.parametrize("seed", [None, 3])
def test_constant_stress_gives_the_exact_energy(seed):
    rotation = np.eye(3) if seed is None else meshes.random_rotation(seed)
    shells = meshes.shells(membranes.PATCH_QUADS, THICKNESS, MODULUS, POISSON)
    matrices = shells.matrices(membranes.PATCH @ rotation.T)
    elasticity = (
        MODULUS
        / (1 - POISSON**2)
        * np.array([[1, POISSON, 0], [POISSON, 1, 0], [0, 0, (1 - POISSON) / 2]])
    )
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


CONCRETE = 30e9


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("thickness", [0.01, 0.5])
def test_a_strip_in_cylindrical_bending_is_exact_as_a_beam_is(count, thickness):
    """Timoshenko's cantilever under a force at its end, without Poisson's effect."""
    length, width, force = 2.0, 0.7, 3.0
    s, t, quads = meshes.grid(count, 1)
    points = meshes.stack(length * s, width * t, 0 * s)
    held = meshes.hold(len(s), (s == 0, range(6)), (s >= 0, (3, 5)))
    model = meshes.model(points, held, shells=meshes.shells(quads, thickness, CONCRETE, 0.0))
    load = meshes.zeros(len(s))
    load[s == 1, 2] = 0.5 * force
    bending = CONCRETE * width * thickness**3 / 12
    shear = 5 / 6 * width * thickness * CONCRETE / 2
    expected = force * (length**3 / (3 * bending) + length / shear)
    np.testing.assert_allclose(meshes.displacement(model, load)[s == 1, 2], expected, rtol=1e-9)
