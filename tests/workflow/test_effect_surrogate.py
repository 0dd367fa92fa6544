"""A surrogate of a building that lists effects: trained, used, and refused where there is none."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from femupdate.building.files import load_building
from femupdate.dynamics.history import floor_histories
from femupdate.errors import SurrogateError
from femupdate.inference.posterior import load_posterior
from femupdate.measurement.record import GroundMotion
from femupdate.study import Study
from femupdate.surrogate.storage import load_surrogate
from femupdate.surrogate.training import TrainingSettings
from femupdate.workflow.calibrate import calibrate_study
from femupdate.workflow.calibrate_settings import CalibrationSettings
from femupdate.workflow.checks import check_calibration, check_training
from femupdate.workflow.effect_surrogate import with_effects
from femupdate.workflow.model import open_study
from femupdate.workflow.observed import ObservationSource
from femupdate.workflow.pictures_posterior import draw_posterior
from femupdate.workflow.predict import predict_study
from femupdate.workflow.prediction_inputs import PredictionSettings, RecordSource
from femupdate.workflow.train import train_study

BUILDING = """\
name = "three"
kind = "shear"

[frequency_grid]
start = "0.2 Hz"
step = "0.1 Hz"
count = 150

[prior.theta]
lower = 0.5
upper = 2

[prior.zeta]
lower = 0.01
upper = 0.1

[damping]
law = "constant"
ratio = 0.04
"""
STORY = '[[stories]]\nname = "S{n}"\nmass = "{m} kg"\nstiffness = "{k} N/m"\n'
EFFECT = '[[effects]]\nname = "{0}"\nplace = "{1}"\n'
EFFECTS = (("added_mass", "3F"), ("foundation_rocking", "base"), ("channel_gain", "RF"))
THETA, SIZES, ZETA, NOISE = (0.8, 1.4, 1.1), (0.15, 0.12, -0.06), 0.04, 0.2
SMALL = TrainingSettings(epochs=6, batch=64, average=0.95)


def write_building(path, *effects):
    stories = "".join(
        STORY.format(n=n + 1, m=m, k=k)
        for n, (m, k) in enumerate(((3.0, 9e3), (2.0, 5e3), (1.5, 4e3)))
    )
    path.write_text(BUILDING + stories + "".join(EFFECT.format(*one) for one in effects))
    return path


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    return tmp_path_factory.mktemp("effect surrogate")


@pytest.fixture(scope="module")
def trained(home):
    """A study with a small surrogate, and what the training told."""
    study = Study(home / "study")
    model = open_study(study, str(write_building(home / "three.toml", *EFFECTS)))
    return study, train_study(study, model, 800, SMALL)


@pytest.fixture(scope="module")
def observation(home, trained):
    """|H| of all floors of a known building, with noise on the logarithm."""
    model = with_effects(trained[0], open_study(trained[0]))
    both = torch.tensor([[*THETA, *SIZES]], dtype=torch.float64)
    zeta = torch.tensor([ZETA], dtype=torch.float64)
    clean = model.system.log_frf(both, zeta, model.frequency_hz)[0].numpy()
    noisy = np.exp(clean + NOISE * np.random.default_rng(2).standard_normal(clean.shape))
    path = home / "observed.csv"
    np.savetxt(
        path,
        np.column_stack([model.frequency_hz.numpy(), *noisy]),
        delimiter=",",
        header="frequency_hz,2F,3F,RF",
        comments="",
    )
    return ObservationSource(path)


def calibrated(study, source, exact):
    settings = CalibrationSettings(particles=2000, exact=exact, chains=2)
    return calibrate_study(study, open_study(study), source, settings)


def test_the_surrogate_comes_back_with_its_effects(trained):
    study, report = trained
    mvae = load_surrogate(report.path).mvae
    own, back = report.surrogate.mvae.form, mvae.form
    assert [one.label for one in back.placed] == [f"{n}@{p}" for n, p in EFFECTS]
    assert replace(back, placed=()) == replace(own, placed=())
    z = torch.randn(5, 7, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(mvae.decode(z), report.surrogate.mvae.decode(z).detach())
    assert (mvae.sizes.parameters, mvae.sizes.effect_sizes) == (6, 3)
    assert not train_study(study, open_study(study), 800, SMALL).trained


def test_the_latent_posterior_is_the_exact_one(trained, observation):
    """A small decoder is enough: the last steps are taken with the building's own responses."""
    latent = calibrated(trained[0], observation, exact=False)
    fast = load_posterior(latent.path)
    exact = load_posterior(calibrated(trained[0], observation, exact=True).path)
    assert fast.drawn.likelihood == "latent"
    assert fast.names == exact.names
    assert fast.names[3:] == tuple(f"{name}@{place}.size" for name, place in EFFECTS)
    np.testing.assert_allclose(fast.bounds, exact.bounds)
    sd = exact.samples.std(axis=0)
    # Two thousand draws each, in a space where the posterior is nearly Gaussian.
    np.testing.assert_allclose(fast.samples.std(axis=0) / sd, 1.0, atol=0.25)
    np.testing.assert_allclose(
        (fast.samples.mean(axis=0) - exact.samples.mean(axis=0)) / sd, 0.0, atol=0.35
    )
    truth = np.array([*THETA, *SIZES])
    assert (np.abs(fast.samples.mean(axis=0) - truth) < 4.0 * fast.samples.std(axis=0)).all()
    assert latent.misfit == pytest.approx(1.0, abs=0.2)
    pictures = draw_posterior(trained[0], latent)
    assert {path.name for path in pictures} >= {"frf_fit.png", "posterior.png"}


