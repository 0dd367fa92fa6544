"""A structure that cannot stand is refused, and the message names the node and the direction."""

import re
from dataclasses import replace

import numpy as np
import pytest

from femupdate.errors import StructureError
from femupdate.fe import Springs, assemble, lowest_modes, static_displacement
from tests.fe import meshes

SECTION = {
    "area": 0.1,
    "inertia_y": 1e-3,
    "inertia_z": 2e-3,
    "torsion_constant": 1e-3,
    "youngs_modulus": 30e9,
    "density": 2500.0,
}


def complaint(model):
    """(node, direction) named by both static and modal analysis."""
    operators = assemble(model)
    theta = np.ones(model.groups)
    found = []
    for solution in (
        lambda: static_displacement(operators, theta, np.ones(model.dof)),
        lambda: lowest_modes(operators, theta, 2),
    ):
        with pytest.raises(StructureError, match="the structure is a mechanism") as error:
            solution()
        node, direction = re.search(
            r"node (\d+) at \(.*\) m .* along (\w\w)", str(error.value)
        ).groups()
        found.append((int(node), direction))
    assert found[0] == found[1]
    return found[0]


def portal():
    """Two columns and a girder of two beams: nodes 0 and 4 on the ground."""
    points = np.array([[0.0, 0, 0], [0, 0, 3], [2, 0, 3], [5, 0, 3], [5, 0, 0]])
    beams = meshes.beams(meshes.chain(4), up=(0.0, 1.0, 0.0), **SECTION)
    fixed = meshes.hold(5, (points[:, 2] == 0, range(6)))
    return meshes.model(points, fixed, beams=beams)


@pytest.mark.parametrize(("free", "direction"), [(0, "ux"), (1, "uy"), (2, "uz")])
def test_a_missing_support_names_the_direction(free, direction):
    model = portal()
    fixed = model.fixed.copy()
    fixed[:, 3:] |= True  # no rotation, so that only the freed translation is left
    fixed[[0, 4], free] = False
    assert complaint(replace(model, fixed=fixed))[1] == direction


def test_a_part_that_is_not_connected():
    """A second beam hangs on the first by a spring along z alone."""
    points = np.array([[0.0, 0, 0], [2, 0, 0], [2, 0, 0], [5, 1, 0]])
    springs = Springs(np.array([[1, 2]]), np.array([2]), np.array([1e7]), np.array([0]))
    beams = meshes.beams([[0, 1], [2, 3]], **SECTION)
    fixed = meshes.hold(4, (points[:, 0] == 0, range(6)))
    node, _ = complaint(meshes.model(points, fixed, beams=beams, springs=springs))
    assert node in (2, 3)


def test_a_story_whose_stiffness_vanishes():
    """theta = 0 takes the lower columns away."""
    points = np.array([[0.0, 0, 0], [0, 0, 3], [0, 0, 6]])
    beams = meshes.beams(meshes.chain(2), up=(1.0, 0.0, 0.0), **SECTION)
    beams = replace(beams, group=np.array([0, 1]))
    operators = assemble(
        meshes.model(points, meshes.hold(3, (points[:, 2] == 0, range(6))), groups=2, beams=beams)
    )
    with pytest.raises(StructureError, match="with nothing to resist it"):
        lowest_modes(operators, np.array([0.0, 1.0]), 2)
    with pytest.raises(StructureError, match=r"node 1 .*negative stiffness"):
        lowest_modes(operators, np.array([-0.5, 1.0]), 2)


@pytest.mark.parametrize("count", [4, 200])
def test_a_slender_mast_is_no_mechanism(count):
    """100 m of a 0.2 m bar, and a plate 10 000 times as long as thick: soft, but they stand."""
    points = np.linspace(0, 100, count + 1)[:, None] * [0.6, 0.0, 0.8]
    bar = {**SECTION, "area": 0.04, "inertia_y": 1.3e-4, "inertia_z": 1.3e-4}
    beams = meshes.beams(meshes.chain(count), up=(0.0, 1.0, 0.0), **bar)
    fixed = meshes.hold(count + 1, (points[:, 2] == 0, range(6)))
    load = meshes.zeros(count + 1)
    load[-1, 1] = 1.0
    u = meshes.displacement(meshes.model(points, fixed, beams=beams), load)
    assert u[-1, 1] == pytest.approx(100**3 / (3 * 30e9 * 1.3e-4), rel=1e-5)
