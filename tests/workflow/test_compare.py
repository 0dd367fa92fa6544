"""compare: two states of the tower, measured apart, and pairs that cannot be compared."""

import re
import shutil
from types import SimpleNamespace

import numpy as np
import pytest

import femupdate
from femupdate.errors import MeasurementError, StudyError
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


# Of three equal masses on equal springs, fixed below: sin((2 k - 1) pi j / 7), j = 1, 2, 3.
SHAPES = np.sin(np.outer((1, 3, 5), (1, 2, 3)) * np.pi / 7)
HERTZ = np.array([1.0, 2.8, 4.05])


def written(path, hertz, shapes, floors=("2F", "3F", "RF")):
    rows = [
        f"{k},{f},{','.join(map(str, row))}"
        for k, (f, row) in enumerate(zip(hertz, shapes, strict=True), 1)
    ]
    path.write_text("\n".join([f"mode,frequency_hz,{','.join(floors)}", *rows]), encoding="utf-8")
    return str(path)


def test_the_same_modes_in_another_order_scale_and_sign_are_partners(tmp_path):
    order = [2, 0, 1]
    one = written(tmp_path / "one.csv", HERTZ, SHAPES)
    two = written(tmp_path / "two.csv", 1.1 * HERTZ[order], -3.0 * SHAPES[order])
    found = femupdate.compare(tmp_path, one, two)
    assert [(row["mode"], row["is_mode"]) for row in found.pairs] == [
        ("1", "2"),
        ("2", "3"),
        ("3", "1"),
    ]
    # Shapes of equal masses are orthogonal.
    np.testing.assert_allclose(found.mac, np.eye(3)[:, order], atol=1e-12)
    np.testing.assert_allclose([row["comac"] for row in found.comac], 1.0)
    np.testing.assert_allclose([row["change"] for row in found.pairs], 0.1)


def test_comac_shows_the_floor_that_differs(tmp_path):
    changed = SHAPES.copy()
    changed[:, 1] *= [1.0, 0.6, 1.5]
    one = written(tmp_path / "one.csv", HERTZ, SHAPES)
    found = femupdate.compare(tmp_path, one, written(tmp_path / "two.csv", HERTZ, changed))
    unit, other = ([row / np.sqrt(sum(row**2)) for row in rows] for rows in (SHAPES, changed))
    for floor in range(3):
        pairs = [(unit[k][floor], other[k][floor]) for k in range(3)]
        whole = sum(abs(a * b) for a, b in pairs) ** 2
        parts = sum(a**2 for a, _ in pairs) * sum(b**2 for _, b in pairs)
        assert found.comac[floor]["comac"] == pytest.approx(whole / parts)
    assert min(found.comac, key=lambda row: row["comac"])["floor"] == "3F"


def test_a_mode_without_a_partner_and_files_without_floors_in_common_are_told(tmp_path):
    one = written(tmp_path / "one.csv", HERTZ, SHAPES)
    fewer = femupdate.compare(tmp_path, one, written(tmp_path / "two.csv", HERTZ[:2], SHAPES[:2]))
    assert fewer.as_dict()["alone"] == ["mode 3 of one.csv has no partner."]
    other = written(tmp_path / "three.csv", HERTZ, SHAPES, ("4F", "5F", "RF"))
    with pytest.raises(MeasurementError, match="1 floors in common"):
        femupdate.compare(tmp_path, one, other)


def test_a_picture_of_two_sets_of_modes_is_refused(tmp_path):
    from click.testing import CliRunner
    from femupdate.cli.main import group

    files = [written(tmp_path / name, HERTZ, SHAPES) for name in ("one.csv", "two.csv")]
    done = CliRunner().invoke(group, ["compare", *files, "--picture", str(tmp_path / "a.png")])
    assert done.exit_code == 1
    assert "there is no figure to draw; known: tables alone" in done.output
    assert not (tmp_path / "a.png").exists()


def test_frac_is_one_of_the_same_curve_and_falls_where_it_moves(tmp_path):
    """Of three equal masses on equal springs, the springs softened and a channel doubled."""

    def curves(soft, gain, name):
        grid = np.arange(0.5, 5.0, 0.05)
        unit = SHAPES / np.sqrt((SHAPES**2).sum(1))[:, None]
        ratio = grid / (HERTZ[:, None] * np.sqrt(soft))
        amplified = 1.0 + ratio**2 / (1.0 - ratio**2 + 0.1j * ratio)
        h = (unit * unit.sum(1)[:, None]).T @ amplified * np.array([[1.0], [1.0], [gain]])
        parts = np.column_stack([grid, *(part for row in h for part in (row.real, row.imag))])
        head = "frequency_hz," + ",".join(f"{f}_re,{f}_im" for f in ("2F", "3F", "RF"))
        np.savetxt(tmp_path / name, parts, delimiter=",", header=head, comments="")
        return h, str(tmp_path / name)

    first, plain = curves(1.0, 1.0, "one.csv")
    _, gained = curves(1.0, 2.0, "gained.csv")
    moved, two = curves(0.8, 1.0, "two.csv")
    found = femupdate.compare(tmp_path, plain, gained)
    np.testing.assert_allclose([row["frac"] for row in found.frac], 1.0)
    np.testing.assert_allclose([row["ratio"] for row in found.frac], [1, 1, 2])
    alike = femupdate.compare(tmp_path, plain, gained, columns={"4F": "RF"})
    assert [row["floor"] for row in alike.frac] == ["2F", "3F", "4F"]
    found = femupdate.compare(tmp_path, plain, two)
    product = [abs(np.vdot(a, b)) ** 2 for a, b in zip(first, moved, strict=True)]
    size = (np.abs(first) ** 2).sum(1) * (np.abs(moved) ** 2).sum(1)
    np.testing.assert_allclose([row["frac"] for row in found.frac], product / size, rtol=1e-6)
    modes = written(tmp_path / "modes.csv", HERTZ, SHAPES)
    for there, missing in ((plain, "nobody"), (modes, "nobody.uff")):
        with pytest.raises(StudyError, match=f"called {missing}"):
            femupdate.compare(tmp_path, there, missing)
    for other, words in ((modes, "no mode in the file"), (plain, "named twice")):
        with pytest.raises(MeasurementError, match=words):
            femupdate.compare(tmp_path, plain, other)


def test_frac_of_a_model_and_its_record(tower, tower_observation):
    """The posterior's mean reproduces the record that it comes from."""
    found = femupdate.compare(tower, "posterior", str(tower_observation.path))
    assert [row["floor"] for row in found.frac] == ["2F", "RF"]
    assert min(row["frac"] for row in found.frac) > 0.99
