"""The Timoshenko beam against closed forms, with a section that has no symmetry to hide behind."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from femupdate.errors import StructureError
from femupdate.fe import Beams, assemble, static_displacement
from tests.fe import meshes

E, NU, DENSITY = 210e9, 0.3, 7850.0
G = E / (2 * (1 + NU))
SECTION = {
    "area": 0.02,
    "shear_area_y": 0.011,
    "shear_area_z": 0.007,
    "inertia_y": 2.0e-4,
    "inertia_z": 0.5e-4,
    "torsion_constant": 0.9e-4,
    "youngs_modulus": E,
    "poisson_ratio": NU,
    "density": DENSITY,
}
# Bending along local y uses inertia_z and shear_area_y, and the other way round.
PLANES = {1: ("inertia_z", "shear_area_y"), 2: ("inertia_y", "shear_area_z")}
vectors = st.tuples(*[st.floats(-3, 3)] * 3)


def local_axes(direction, up):
    x = direction / np.linalg.norm(direction)
    z = up - (up @ x) * x
    z /= np.linalg.norm(z)
    return np.array([x, np.cross(z, x), z])


def cantilever(length, count, direction=(1.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), **changes):
    direction = np.asarray(direction) / np.linalg.norm(direction)
    points = np.linspace(0, length, count + 1)[:, None] * direction
    fixed = meshes.zeros(count + 1).astype(bool)
    fixed[0] = True
    beams = meshes.beams(meshes.chain(count), up=up, **{**SECTION, **changes})
    return meshes.model(points, fixed, beams=beams)


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize(
    ("direction", "up"),
    [((1, 0, 0), (0, 0, 1)), ((0, 0, 1), (1, 0.3, 0)), ((2.0, -1.0, 1.5), (0.2, 0.1, 1.0))],
)
def test_tip_displacement_is_exact(count, direction, up):
    """Axial, shear with bending, torsion and end moments, each in the beam's own axes."""
    length, axes = 2.5, local_axes(np.array(direction, float), np.array(up, float))
    model = cantilever(length, count, direction, up)

    def tip(component, value):
        load = meshes.zeros(count + 1)
        part = slice(0, 3) if component < 3 else slice(3, 6)
        load[-1, part] = value * axes[component % 3]
        u = meshes.displacement(model, load)[-1]
        return np.concatenate([axes @ u[:3], axes @ u[3:]])

    expected = np.zeros((6, 6))
    expected[0, 0] = length / (E * SECTION["area"])
    expected[3, 3] = length / (G * SECTION["torsion_constant"])
    for along, about, sign in ((1, 5, 1.0), (2, 4, -1.0)):
        inertia, shear_area = (SECTION[name] for name in PLANES[along])
        expected[along, along] = length**3 / (3 * E * inertia) + length / (G * shear_area)
        expected[about, about] = length / (E * inertia)
        expected[along, about] = expected[about, along] = sign * length**2 / (2 * E * inertia)
    found = np.array([tip(component, 1.0) for component in range(6)])
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("along", [1, 2])
def test_infinite_shear_area_gives_euler_bernoulli(along):
    inertia, shear_area = PLANES[along]
    model = cantilever(2.5, 1, **{shear_area: np.inf})
    load = meshes.zeros(2)
    load[1, along] = 1.0
    expected = 2.5**3 / (3 * E * SECTION[inertia])
    assert meshes.displacement(model, load)[1, along] == pytest.approx(expected, rel=1e-10)


