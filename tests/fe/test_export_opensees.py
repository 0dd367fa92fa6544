"""The exported script, run by OpenSees itself."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from femupdate.fe import PointMasses, RigidLinks, Springs, assemble, lowest_modes, opensees_script
from tests.fe import meshes

THETA = np.array([0.7, 1.4])


def building(**changes):
    """A wall, a slab with masses on it and a column, on springs; parts of two stiffness groups."""
    points, parts = meshes.frame_with_wall(3)
    foot = np.flatnonzero(points[:, 2] == 0)
    top = np.flatnonzero(points[:, 2] > 1.0)
    masses = PointMasses(
        np.concatenate([top, top[:2]]),
        np.full(len(top) + 2, 300.0),
        np.zeros((len(top) + 2, 3)),
    )
    springs = Springs(
        np.column_stack([foot, np.full(len(foot), -1)]),
        np.full(len(foot), 2),
        np.full(len(foot), 2e9),
        np.full(len(foot), -1),
    )
    held = meshes.hold(len(points), (points[:, 2] == 0, (0, 1, 3, 4, 5)))
    values = {**parts, "masses": masses, "springs": springs, **changes}
    return meshes.model(points, held, groups=2, **values)


def run(script, tmp_path, *options):
    path = tmp_path / "model.py"
    path.write_text(script, encoding="utf-8")
    command = [sys.executable, str(path), "--json", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return np.array(json.loads(done.stdout.strip().splitlines()[-1])["frequencies_hz"])


@pytest.mark.parametrize("shell", ["ASDShellQ4", "ShellMITC4"])
def test_opensees_finds_the_same_frequencies(opensees, tmp_path, shell):
    model = building()
    script = opensees_script(model, THETA, types={"shell": shell})
    theirs = run(script, tmp_path, "--modes", "6")
    ours = lowest_modes(assemble(model), THETA, 6).frequency_hz
    # Theirs are stiffer in bending on this coarse mesh, MITC4 in the plane of the wall as well.
    tolerance = 0.02 if shell == "ASDShellQ4" else 0.03
    np.testing.assert_allclose(theirs, ours, rtol=tolerance)


SECTION = {
    "area": 0.09,
    "shear_area_y": 0.075,
    "shear_area_z": 0.075,
    "inertia_y": 6.75e-4,
    "inertia_z": 4.0e-4,
    "torsion_constant": 1.1e-3,
    "youngs_modulus": 30e9,
    "poisson_ratio": 0.2,
    "density": 2500.0,
}


def test_released_ends_mean_the_same(opensees, tmp_path):
    """A portal whose slanting beam has a hinge at its start, and a column without one moment."""
    points = np.array([[0, 0, 0], [0, 0, 3.0], [4, 1, 3.5], [4, 1, 0.0]])
    beams = meshes.beams([[0, 1], [1, 2], [3, 2]], up=(0.3, 1.0, 0.0), **SECTION)
    released = np.zeros((3, 12), dtype=bool)
    released[1, [4, 5]] = released[2, 10] = True
    masses = PointMasses(np.array([1, 2]), np.full((2, 3), 5e3), np.full((2, 3), 4e3))
    held = meshes.hold(4, (points[:, 2] == 0, range(6)))
    models = [
        meshes.model(points, held, beams=replace(beams, released=ends), masses=masses)
        for ends in (None, released)
    ]
    whole, ours = (lowest_modes(assemble(model), np.ones(1), 6).frequency_hz for model in models)
    assert (ours < 0.95 * whole).sum() >= 4
    theirs = run(opensees_script(models[1], np.ones(1)), tmp_path, "--modes", "6")
    # As below; and springs in place of what is not released are 1e5 times as stiff as the beam.
    np.testing.assert_allclose(theirs, ours, rtol=0.01)


def test_rigid_links_and_arms_mean_the_same(opensees, tmp_path):
    """A mast on a rigid link, whose upper beam has arms at both ends."""
    points = np.array([[0, 0, 0], [0, 0, 2.0], [0.8, 0.3, 2.0], [0.8, 0.3, 5.0]])
    beams = meshes.beams([[0, 1], [2, 3]], up=(1.0, 0.0, 0.0), **SECTION)
    arms = np.zeros((2, 2, 3))
    arms[1] = [[0.1, 0.0, 0.4], [0.1, 0.0, -0.2]]
    masses = PointMasses(np.array([1, 3]), np.array([4e3, 5e3]), np.full((2, 3), 400.0))
    links = RigidLinks(np.array([1]), np.array([2]), np.ones((1, 6), dtype=bool))
    model = meshes.model(
        points,
        meshes.hold(4, (points[:, 2] == 0, range(6))),
        beams=replace(beams, offset=arms),
        masses=masses,
        links=links,
    )
    theirs = run(
        opensees_script(model, np.ones(1)), tmp_path, "--modes", "6", "--solver", "UmfPack"
    )
    ours = lowest_modes(assemble(model), np.ones(1), 6).frequency_hz
    # The beams' own rotary inertia, which OpenSees leaves out, is a thousandth here.
    np.testing.assert_allclose(theirs, ours, rtol=0.01)
