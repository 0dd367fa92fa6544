"""calibrate from the record of a shaker or a hammer, against the tower's own response to it."""

import numpy as np
import pytest

from femupdate.errors import MeasurementError
from femupdate.study import Study
from femupdate.workflow import (
    CalibrationSettings,
    ObservationSource,
    calibrate_study,
    measured_of,
    open_study,
)
from tests.workflow.by_hand import tower_modes

TRUTH, ZETA = np.array([0.8, 1.3]), 0.05
STEP, COUNT = 0.02, 6000


def shaker(rng):
    return 200.0 * rng.normal(size=COUNT)


def hammer(rng):
    """Twelve hits of a soft hammer, nine seconds apart."""
    time = STEP * np.arange(COUNT)
    hits = [8.0e3 * np.exp(-(((time - start) / 0.02) ** 2)) for start in 3.0 + 9.0 * np.arange(12)]
    return np.sum(hits, axis=0) * (1.0 + 0.1 * rng.normal())


@pytest.fixture
def record(tmp_path):
    """A file of a force at the roof and the floors' accelerations under it, with noise."""

    def build(force, seed=1, scale=1.0):
        rng = np.random.default_rng(seed)
        own, modes = tower_modes(TRUTH)
        pushed = force(rng)
        # Zeros behind the record: nothing wraps round.
        frequency = np.fft.rfftfreq(4 * COUNT, STEP)
        ratio = frequency[:, None] / own
        gain = -(ratio**2) / (1.0 - ratio**2 + 2j * ZETA * ratio)
        accelerance = (modes * modes[1]) @ gain.T
        floors = np.fft.irfft(accelerance * np.fft.rfft(pushed, 4 * COUNT), 4 * COUNT)[:, :COUNT]
        floors += 0.02 * floors.std() * rng.normal(size=floors.shape)
        path = tmp_path / f"{force.__name__}.csv"
        values = np.column_stack([STEP * np.arange(COUNT), scale * pushed / 1e3, *floors])
        head = "time_s,force/RF (kN),2F (m/s2),RF (m/s2)"
        np.savetxt(path, values, fmt="%.8g", delimiter=",", header=head, comments="")
        return path

    return build


def test_the_building_is_found(record, tower_file, tmp_path):
    study = Study(tmp_path / "study")
    model = open_study(study, str(tower_file))
    settings = CalibrationSettings(particles=1000)
    report = calibrate_study(study, model, ObservationSource(record(hammer)), settings)
    draws = report.posterior.samples
    assert (np.abs(draws.mean(axis=0) - TRUTH) < 3.0 * draws.std(axis=0)).all()
    assert draws.std(axis=0).max() < 0.03
    assert report.check.names == ("2F/RF", "RF/RF")
    assert report.check.whole > 0.001


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("force/RF (kN)", "force/RF", "the force's unit is not given"),
        ("force/RF (kN)", "force/RF (gal)", "the force's unit is gal"),
        ("2F (m/s2)", "force/2F (kN)", "forces act at RF and 2F"),
        ("force/RF (kN)", "force/9F (kN)", "9F"),
    ],
)
def test_records_that_cannot_be_used(record, tower_file, tmp_path, old, new, words):
    path = record(shaker)
    text = path.read_text()
    path.write_text(text.replace(old, new, 1))
    study = Study(tmp_path / "study")
    model = open_study(study, str(tower_file))
    with pytest.raises(MeasurementError, match=words):
        calibrate_study(study, model, ObservationSource(path), CalibrationSettings(particles=1000))


def test_diagnose_says_what_it_needs(record):
    from femupdate.measurement import read_observation_file

    with pytest.raises(MeasurementError, match="responses to a force, which calibrate,"):
        read_observation_file(record(shaker))


def test_motion_of_the_base_beside_a_force_is_told(record, tower_file, tmp_path):
    """It is no part of the response to a force: whoever measured it must know what became of it."""
    path = record(shaker)
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    base = 0.1 * table[:, 2:].std(axis=0).max() * np.random.default_rng(2).normal(size=len(table))
    head = path.read_text().splitlines()[0] + ",base (m/s2)"
    rows = np.column_stack([table, base])
    np.savetxt(path, rows, fmt="%.8g", delimiter=",", header=head, comments="")
    model = open_study(Study(tmp_path / "study"), str(tower_file))
    measured = measured_of(model.building, ObservationSource(path))
    (told,) = (note for note in measured.notes if "base's motion" in note)
    assert "(10 % of the largest floor's, rms) is not used beside the force at RF" in told
