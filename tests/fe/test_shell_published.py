"""The shell against published static tests: value / target on coarse and fine meshes.

Expected ratios of coarse meshes are those of a QM6 membrane with MITC4 bending, measured with
independent programs; targets are given in `published.py`.
"""

from dataclasses import replace

import numpy as np
import pytest

from femupdate.fe.assembly import assemble
from femupdate.fe.solve import lowest_modes

TWO_PER_CENT = 0.02  # coarse-mesh scores differ by that much between drilling formulations


@pytest.mark.parametrize(("count", "score"), [(2, 0.877), (4, 0.960), (8, 0.988), (16, 0.997)])
def test_cook(meshes, published, count, score):
    assert published.cook(meshes, count) == pytest.approx(score, rel=0.01)


def test_cook_converges_to_the_reference(meshes, published):
    assert published.cook(meshes, 32) == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize(
    ("shape", "case", "score"),
    [
        ("rect", "extension", 0.996),
        ("rect", "in-plane", 0.987),
        ("rect", "out-of-plane", 0.980),
        ("rect", "twist", 0.941),
        ("trap", "extension", 0.999),
        ("trap", "out-of-plane", 0.963),
        ("trap", "twist", 0.884),
        ("para", "extension", 0.999),
        ("para", "in-plane", 0.629),
        ("para", "out-of-plane", 0.978),
        ("para", "twist", 0.849),
    ],
)
def test_straight_cantilever(meshes, published, shape, case, score):
    value = published.straight_cantilever(meshes, shape, case)
    assert value == pytest.approx(score, rel=TWO_PER_CENT)


@pytest.mark.parametrize(("direction", "score"), [(1, 0.372), (2, 0.942)])
def test_curved_cantilever(meshes, published, direction, score):
    value = published.curved_cantilever(meshes, direction)
    assert value == pytest.approx(score, rel=TWO_PER_CENT)


@pytest.mark.parametrize("thickness", [0.32, 0.0032])
@pytest.mark.parametrize("along", ["width", "thickness"])
def test_twisted_beam_of_warped_elements(meshes, published, thickness, along):
    assert published.twisted_beam(meshes, thickness, along) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    ("length", "edges", "loading", "score"),
    [
        (2, "ss", "q", 0.999),
        (2, "ss", "p", 0.998),
        (2, "cl", "q", 1.001),
        (2, "cl", "p", 0.992),
        (10, "ss", "q", 0.995),
        (10, "ss", "p", 0.977),
        (10, "cl", "q", 1.001),
        (10, "cl", "p", 0.946),
    ],
)
def test_rectangular_plate_without_shear_locking(meshes, published, length, edges, loading, score):
    value = published.rectangular_plate(meshes, length, edges, loading, 8)
    assert value == pytest.approx(score, abs=1e-3)


@pytest.mark.parametrize(("count", "score"), [(4, 1.045), (8, 1.005), (16, 0.997)])
def test_scordelis_lo(meshes, published, count, score):
    assert published.scordelis_lo(meshes, count) == pytest.approx(score, rel=0.005)


@pytest.mark.parametrize(("count", "score"), [(4, 0.924), (8, 0.984), (16, 0.990)])
def test_hemisphere_with_a_hole(meshes, published, count, score):
    assert published.hemisphere(meshes, count) == pytest.approx(score, rel=TWO_PER_CENT)


def test_hemisphere_converges(meshes, published):
    """The converged value is 0.0935, half a percent below the published 0.0940."""
    assert published.hemisphere(meshes, 32, target=0.0935) == pytest.approx(1.0, abs=0.005)


@pytest.mark.parametrize(("count", "score"), [(4, 0.386), (8, 0.753), (16, 0.932)])
def test_pinched_cylinder(meshes, published, count, score):
    assert published.pinched_cylinder(meshes, count) == pytest.approx(score, rel=TWO_PER_CENT)


@pytest.mark.parametrize(
    ("columns", "rows", "score"), [(1, 6, 0.984), (2, 6, 0.980), (2, 12, 0.987), (4, 24, 0.994)]
)
def test_wall_against_the_timoshenko_beam(meshes, columns, rows, score):
    """A wall 6 m x 21 m x 0.3 m under 1 MN at its top: one element across is enough."""
    s, t, quads = meshes.grid(columns, rows)
    points = meshes.stack(6 * s, 0 * s, 21 * t)
    load = meshes.zeros(len(s))
    load[:, 0] = 1e6 * meshes.line_weights(t == 1, s)
    fixed = meshes.hold(len(s), (t == 0, range(6)))
    shells = meshes.shells(quads, 0.3, 30e9, 0.2)
    u = meshes.displacement(meshes.model(points, fixed, shells=shells), load)
    area, inertia, shear_modulus = 0.3 * 6, 0.3 * 6**3 / 12, 30e9 / 2.4
    target = 1e6 * (21**3 / (3 * 30e9 * inertia) + 21 / (shear_modulus * area / 1.2))
    assert u[t == 1, 0].mean() / target == pytest.approx(score, abs=0.005)


def coupled_wall(meshes, fine):
    """Two piers of 2.4 m and lintels of 0.7 m over openings of 2.4 m, six stories of 3.5 m."""
    columns, rows = 6 * fine, 30 * fine
    s, t, quads = meshes.grid(columns, rows)
    centre = np.stack([s, t], axis=1)[quads].mean(axis=1)
    opening = (np.abs(centre[:, 0] - 0.5) < 1 / 6) & (6 * centre[:, 1] % 1 < 0.8)
    used, quads = np.unique(quads[~opening], return_inverse=True)
    s, t = s[used], t[used]
    fixed = meshes.hold(len(s), (t == 0, range(6)))
    shells = meshes.shells(quads.reshape(-1, 4), 0.3, 30e9, 0.2, 2500.0)
    return meshes.model(meshes.stack(7.2 * s, 0 * s, 21 * t), fixed, shells=shells)


@pytest.mark.parametrize(
    ("fine", "elements", "top", "frequencies"),
    [(1, 132, 7.321e-3, (6.406, 24.07)), (2, 528, 7.989e-3, (6.135, 23.30))],
)
def test_coupled_wall(meshes, fine, elements, top, frequencies):
    """100 kN a floor on its line; expected: the enhanced-strain ASDShellQ4 on the same mesh."""
    model = coupled_wall(meshes, fine)
    assert len(model.shells) == elements
    load = meshes.zeros(len(model.nodes))
    for floor in range(1, 7):
        line = np.abs(model.nodes[:, 2] - 3.5 * floor) < 1e-6
        load[:, 0] += 1e5 * meshes.line_weights(line, model.nodes[:, 0])
    u = meshes.displacement(model, load)
    roof = np.abs(model.nodes[:, 2] - 21) < 1e-6
    assert u[roof, 0].mean() == pytest.approx(top, rel=0.02)
    out_of_plane = meshes.hold(len(model.nodes), (model.nodes[:, 2] > -1, (1, 3, 5)))
    flat = replace(model, fixed=model.fixed | out_of_plane)
    found = lowest_modes(assemble(flat), np.ones(1), 2).frequency_hz
    assert found == pytest.approx(frequencies, rel=0.01)
