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
