"""Rigid ends, eccentric axes and hinges of beams against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from femupdate.fe import Beams, assemble, static_displacement
from tests.fe import meshes


def cantilever(count=4, **changes):
    """A cantilever of 3 m along x with the parts in `changes` set on its beams."""
    points = np.column_stack([np.linspace(0, 3.0, count + 1), np.zeros((count + 1, 2))])
    section = meshes.SECTION | {"youngs_modulus": 30e9, "density": 2500.0}
    bars = meshes.beams(meshes.chain(count), up=(0.0, 0.0, 1.0), **section)
    fixed = meshes.hold(count + 1, (points[:, 0] == 0, range(6)))
    return meshes.model(points, fixed, beams=replace(bars, **changes))


def test_rigid_ends_shorten_the_span():
    """A bar between rigid arms of 0.5 m and 0.4 m, clamped, pushed at the far node."""
    arms = np.zeros((1, 2, 3))
    arms[0, 0, 0], arms[0, 1, 0] = 0.5, -0.4
    model = cantilever(1, offset=arms, shear_area_z=np.full(1, np.inf))
    load = np.zeros((2, 6))
    load[1, 2] = 1e4
    found = static_displacement(assemble(model), np.ones(1), load.ravel())[6 + 2]
    clear, bending = 2.1, 30e9 * 1.6e-3
    # The force and its moment about the bar's end act through the arm of 0.4 m.
    arm, force = 0.4, 1e4
    end = force * clear**3 / 3 / bending + force * arm * clear**2 / 2 / bending
    slope = force * clear**2 / 2 / bending + force * arm * clear / bending
    assert found == pytest.approx(end + slope * arm, rel=1e-9)


def test_an_eccentric_bar_bends_when_it_is_pulled():
    """A bar 0.2 m below its nodes, pulled at the nodes: N / EA + N e^2 / EI along the nodes."""
    arms = np.zeros((4, 2, 3))
    arms[:, :, 2] = -0.2
    model = cantilever(4, offset=arms)
    load = np.zeros((5, 6))
    load[-1, 0] = 1e6
    moved = static_displacement(assemble(model), np.ones(1), load.ravel()).reshape(5, 6)[-1]
    moment, bending = 1e6 * 0.2, 30e9 * 1.6e-3
    assert moved[0] == pytest.approx(1e6 * 3 / 30e9 / 0.12 + moment * 0.2 * 3 / bending, rel=1e-9)
    assert abs(moved[2]) == pytest.approx(moment * 3**2 / 2 / bending, rel=1e-9)
    assert moved[4] * moved[2] < 0


@pytest.mark.parametrize("meshed", [1, 4])
def test_a_hinge_at_the_support_leaves_a_propped_cantilever(meshed):
    """Clamped at one end, hinged and held at the other, pushed in the middle: 7 P L^3 / 768 EI."""
    count = 2 * meshed
    released = np.zeros((count, 12), dtype=bool)
    released[-1, [10, 11]] = True
    model = cantilever(count, released=released, shear_area_z=np.full(count, np.inf))
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
    model = cantilever(4, released=released, offset=arms)
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
