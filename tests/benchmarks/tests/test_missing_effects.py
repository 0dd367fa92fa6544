"""The open benchmark: its score, and the sticks of its truths."""

import json
import shutil
from functools import cache

import numpy as np
import pytest
from femupdate.benchmarks.frame_coverage import BUILDING
from femupdate.benchmarks.missing_effects.frames import frame_modes
from femupdate.benchmarks.missing_effects.fresh import (
    answer,
    judged,
    make_case,
    write_buildings,
)
from femupdate.benchmarks.missing_effects.score import FOLDER, figures, score, task_numbers
from femupdate.benchmarks.missing_effects.stick import STEP_S, Stick
from scipy.linalg import eigh

from femupdate.building import load_building
from femupdate.dynamics import ConstantDamping
from femupdate.effects import CATALOGUE, Placed
from femupdate.simulation import fine_model, truth_of

MASS = {"kind": "mass", "places": ["4F"]}
BRACE = {"kind": "brace", "places": ["5F-RF"]}


def answer_of(number):
    return json.loads((FOLDER / "answers" / number / "answer.json").read_text())


def enter(folder, number, **changes):
    """The truth as an entry, but for changes."""
    truth = answer_of(number)
    effects = [{**effect, "size_sd": 1e-6} for effect in truth["missing"]]
    entry = {"verdict": truth["verdicts"][0], "effects": effects}
    if truth["factors"]:
        entry |= {"factors": truth["factors"], "factors_sd": [1e-6] * len(truth["factors"])}
    (folder / f"{number}.json").write_text(json.dumps(entry | changes))
    shutil.copy(FOLDER / "answers" / number / "next.csv", folder / f"{number}.csv")


def test_the_truth_scores_full_marks(tmp_path):
    for number in task_numbers():
        enter(tmp_path, number)
    found = figures(score(tmp_path))
    assert found["named"] == (24, 24)
    assert found["false"][0] == found["factors"][0] == found["forecast"][0] == 0
    assert found["sizes"][0] == found["sizes"][1] > 8
    assert found["held"][0] == found["held"][1] > 60


@pytest.mark.parametrize(
    ("number", "changes", "figure", "value"),
    [
        ("01", {"effects": [{"kind": "mass", "places": ["3F"]}]}, "false", (1, 1)),
        ("01", {"verdict": "effects"}, "named", (0, 1)),
        ("05", {"effects": []}, "named", (0, 1)),
        ("05", {"effects": [{**MASS, "size": 0.13, "size_sd": 0.004}]}, "sizes", (0, 1)),
        ("18", {"effects": [BRACE]}, "named", (1, 1)),
        ("18", {"effects": [BRACE]}, "false", (0, 0)),
        ("18", {"verdict": "effects", "effects": [BRACE]}, "false", (1, 1)),
        ("05", {"factors": [2 * f for f in answer_of("05")["factors"]]}, "factors", (100.0, 6)),
    ],
)
def test_what_is_wrong_is_counted(number, changes, figure, value, tmp_path):
    enter(tmp_path, number, **changes)
    assert figures(score(tmp_path))[figure] == pytest.approx(value)


def test_answers_of_another_building_are_refused(tmp_path):
    enter(tmp_path, "01", factors=[1.0], factors_sd=[0.1])
    with pytest.raises(ValueError, match=r"01\.json: give 6 factors"):
        score(tmp_path)


def test_a_stick_of_opensees_moves_as_its_modes_do():
    pytest.importorskip("openseespy")
    mass, stiffness = np.array([2.0, 1.0]), np.array([3000.0, 2000.0])
    stick = Stick(mass=mass, stiffness=stiffness, zeta=0.05)
    matrix = np.array([[5000.0, -2000.0], [-2000.0, 2000.0]])
    squares, shapes = eigh(matrix, np.diag(mass))
    np.testing.assert_allclose(stick.modes()[0] ** 2, squares, rtol=1e-9)
    time = np.arange(0.0, 4.0, STEP_S)
    base = np.sin(5.0 * time) ** 2 * np.minimum(time, 1.0)
    turning = 2.0 * np.pi * np.fft.rfftfreq(8 * len(base), STEP_S)
    expected = np.fft.rfft(base, 8 * len(base))
    moved = expected[None].repeat(2, axis=0)
    for square, shape in zip(squares, shapes.T, strict=True):
        denominator = square - turning**2 + 0.1j * np.sqrt(square) * turning
        moved = moved + np.outer(shape * (mass @ shape), turning**2 / denominator * expected)
    expected = np.fft.irfft(moved)[:, : len(base)]
    # Average acceleration lengthens the second period by .003 %, half a cycle's error in 1e4.
    np.testing.assert_allclose(stick.respond(base), expected, atol=2e-3 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("name", "seed", "verdict"),
    [
        # Of 32 sticks the one whose thirds by strength differ as if a story softened, by .8 %.
        ("clean-steel5-12", 61, "none"),
        ("modes-soft4-2", 73, "none"),
        ("hammer-soft4-2", 73, "none"),
        ("hammer-soft4-1", 73, "named"),
    ],
)
def test_what_is_said_of_fresh_cases(name, seed, verdict, tmp_path, opensees):
    write_buildings(tmp_path)
    kind, stick, number = name.split("-")
    case = make_case(name, kind, stick, int(number), tmp_path, seed)
    said = answer(case, name, kind, tmp_path)
    assert said["verdict"] == verdict
    assert judged(case | said, kind)["right"]


@cache
def first_modes(*effects):
    """Three frequencies of a frame by OpenSees and by our own full model, Hz."""
    building, theta = load_building(BUILDING), np.array([1.1, 0.9, 1.0])
    fine = fine_model(building, 1.0, building.sensors.points)
    placed = tuple((Placed(CATALOGUE[of], at), (by,)) for of, at, by in effects)
    ours = truth_of(fine, theta, ConstantDamping(), 12.0, placed).frequency_hz[:3]
    how = {"mesh_size": 1.0, "shell": "ASDShellQ4"}
    return frame_modes(building, theta, effects, **how).omega[:3] / (2.0 * np.pi), ours


@pytest.mark.parametrize(
    ("label", "size"),
    [("added_mass@3F", 0.3), ("wall_stiffness@S1", -0.4), ("cracked_columns@S2", -0.5)],
)
def test_an_effect_moves_a_frame_of_opensees_as_our_own(label, size, opensees):
    name, place = label.split("@")
    theirs, ours = np.divide(first_modes((name, place, size)), first_modes()) - 1.0
    assert abs(ours).max() > 0.002
    # Shells of two kinds differ; what an effect changes differs by a tenth of itself.
    np.testing.assert_allclose(theirs, ours, atol=0.1 * abs(ours).max() + 2e-4)
