"""Effects that OpenSees has in its truths, against the same in the solver of this project."""

import numpy as np
import pytest
from femupdate.benchmarks.frame_coverage import BUILDING
from femupdate.benchmarks.hidden_effects.by_opensees import (
    made_by_opensees,
    opensees_truth,
    possible,
    shell_of,
)
from femupdate.benchmarks.hidden_effects.measurement import (
    OPENSEES,
    MeasuredBuilding,
    TrialSettings,
)
from femupdate.benchmarks.hidden_effects.trial import trial_models
from femupdate.benchmarks.hidden_effects.uncatalogued import UNCATALOGUED

from femupdate.building import load_building
from femupdate.dynamics import ConstantDamping
from femupdate.effects import CATALOGUE, Placed
from femupdate.errors import ReportError
from femupdate.simulation import fine_model, truth_of
from femupdate.study import Study
from femupdate.workflow import open_study

EFFECTS = {**CATALOGUE, **{effect.name: effect for effect in UNCATALOGUED}}
THETA = np.array([1.1, 0.9, 1.0])


@pytest.fixture(scope="module")
def fine():
    building = load_building(BUILDING)
    return fine_model(building, 1.0, building.sensors.points)


def frequencies(fine, effects=()):
    """The lowest three by OpenSees and by our own solver (2, 3)."""
    measured = MeasuredBuilding(fine.building, TrialSettings(), THETA, 0.02, effects)
    theirs = opensees_truth(fine, measured, "ASDShellQ4")
    ours = truth_of(fine, THETA, ConstantDamping(), 12.0, effects)
    return np.stack([one.frequency_hz[:3] for one in (theirs, ours)])


@pytest.fixture(scope="module")
def without(fine, opensees):
    return frequencies(fine)


@pytest.mark.parametrize(
    ("label", "size"),
    [
        ("added_mass@3F", 0.3),
        ("corner_mass@RF", 0.3),
        ("wall_stiffness@S1", -0.4),
        ("cracked_columns@S2", -0.5),
        ("local_crack@S1", -0.9),
    ],
)
def test_an_effect_moves_the_frequencies_as_in_our_own_solver(fine, without, label, size):
    name, place = label.split("@")
    theirs, ours = frequencies(fine, ((Placed(EFFECTS[name], place), (size,)),)) / without - 1.0
    assert abs(ours).max() > 0.002
    # Shells of two kinds differ; what an effect changes differs by a tenth of itself.
    np.testing.assert_allclose(theirs, ours, atol=0.1 * abs(ours).max() + 2e-4)


def test_what_cannot_be_written_for_opensees_is_not_drawn(fine):
    made = {name for name, effect in EFFECTS.items() if made_by_opensees(effect)}
    assert {"added_mass", "channel_delay", "local_crack", "wall_stiffness"} <= made
    assert not made & {"tuned_appendage", "foundation_rocking", "ground_tie", "damping_law"}
    # Its shells have one modulus: softer in their plane they would be softer across it.
    assert "flexible_diaphragm" not in made
    lighter = ((Placed(EFFECTS["added_mass"], "2F"), (-0.2,)),)
    assert possible(lighter)[0][1] == (0.2,)
    assert {shell_of(number) for number in range(8)} == {"ASDShellQ4", "ShellMITC4"}


def test_a_mass_at_a_corner_is_that_of_the_floor(fine):
    effect, structure = EFFECTS["corner_mass"], fine.structure
    values = effect.masses(structure, "RF")
    along = structure.points.axis == structure.direction
    whole = EFFECTS["added_mass"].masses(structure, "RF")
    assert values[along].sum() == pytest.approx(whole[along].sum(), rel=1e-12)
    heavy = structure.points.position[values > 0.0]
    assert heavy[:, 0].max() <= 4.5
    assert heavy[:, 1].max() <= 3.0


def test_a_stick_is_not_made_by_opensees(tmp_path):
    study = Study(tmp_path)
    with pytest.raises(ReportError, match="leave --opensees out or choose a frame"):
        trial_models(study, open_study(study, "shear_4dof"), TrialSettings(truth=OPENSEES))
