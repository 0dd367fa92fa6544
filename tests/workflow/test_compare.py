"""compare: two states of the tower, measured apart, and pairs that cannot be compared."""

import re
import shutil
from types import SimpleNamespace

import pytest

from femupdate.errors import StudyError
from femupdate.study import Study
from femupdate.workflow import compare_states, find_state, open_state


@pytest.fixture(scope="module")
def state(tmp_path_factory, tower_file):
    """A function that measures and calibrates the tower with these stiffness factors."""
    from femupdate.building import load_building
    from femupdate.simulation import SimulationSettings, simulate_observation, write_simulation
    from femupdate.workflow import (
        CalibrationSettings,
        ObservationSource,
        calibrate_study,
        open_study,
    )

    def calibrated(theta, seed):
        folder = tmp_path_factory.mktemp("state")
        settings = SimulationSettings(
            theta=theta, duration_s=60.0, sampling_hz=50.0, band_hz=(0.3, 20.0), seed=seed
        )
        simulation = simulate_observation(load_building(tower_file), settings)
        path = write_simulation(simulation, folder / "run.csv").observation
        study = Study(folder / "study")
        source = ObservationSource(path)
        chosen = CalibrationSettings(particles=400, exact=True, seed=seed)
        calibrate_study(study, open_study(study, str(tower_file)), source, chosen)
        return SimpleNamespace(state=open_state(study), folder=study.folder)

    return calibrated


@pytest.fixture(scope="module")
def states(state):
    return SimpleNamespace(
        before=state((0.9, 1.1), 11), same=state((0.9, 1.1), 12), softer=state((0.9, 0.99), 13)
    )


def test_a_story_softened_by_a_tenth_is_named(states):
    report = compare_states(states.before.state, states.softer.state)
    assert report.verdict == "changed"
    assert report.sentence().startswith("The stiffness of story high changed by -")
    answer = report.as_dict()
    low, high = answer["changes"]
    assert low["probability"] < 0.5 < 0.95 < high["probability"]
    assert high["change"] == pytest.approx(-0.1, abs=4.0 * high["change_sd"])
    assert high["of"] == "story high"


def test_no_change_is_said_to_be_none(states):
    report = compare_states(states.before.state, states.same.state)
    assert report.verdict == "unchanged"
    assert report.sentence().startswith("Nothing has changed, with a probability of")
    assert "or more would have been seen" in report.sentence()
    text = "\n".join(report.lines())
    assert not re.search(r"-0\.0+ ±|± 0\.0+( |$)", text)


def test_two_posteriors_of_one_study_are_compared_by_their_names(states, tmp_path):
    study = Study(shutil.copytree(states.before.folder, tmp_path / "study"))
    later = Study(study.folder, "after")
    later.result().mkdir(parents=True)
    shutil.copyfile(states.softer.folder / "posterior.nc", later.result("posterior.nc"))
    later.record("posterior", "posterior.nc", "calibrate", {"observation": "another"})
    report = compare_states(find_state("posterior", study), find_state("after", study))
    assert report.verdict == "changed"
    assert report.as_dict()["after"] == "after"
    with pytest.raises(StudyError, match=r"called later; make it .* posterior, after$"):
        find_state("later", study)