def shape_mass(length, inertia, shear_area):
    """Mass of deflection and rotation by exact integration of the static shapes, (4, 4)."""
    flexibility = E * inertia / (G * shear_area)
    deflections = [Polynomial.basis(k) for k in range(4)]
    # From the equilibrium of shear and moment: rotation = w' + (E I / G A_s) w'''.
    rotations = [w.deriv() + flexibility * w.deriv(3) for w in deflections]
    ends = np.array(
        [[w(0), r(0), w(length), r(length)] for w, r in zip(deflections, rotations, strict=True)]
    )
    coefficients = np.linalg.inv(ends)
    mass = np.zeros((4, 4))
    for weight, fields in ((SECTION["area"], deflections), (inertia, rotations)):
        shapes = [sum(c * f for c, f in zip(row, fields, strict=True)) for row in coefficients]
        for i, first in enumerate(shapes):
            for j, second in enumerate(shapes):
                mass[i, j] += DENSITY * weight * (first * second).integ()(length)
    return mass


@pytest.mark.parametrize("length", [0.2, 1.0, 8.0])
@pytest.mark.parametrize("along", [1, 2])
def test_mass_is_that_of_the_static_shapes(length, along):
    beams = meshes.beams([[0, 1]], **SECTION)
    mass = beams.matrices(np.array([[0.0, 0, 0], [length, 0, 0]])).mass[0]
    inertia, shear_area = (SECTION[name] for name in PLANES[along])
    index = np.array([1, 5, 7, 11]) if along == 1 else np.array([2, 4, 8, 10])
    sign = np.array([1, 1, 1, 1]) if along == 1 else np.array([1, -1, 1, -1])
    wanted = np.outer(sign, sign) * shape_mass(length, inertia, shear_area)
    np.testing.assert_allclose(mass[np.ix_(index, index)], wanted, rtol=1e-9)


@given(start=vectors, way=vectors, up=vectors)
@settings(max_examples=100, deadline=None)
def test_rigid_motion_and_momentum_in_any_position(start, way, up):
    start, way, up = (np.array(v) for v in (start, way, up))
    length = np.linalg.norm(way)
    if length < 0.1 or np.linalg.norm(np.cross(way, up)) < 1e-2:
        return
    ends = np.stack([start, start + way])
    matrices = meshes.beams([[0, 1]], up=up, **SECTION).matrices(ends)
    modes = np.zeros((2, 6, 6))
    modes[:, range(6), range(6)] = 1.0
    for axis in range(3):
        modes[:, :3, 3 + axis] = np.cross(np.eye(3)[axis], ends)
    modes = modes.reshape(12, 6)
    stiffness, mass = matrices.stiffness[0], matrices.mass[0]
    assert np.abs(stiffness @ modes).max() < 1e-11 * np.abs(stiffness).max() * np.abs(modes).max()
    scale = 1 / np.sqrt(np.diag(stiffness))
    values = np.linalg.eigvalsh(scale[:, None] * stiffness * scale)
    assert np.abs(values[:6]).max() < 1e-12
    assert values[6] > 1e-6
    total = DENSITY * SECTION["area"] * length
    rigid = modes.T @ mass @ modes
    axes = local_axes(way, up)
    centre = ends.mean(axis=0)
    polar = SECTION["inertia_y"] + SECTION["inertia_z"]
    # A slender solid: thin rod, and the section's inertia about each local axis.
    own = np.diag([polar, SECTION["inertia_y"], SECTION["inertia_z"]]) * DENSITY * length
    own += total * length**2 / 12 * np.diag([0, 1, 1])
    about_origin = axes.T @ own @ axes
    about_origin += total * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    size = total * (1 + np.abs(ends).max() ** 2)
    np.testing.assert_allclose(rigid[:3, :3], total * np.eye(3), atol=1e-10 * size)
    expected = total * np.array([np.cross(axis, centre) for axis in np.eye(3)]).T
    np.testing.assert_allclose(rigid[:3, 3:], expected, atol=1e-10 * size)
    np.testing.assert_allclose(rigid[3:, 3:], about_origin, atol=1e-10 * size)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"area": 0.0}, "beam 0 .nodes 0, 1. has area 0; it must be positive"),
        ({"inertia_y": -1.0}, "inertia y -1; it must be positive"),
        ({"torsion_constant": 0.0}, "torsion constant 0; it must be positive"),
        ({"youngs_modulus": np.nan}, "Young's modulus nan; it must be positive"),
        ({"shear_area_z": 0.0}, "shear area z 0; it must be positive"),
        ({"poisson_ratio": 0.6}, "Poisson's ratio"),
        ({"density": -1.0}, "density"),
        ({"up": (2.0, 0.0, 0.0)}, "`up` along its axis"),
        ({"up": (0.0, 0.0, 0.0)}, "`up` along its axis"),
    ],
)
def test_an_impossible_beam_is_refused_by_name(changes, message):
    beams = meshes.beams([[0, 1]], **{**SECTION, **changes})
    with pytest.raises(StructureError, match=message):
        beams.matrices(np.array([[0.0, 0, 0], [1.0, 0, 0]]))


