"""A tower that softens while it shakes: its law found from one run, and then predicted with."""

import numpy as np
import pytest
import torch
from scipy.signal import butter, sosfilt

from femupdate.dynamics import OwnLevel, history_batches, motion_level
from femupdate.inference import load_posterior
from femupdate.measurement import GroundMotion
from femupdate.study import Study
from femupdate.workflow import (
    CalibrationSettings,
    ObservationSource,
    PredictionSettings,
    RecordSource,
    calibrate_study,
    open_study,
    open_system,
    predict_study,
)

THETA, ZETA, SIZE, DAMPING, STEP = (0.8, 1.3), 0.03, -0.1, 0.2, 0.01
EFFECT = f"""
[[effects]]
name = "softening_in_run"
place = "all"
parameters = {{ size = {SIZE}, damping = {DAMPING} }}
"""


def shaking(rng):
    """Three minutes of noise whose strength wanders by a factor of six."""
    time = np.arange(18000) * STEP
    band = butter(4, [0.5, 14.0], "band", fs=1.0 / STEP, output="sos")
    strength = np.interp(time, np.linspace(0.0, time[-1], 13), rng.uniform(-1.3, 1.3, 13))
    return time, sosfilt(band, rng.standard_normal(time.size)) * 2.0**strength


@pytest.fixture(scope="module")
def calibrated(tower_file, tmp_path_factory):
    folder = tmp_path_factory.mktemp("softens")
    text = tower_file.read_text(encoding="utf-8") + EFFECT
    (folder / "soft.toml").write_text(text, encoding="utf-8")
    study = Study(folder / "study")
    model = open_study(study, str(folder / "soft.toml"))
    rng = np.random.default_rng(1)
    time, base = shaking(rng)
    parameters = torch.tensor([[*THETA, SIZE, DAMPING]], dtype=torch.float64)
    zeta = torch.tensor([ZETA], dtype=torch.float64)
    system = open_system(study, model)
    (run,) = history_batches(system, parameters, zeta, base, STEP, level=OwnLevel())
    seen = run.floor_acceleration[0] + 0.002 * rng.standard_normal((2, time.size))
    path, head = folder / "run.csv", "time_s,base (m/s2),2F (m/s2),RF (m/s2)"
    rows = np.column_stack([time, base, *seen])
    np.savetxt(path, rows, "%.6g", delimiter=",", header=head, comments="")
    settings = CalibrationSettings(particles=500, exact=True)
    calibrate_study(study, model, ObservationSource(path), settings)
    return study, model, motion_level(run.floor_acceleration[0])


def test_the_law_is_found_from_one_run(calibrated):
    """The model takes the run for a few linear parts, a third of a doubling apart."""
    posterior = load_posterior(calibrated[0].path("posterior.nc"))
    draws = posterior.samples
    mean, sd = draws.mean(axis=0), draws.std(axis=0)
    assert (np.abs(mean - [*THETA, SIZE, DAMPING]) < 3.0 * sd)[2:].all()
    np.testing.assert_allclose(mean[:2], THETA, rtol=0.03)
    # Two fifths of the size are left to the law itself, which noise of even strength shows worse.
    assert sd[2] == pytest.approx(0.4 * abs(SIZE), rel=0.25)
    kept = posterior.settings["level_m_s2"]
    # The middle of the run's levels lies near its mean level, of all floors alike.
    middle = np.array([kept["2F"], kept["RF"]]) / calibrated[2]
    np.testing.assert_allclose(middle, 1.0, rtol=0.1)
    assert middle[0] == pytest.approx(middle[1], rel=0.01)


def test_a_prediction_follows_it(calibrated, tmp_path, write_record):
    """A hundred times stronger and weaker motions are a doubling above and below at most."""
    study, model, _ = calibrated
    _, base = shaking(np.random.default_rng(2))
    record = write_record(tmp_path / "wave.csv", GroundMotion(base[:3000], STEP, channel="EW"))
    softness = []
    for scale in (100.0, 0.01):
        found = predict_study(
            study, model, RecordSource(record, scale=scale), PredictionSettings(samples=5)
        )
        (note,) = [note for note in found.notes if "follow the motion" in note]
        assert "of the run from which it was found" in note
        softness.append(float(1.0 / found.alone.story_stiffness[:, 0].mean()))
    kept = 1.0 + load_posterior(study.path("posterior.nc")).thinned(5, 0)[:, 2].numpy()
    assert softness[0] / softness[1] == pytest.approx((1.0 / kept).mean() / kept.mean(), rel=0.03)
