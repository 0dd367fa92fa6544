"""Member forces in a ground motion against what a building must carry."""

import numpy as np
import pytest

from femupdate.building.document import from_document
from femupdate.building.files import load_building
from femupdate.dynamics.superposition import BaseMotion
from femupdate.errors import BuildingError
from femupdate.workflow.members import member_forces, write_member_forces

MASS, HEIGHT = 40e3, 3.0


@pytest.fixture(scope="module")
def table():
    """Four equal columns under a rigid slab of 40 t, all that weighs."""
    return from_document(
        {
            "name": "table",
            "kind": "frame",
            "grid": {"x": {"X0": 0.0, "X1": 5.0}, "y": {"Y0": 0.0, "Y1": 4.0}},
            "stories": [{"name": "S1", "height": HEIGHT}],
            "materials": {"c": {"youngs_modulus": 25e9, "poisson_ratio": 0.2, "density": 0.0}},
            "sections": {"column": {"shape": "circle", "diameter": 0.4}},
            "columns": [{"section": "column"}],
            "slabs": [{"x": ["X0", "X1"], "y": ["Y0", "Y1"], "thickness": 0.6}],
            "floor_mass": [{"total": MASS}],
            "mesh": {"size": 3.0},
            "sensors": {"direction": "x", "points": ["X0-Y0"]},
            "frequency_grid": {"start": 0.1, "step": 0.1, "count": 100},
            "prior": {"theta": {"lower": 0.5, "upper": 2.0}},
            "damping": {"law": "rayleigh", "ratio": 0.03, "anchors": [1.0, 20.0]},
        }
    )


def slow():
    """A ground acceleration that rises to 1 m/s2 and falls again within 20 s."""
    t = np.linspace(0.0, 20.0, 1001)
    return BaseMotion(np.sin(np.pi * t / 20.0) ** 2, 0.02)


@pytest.mark.parametrize("zeta", [0.05, None])  # one ratio, or the building's own law
def test_columns_share_the_inertia_of_the_floor(table, zeta):
    found = member_forces(table, np.array([0.8]), zeta, [(0, 0, 0.5), (5, 4, 0.5)], slow(), 30.0)
    for member in found:
        assert member.kind == "column"
        peaks = member.named_peaks()
        # Local y of a column is the global x here. 1 %: the motion is slow, not still.
        assert peaks["Vy_start"] == pytest.approx(MASS / 4, rel=0.01)
        assert peaks["Vz_start"] < 0.01 * MASS
        # Clamped below, all but clamped above: the moments at both ends hold the shear.
        whole = peaks["Mz_start"] + peaks["Mz_end"]
        assert whole == pytest.approx(MASS / 4 * HEIGHT, rel=0.01)


def test_histories_are_written_with_units(table, tmp_path):
    found = member_forces(table, np.array([1.0]), 0.05, [(0, 0, 0)], slow(), 30.0)
    path = tmp_path / "forces.csv"
    write_member_forces(found, 0.02, path)
    lines = path.read_text(encoding="utf-8").splitlines()
    assert lines[0].split(",")[:4] == ["time_s", "1:N_start", "1:Vy_start", "1:Vz_start"]
    assert lines[1].split(",")[:6] == ["s", "N", "N", "N", "N m", "N m"]
    values = np.loadtxt(lines[2:], delimiter=",")
    assert values.shape == (1001, 13)
    np.testing.assert_allclose(values[:, 2], found[0].history[1], rtol=1e-5, atol=1e-2)


def test_a_shear_building_has_no_members():
    with pytest.raises(BuildingError, match="a shear building has no members"):
        member_forces(load_building("shear_4dof"), np.ones(4), 0.02, [(0, 0, 0)], slow(), 30.0)