def test_predict_takes_the_latent_posterior_of_effects(
    trained, observation, tmp_path, write_record
):
    """Floors move as in the building that was observed, whatever one of their sensors reads."""
    study, time = trained[0], 0.01 * np.arange(1500)
    calibrated(study, observation, exact=False)
    wave = np.exp(-(((time - 4.0) / 1.2) ** 2)) * np.sin(2 * np.pi * 5.0 * time + 0.3)
    record = write_record(tmp_path / "wave.csv", GroundMotion(wave, 0.01))
    model = open_study(study)
    report = predict_study(study, model, RecordSource(record), PredictionSettings(samples=100))
    system = with_effects(study, model).system
    truth = floor_histories(system, np.array([[*THETA, *SIZES]]), ZETA, wave, 0.01)
    peak = np.abs(truth.floor_acceleration[0]).max(axis=1)
    found = report.peak_acceleration
    assert (np.abs(found.mean - peak) < 4.0 * found.sd).all()
    np.testing.assert_allclose(found.mean, peak, rtol=0.1)


def test_without_training_the_sentence_says_what_to_do(home, observation):
    plain = write_building(home / "plain.toml", ("added_mass", "3F"))
    settings = CalibrationSettings(particles=400)
    with pytest.raises(SurrogateError, match=r"femupdate train .* --exact"):
        check_calibration(Study(home / "none"), observation, settings, str(plain))


@pytest.mark.parametrize("name", ["story_damper", "tuned_appendage"])
def test_what_makes_modes_complex_is_refused_before_anything_is_written(home, observation, name):
    study = Study(home / "complex")
    damped = str(write_building(home / "damped.toml", (name, "2F")))
    for check in (
        lambda: check_training(study, 1000, 64, building=damped),
        lambda: check_calibration(study, observation, CalibrationSettings(), damped),
    ):
        with pytest.raises(SurrogateError) as refused:
            check()
        sentence = str(refused.value)
        assert f"{name} at 2F" in sentence
        assert "--exact" in sentence
        assert "\n" not in sentence
    check_calibration(study, observation, CalibrationSettings(exact=True), damped)
    assert not study.folder.exists()
    assert load_building(damped).effects[0].name == name
