"""calibrate from deflections under known loads, against the tower's flexibility by hand."""

import numpy as np
import pytest

from femupdate.errors import MeasurementError
from femupdate.measurement.inspection import inspect_file
from femupdate.study import Study
from femupdate.workflow.calibrate import calibrate_study
from femupdate.workflow.calibrate_settings import CalibrationSettings
from femupdate.workflow.kinds import measured_of
from femupdate.workflow.model import open_study
from femupdate.workflow.observed import ObservationSource

SPRINGS = np.array([4e6, 2.5e6]) * [0.8, 1.3]  # N/m, true
# A load at the roof stretches both stories, one at the second floor the lower one alone.
ROOF = np.array([1.0 / SPRINGS[0], 1.0 / SPRINGS[0] + 1.0 / SPRINGS[1]])  # 2F and RF, m/N
SECOND = np.full(2, 1.0 / SPRINGS[0])
HEAD = "case,load/RF (kN),2F (mm),RF (mm)\n"


def rows(loads, influence, noise=0.0, offset=0.0):
    rng = np.random.default_rng(2)
    moved = 1e6 * np.outer(loads, influence) + offset
    moved *= 1.0 + noise * rng.normal(size=moved.shape)
    cases = zip(loads, moved, strict=True)
    return "".join(f"{k},{p:g},{a:.6g},{b:.6g}\n" for k, (p, (a, b)) in enumerate(cases))


@pytest.fixture
def load_file(tmp_path):
    def write(text):
        path = tmp_path / "loads.csv"
        path.write_text(text)
        return path

    return write


def test_the_stiffness_of_both_stories_is_found(load_file, tower_file, tmp_path):
    path = load_file(HEAD + rows([0.0, 5.0, 10.0, 15.0, 20.0, 25.0], ROOF, 0.01, offset=0.3))
    study = Study(tmp_path / "study")
    model = open_study(study, str(tower_file))
    settings = CalibrationSettings(particles=1000)
    report = calibrate_study(study, model, ObservationSource(path), settings)
    draws = report.posterior.samples
    assert (np.abs(draws.mean(axis=0) - [0.8, 1.3]) < 3.0 * draws.std(axis=0)).all()
    assert draws.std(axis=0).max() < 0.1
    assert any("static deflection of 2F, RF" in note for note in report.notes)


def test_two_loads_are_told_apart_and_give_the_flexibility(load_file, tower_model):
    cases = [(10.0, 0.0), (0.0, 8.0), (5.0, 5.0)]
    text = "load/RF (kN),load/2F (kN),2F (mm),RF (mm)\n"
    for roof, second in cases:
        moved = 1e6 * (roof * ROOF + second * SECOND)
        text += f"{roof},{second},{moved[0]:.9g},{moved[1]:.9g}\n"
    source = ObservationSource(load_file(text))
    forced = measured_of(tower_model.building, source).forced
    for one in forced:
        own = one.observation
        found = np.exp(own.log_frf[:, 0]) / (2.0 * np.pi * own.frequency_hz[0]) ** 2
        np.testing.assert_allclose(found, ROOF if one.force == "RF" else SECOND, rtol=1e-5)
        assert "too few load cases" in own.notes[0]


def test_inspect_says_what_it_is(load_file):
    one = inspect_file(load_file(HEAD + rows([5.0, 10.0], ROOF)))
    assert one.summary == "2 load cases (tables in CSV or other text)"
    assert one.step.command == f"femupdate calibrate {one.path}"


def test_other_commands_say_what_it_is(load_file):
    from femupdate.measurement.kinds import read_observation_file

    with pytest.raises(MeasurementError, match="static load cases, which calibrate and inspect"):
        read_observation_file(load_file(HEAD + rows([5.0, 10.0], ROOF)))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEAD.replace(" (kN)", "") + rows([5.0, 10.0], ROOF), "the load's unit is not given"),
        (HEAD.replace("kN", "kg") + rows([5.0, 10.0], ROOF), "unknown column 'load/RF (kg)'"),
        (HEAD.replace(" (mm)", "") + rows([5.0, 10.0], ROOF), "the deflection has no unit"),
        (HEAD.replace("RF (mm)", "RF (gal)") + rows([5.0, 10.0], ROOF), "gal"),
        (HEAD.replace("RF (mm)", "roof") + rows([5.0, 10.0], ROOF), "unknown column 'roof'"),
        (HEAD + rows([5.0, -5.0, 5.0, 10.0], -ROOF), "correct a sign"),
        (HEAD + rows([0.0, 0.0], ROOF), "cannot be told apart"),
        (HEAD.replace("2F", "9F") + rows([5.0, 10.0], ROOF), "9F"),
        (HEAD + rows([5.0, 10.0], 100.0 * ROOF), "all that the prior of the building's stiffness"),
    ],
)
def test_load_cases_that_cannot_be_used(load_file, tower_file, tmp_path, text, words):
    study = Study(tmp_path / "study")
    model = open_study(study, str(tower_file))
    source = ObservationSource(load_file(text))
    with pytest.raises(MeasurementError, match=words.replace("(", r"\(").replace(")", r"\)")):
        calibrate_study(study, model, source, CalibrationSettings(particles=1000))