def test_a_beam_without_length_is_refused_by_name():
    beams = meshes.beams([[7, 8], [9, 4]], **SECTION)
    points = np.zeros((10, 3))
    points[8, 0], points[[9, 4]] = 1.0, 5.0
    with pytest.raises(StructureError, match=r"beam 1 \(nodes 9, 4\) has no length"):
        beams.matrices(points)


def released_cantilever(count=4, **changes):
    """A released_cantilever of 3 m along x with the parts in `changes` set on its beams."""
    points = np.column_stack([np.linspace(0, 3.0, count + 1), np.zeros((count + 1, 2))])
    section = meshes.SECTION | {"youngs_modulus": 30e9, "density": 2500.0}
    bars = meshes.beams(meshes.chain(count), up=(0.0, 0.0, 1.0), **section)
    fixed = meshes.hold(count + 1, (points[:, 0] == 0, range(6)))
    return meshes.model(points, fixed, beams=replace(bars, **changes))


@pytest.mark.parametrize("meshed", [1, 4])
def test_a_hinge_at_the_support_leaves_a_propped_cantilever(meshed):
    """Clamped at one end, hinged and held at the other, pushed in the middle: 7 P L^3 / 768 EI."""
    count = 2 * meshed
    released = np.zeros((count, 12), dtype=bool)
    released[-1, [10, 11]] = True
    model = released_cantilever(count, released=released, shear_area_z=np.full(count, np.inf))
    fixed = model.fixed.copy()
    fixed[-1] = True
    load = np.zeros((count + 1, 6))
    load[meshed, 2] = 1e4
    model = replace(model, fixed=fixed)
    found = static_displacement(assemble(model), np.ones(1), load.ravel())[6 * meshed + 2]
    assert found == pytest.approx(7 * 1e4 * 27 / 768 / (30e9 * 1.6e-3), rel=1e-9)


@pytest.mark.parametrize("share", [-0.6, 0.0, 1.5])
def test_bending_parts_follow_second_moments_of_area(share):
    """Also where an end is hinged; shear areas stay, so that the parts are not all alike."""
    released = np.zeros((4, 12), dtype=bool)
    released[0, 4], released[3, [10, 11]] = True, True
    arms = np.random.default_rng(3).uniform(-0.1, 0.1, (4, 2, 3))
    model = released_cantilever(4, released=released, offset=arms)
    beams = model.elements_of(Beams)
    changed = replace(
        beams, inertia_y=(1.0 + share) * beams.inertia_y, inertia_z=(1.0 + share) * beams.inertia_z
    )
    before, after = (one.matrices(model.nodes).stiffness for one in (beams, changed))
    series, columns = beams.bending_parts(model.nodes)
    factor = (1.0 + share) / (1.0 + series * share) - 1.0
    found = np.einsum("nim,nm,njm->nij", columns, factor, columns)
    np.testing.assert_allclose(found, after - before, atol=1e-8 * np.abs(before).max())
    assert np.count_nonzero((columns != 0.0).any(axis=1).sum(axis=1) < 4) == 2
