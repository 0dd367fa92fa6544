"""Two records at different levels: softening is named, put into the building, and left out."""

import re
import tomllib

import numpy as np
import pytest

from femupdate.errors import BuildingError
from femupdate.measurement import GroundMotion
from femupdate.simulation import parse_effect
from femupdate.study import Study
from femupdate.workflow import (
    ObservationSource,
    PredictionSettings,
    RecordSource,
    diagnose_study,
    level_between,
    measured_of,
    open_study,
    predict_study,
    repair_study,
)
from tests.chains import Chain
from tests.helpers import write_record
from tests.sticks import MASSES, SPRINGS, STEP, write_shaken, write_stick

THETA = np.array([0.8, 1.4, 1.1])
SOFTER, TIMES = 0.8, 4.0


def _chain(theta, zeta):
    return Chain(MASSES, theta * SPRINGS, zeta=zeta)


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    folder = tmp_path_factory.mktemp("second")
    write_stick(folder / "three.toml")
    write_shaken(folder / "weak.csv", _chain(THETA, 0.04), 1, 0.3)
    write_shaken(folder / "strong.csv", _chain(SOFTER * THETA, 0.05), 2, TIMES * 0.3)
    write_shaken(folder / "same.csv", _chain(THETA, 0.04), 4, TIMES * 0.3)
    (folder / "modes.csv").write_text("mode,frequency_hz\n1,4.0\n2,11.0\n")
    return folder


@pytest.fixture
def study(home, tmp_path):
    return Study(tmp_path / "study")


def _open(study, home):
    return open_study(study, str(home / "three.toml"))


@pytest.fixture(scope="module")
def repaired(home):
    """What repair made of the weak and the strong record; its study is only read."""
    study = Study(home / "softened")
    both = ObservationSource(home / "weak.csv", further=(home / "strong.csv",))
    return repair_study(study, _open(study, home), both)


def test_softening_is_named_repaired_and_of_the_right_size(repaired, study, home):
    report, model = repaired, _open(study, home)
    weak, strong = (ObservationSource(home / name) for name in ("weak.csv", "strong.csv"))
    assert [one.finding.placed.label for one in report.repair.rounds] == ["amplitude_softening@all"]
    content = tomllib.loads(report.building_path.read_text())
    own = content["effects"][0]["parameters"]
    level = level_between(model, weak, strong)
    assert (1.0 + own["size"]) ** level == pytest.approx(SOFTER, rel=0.01)
    assert (1.0 + own["damping"]) ** level == pytest.approx(1.25, rel=0.1)
    np.testing.assert_allclose(report.theta_after.mean(axis=0), THETA, rtol=0.01)
    before, after = (fit.p_value for fit in (report.repair.before, report.repair.after))
    assert before < 1e-6
    assert after > 0.05
    before, after = report.in_turn
    assert before > 1.5 > after
    told = report.as_dict()
    assert [told[f"halves_chi2_{when}"] for when in ("before", "after")] == [before, after]
    assert f"kept out in turn: error (chi2 a point) {before:.1f} -> " in "\n".join(
        report.lines(details=True)
    )
    # The repaired building is an ordinary one: the first record alone is explained by it.
    again = diagnose_study(report.study, open_study(report.study, None), weak)
    assert again.diagnosis.verdict == "none"


def test_a_stronger_record_of_the_same_building_names_nothing(study, home):
    both = ObservationSource(home / "weak.csv", further=(home / "same.csv",))
    report = diagnose_study(study, _open(study, home), both)
    assert report.diagnosis.verdict == "none"
    tested = [one.placed.effect.name for one in report.diagnosis.scores]
    assert "amplitude_softening" in tested


def test_what_states_no_level_is_taken_at_that_of_the_first_record(study, home):
    """Modes after two records at unlike levels."""
    files = (home / "strong.csv", home / "modes.csv")
    source, model = ObservationSource(home / "weak.csv", further=files), _open(study, home)
    told, *_ = measured_of(model.building, source, apart=True).notes_of_others
    weak, strong = (ObservationSource(home / name) for name in ("weak.csv", "strong.csv"))
    times = 2.0 ** level_between(model, weak, strong)
    assert f"strong.csv at {times:.2g} times that of weak.csv, at which all others" in told


def test_one_simulation_has_one_level(study, home):
    building = _open(study, home).building
    with pytest.raises(BuildingError, match="two levels"):
        parse_effect(building, "amplitude_softening@all", (-0.1,))


def test_another_strong_motion_is_predicted_with_the_stiffness_at_its_level(repaired, home):
    """A record kept out, of the softened chain."""
    other = home / "other.csv"
    write_shaken(other, _chain(SOFTER * THETA, 0.05), 9, TIMES * 0.3)
    base = np.loadtxt(other, delimiter=",", skiprows=2, usecols=1)
    record = write_record(home / "other_base.csv", GroundMotion(base, STEP))
    report = predict_study(
        repaired.study,
        open_study(repaired.study),
        RecordSource(record),
        PredictionSettings(samples=30, scatter=0.0, damping_scatter=0.0),
        measured=other,
    )
    # What two levels explain is no error that another event draws anew.
    peaks = report.summary.peak_acceleration
    assert (peaks.std(axis=0) < 0.05 * peaks.mean(axis=0)).all()
    # 0.002 m/s2 of noise and the errors of what was found from two records.
    assert all(of["relative_error"] < 0.05 for of in report.comparison.values())
    (told,) = re.findall(r"motion is ([0-9.]+) times as strong", " ".join(report.notes))
    # Floors answer to noise as the root of base motion squared over damping.
    assert float(told) == pytest.approx(TIMES * np.sqrt(0.04 / 0.05), rel=0.05)
    assert not any("beyond" in note for note in report.notes)
    np.testing.assert_allclose(report.story_stiffness.mean, SOFTER * THETA * SPRINGS, rtol=0.02)
