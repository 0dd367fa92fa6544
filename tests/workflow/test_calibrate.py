"""calibrate against quadrature, closed forms and truths, by both likelihoods."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from femupdate.dynamics import reduced_modes
from femupdate.errors import MeasurementError
from femupdate.inference import (
    DrawnBy,
    Parameter,
    Parameters,
    Posterior,
    PredictiveCheck,
    SmcSettings,
    load_posterior,
    predictive_check,
)
from femupdate.measurement import Observation
from femupdate.study import Study
from femupdate.surrogate import TRAINED, Surrogate, TrainingSettings, require_surrogate
from femupdate.workflow import (
    CalibrationSettings,
    ObservationSource,
    calibrate_study,
    draw_zeta,
    measured_of,
    open_study,
    settled_likelihood,
    train_study,
)
from femupdate.workflow.calibration_report import predictive_log_frf
from femupdate.workflow.conclusion import Fitting, judgement, overstated_noise
from tests.workflow.by_hand import GRID, grid_about, tower_frf, write_table

SHARED = Path(__file__).parents[3] / "shared" / "data"
QUICK = CalibrationSettings(
    particles=200, exact=True, chains=2, smc=SmcSettings(moves=4, independence_moves=2)
)
TRUTH, ZETA = np.array([0.8, 1.3]), 0.05


@pytest.fixture(scope="module")
def frf_table(tmp_path_factory):
    """A table of the tower's own FRFs with noise of a tenth on ln|H|, and that ln|H|."""
    noise = 0.1 * np.random.default_rng(5).standard_normal((2, GRID.size))
    log_frf = np.log(np.abs(tower_frf(TRUTH, ZETA, GRID))) + noise
    return write_table(tmp_path_factory.mktemp("table") / "frf.csv", log_frf, 0.1), log_frf


def quadrature(log_frf, grid, noise=0.1):
    """Mean, sd and log evidence of (theta_1, theta_2, zeta) on a grid of `grid_about`."""
    points, mass = grid
    misfit = np.array(
        [
            (((np.log(np.abs(tower_frf(p[:2], p[2], GRID))) - log_frf) / noise) ** 2).sum()
            for p in points
        ]
    )
    least = misfit.min()
    weight = np.exp(-0.5 * (misfit - least))
    mean = weight @ points / weight.sum()
    sd = np.sqrt(weight @ (points - mean) ** 2 / weight.sum())
    return mean, sd, np.log(weight.sum()) + mass - 0.5 * least


def test_the_exact_posterior_is_that_of_quadrature(tmp_path, tower_file, frf_table):
    path, log_frf = frf_table
    study = Study(tmp_path)
    settings = CalibrationSettings(particles=2000, exact=True)
    report = calibrate_study(
        study, open_study(study, str(tower_file)), ObservationSource(path), settings
    )
    draws = np.column_stack([report.posterior.samples, report.posterior.zeta_samples])
    mean, sd, log_evidence = quadrature(log_frf, grid_about(draws))
    # 2000 draws, of which a third at least count as independent: a mean errs by .04 sd, an sd by
    # .03 of itself; four times that.
    np.testing.assert_allclose((draws.mean(axis=0) - mean) / sd, 0.0, atol=0.16)
    np.testing.assert_allclose(draws.std(axis=0), sd, rtol=0.12)
    told = report.posterior.drawn
    assert told.exact
    assert told.log_evidence == pytest.approx(
        log_evidence, abs=max(4 * told.log_evidence_error, 0.2)
    )
    assert told.effective_sample_size is not None
    assert told.evaluations > 2000
    assert (np.abs(mean[:2] - TRUTH) < 3 * sd[:2]).all()
    assert report.misfit == pytest.approx(1.0, abs=0.3)  # 120 points: sd .13
    assert report.invalid == 0
    assert not any("misses" in note for note in report.notes)


def test_damping_is_drawn_as_sharply_as_the_data_tell_it(tmp_path, tower_model):
    """A hundredth of the prior: against quadrature of its density at the true factors."""
    noise = 0.01 * np.random.default_rng(6).standard_normal((2, GRID.size))
    log_frf = np.log(np.abs(tower_frf(TRUTH, ZETA, GRID))) + noise
    path = write_table(tmp_path / "frf.csv", log_frf, 0.01)
    measured = measured_of(tower_model.building, ObservationSource(path))
    likelihood = settled_likelihood(tower_model, measured, QUICK).likelihood
    drawn = draw_zeta(tower_model, likelihood, np.tile(TRUTH, (4000, 1)), 0)
    fine = np.linspace(0.045, 0.055, 2001)
    missed = [np.log(np.abs(tower_frf(TRUTH, zeta, GRID))) - log_frf for zeta in fine]
    weight = np.square(missed).sum(axis=(1, 2)) / 0.01**2
    weight = np.exp(-0.5 * (weight - weight.min()))
    mean = weight @ fine / weight.sum()
    sd = np.sqrt(weight @ (fine - mean) ** 2 / weight.sum())
    assert sd < 0.01 * 0.09
    # A cell of the grid is at most a fifth of what counts, some six sd: that widens by a twentieth.
    assert drawn.mean() == pytest.approx(mean, abs=0.3 * sd)
    assert drawn.std() == pytest.approx(sd, rel=0.15)


def test_the_posterior_of_the_tower(tower, tower_observation):
    """Histories in, and what is stored is what is told."""
    posterior = load_posterior(tower.require("posterior", "calibrate"))
    assert posterior.names == ("theta_1", "theta_2")
    assert posterior.theta.shape == (1, 400, 2)  # independent draws about the maxima
    assert posterior.drawn.exact
    error = np.abs(posterior.samples.mean(axis=0) - tower_observation.theta)
    # The H1 estimate smears the peaks a little: three standard deviations, below half a percent.
    assert (error < 3 * posterior.samples.std(axis=0)).all()
    assert (error < 0.005).all()
    assert posterior.zeta_samples.mean() == pytest.approx(0.05, rel=0.1)


def calibrated(study, model, path, settings=QUICK, **source):
    return calibrate_study(study, model, ObservationSource(path, **source), settings)


def test_a_band_leaves_the_rest_out(tower_model, frf_table):
    """Floors asked for in any order, and twice, count once."""
    source = ObservationSource(frf_table[0], sensors=("RF", "2F", "RF"), band_hz=(0.5, 6.0))
    observation = measured_of(tower_model.building, source).base
    assert observation.floors == ("2F", "RF")
    seen = observation.frequency_hz[observation.valid.all(axis=0)]
    assert (seen.min(), seen.max()) == pytest.approx((0.6, 6.0))
    assert observation.valid.sum() == 2 * 28
    assert np.isnan(observation.log_frf[~observation.valid]).all()


def test_a_real_frame_is_followed_and_its_misfit_told(tmp_path):
    """A bench-top frame measured by others. A chain of equal masses has the wrong form: its first
    mode comes out up to 4 % off the peak of H1, the two others within 2 %, and the note says so.
    """
    path = SHARED / "mini_flexible_sine1p5.csv"
    if not path.exists():
        pytest.skip("the measured files are not beside this checkout")
    columns = {"time_s": "t_s", "base": "a_base", "2F": "a_1F", "3F": "a_2F", "RF": "a_3F"}
    study = Study(tmp_path)
    model = open_study(study, "shear_3dof")
    report = calibrated(study, model, path, unit="m/s2", columns=columns, band_hz=(0.5, 20.0))
    source = ObservationSource(path, "m/s2", columns)
    roof = measured_of(model.building, source).base.log_frf[2]
    grid = model.frequency_hz.numpy()
    peaks = [
        grid[np.nanargmax(np.where((grid > low) & (grid < high), roof, -np.inf))]
        for low, high in ((2, 6), (9, 13), (14, 20))
    ]
    # The peaks that others read off these runs.
    np.testing.assert_allclose(peaks, [3.78, 11.2, 16.7], rtol=0.015)
    mean = report.posterior.samples.mean(axis=0)
    found = reduced_modes(model.reduced, mean[None]).frequency_hz[0]
    assert found[0] == pytest.approx(peaks[0], rel=0.05)
    np.testing.assert_allclose(found[1:], peaks[1:], rtol=0.02)
    assert report.misfit > 4.0
    assert any("something is missing in the model" in note for note in report.notes)
    assert any("the intervals allow for what shows" in note for note in report.notes)


def test_a_second_observation_replaces_the_first(
    tmp_path, tower_model, tower_observation, frf_table
):
    study = Study(tmp_path)
    first = calibrated(study, tower_model, tower_observation.path)
    files = {path.name for path in tmp_path.rglob("*")}
    second = calibrated(study, tower_model, frf_table[0], sensors=("RF",))
    kept = load_posterior(study.require("posterior", "calibrate"))
    np.testing.assert_array_equal(kept.theta, second.posterior.theta)
    assert kept.observation.source == "frf.csv"
    assert first.path == second.path
    artefact = study.artefacts()["posterior"]
    assert artefact.settings["sensors"] == ["RF"]
    assert artefact.settings["file"] == str(frf_table[0])
    assert {path.name for path in tmp_path.rglob("*")} == files
    assert "sampling" not in files


def test_one_seed_one_posterior(tmp_path, tower_model, frf_table):
    settings = replace(QUICK, seed=4)
    one, same = (
        calibrated(Study(tmp_path / name), tower_model, frf_table[0], settings).posterior
        for name in ("one", "same")
    )
    np.testing.assert_array_equal(one.values, same.values)
    assert one.drawn == same.drawn


def test_predicted_responses_are_the_tower_s(tower, tower_model):
    posterior = load_posterior(tower.path("posterior.nc"))
    predicted = predictive_log_frf(tower_model.system, tower_model, posterior, count=5, seed=2)
    draws = posterior.thinned(5, 2).numpy()
    theta, zeta = draws[:, :-1], draws[:, -1]
    for row, (t, z) in enumerate(zip(theta, zeta, strict=True)):
        expected = np.log(np.abs(tower_frf(t, z, GRID)))
        # Single precision where FRFs are drawn in bulk.
        np.testing.assert_allclose(predicted[row], expected, atol=1e-4)


@pytest.fixture(scope="module")
def learned(tmp_path_factory, tower_file):
    """A study with a surrogate that has seen little: enough to be in the right half."""
    study = Study(tmp_path_factory.mktemp("learned") / "study")
    model = open_study(study, str(tower_file))
    train_study(study, model, 600, TrainingSettings(epochs=6, batch=64))
    return study, model


CHECKED = {
    "cases": 40,
    "floors": ["2F", "RF"],
    "coverage_90_before": 0.91,
}


def test_the_latent_posterior(learned, tower_observation, tmp_path):
    study, model = learned
    settings = CalibrationSettings(particles=400)
    report = calibrated(study, model, tower_observation.path, settings)
    posterior = report.posterior
    assert posterior.drawn.likelihood == "latent"
    assert posterior.drawn.log_evidence is None
    assert posterior.theta.shape == (4, 100, 2)
    # zeta is drawn after theta, by the data-space likelihood.
    assert posterior.zeta.shape == (4, 100)
    assert ((posterior.zeta >= 0.01) & (posterior.zeta <= 0.1)).all()
    prior_sd = 1.5 / np.sqrt(12)
    assert (posterior.samples.std(axis=0) < 0.7 * prior_sd).all()
    assert posterior.samples[:, 0].mean() < 1.0 < posterior.samples[:, 1].mean()
    surrogate = require_surrogate(study, model.building)
    marked = Surrogate(surrogate.mvae, replace(surrogate.info, calibration=CHECKED))
    other = Study(tmp_path)
    other.keep(TRAINED, model.made_from(), marked)
    again = calibrated(other, model, tower_observation.path, settings, sensors=("RF", "2F"))
    assert "In 40 simulations the 90 % region contained 91 % of" in " ".join(again.notes)


def test_an_observation_unlike_the_training_is_told(learned, tmp_path, frf_table):
    """Six times the response: no stiffness makes such an amplification at low frequencies."""
    study, model = learned
    head, *lines = frf_table[0].read_text().splitlines()
    far = tmp_path / "far.csv"
    rows = [line.split(",") for line in lines]
    raised = [[f, *(str(6.0 * float(h)) for h in (a, b)), *noise] for f, a, b, *noise in rows]
    far.write_text("\n".join([head, *(",".join(row) for row in raised)]) + "\n")
    settings = CalibrationSettings(particles=400)
    with pytest.raises(MeasurementError, match="unlike anything that tower can do"):
        calibrated(study, model, far, settings)
    report = calibrated(study, model, far, replace(settings, anyway=True))
    assert any("unlike anything that this building can do" in n for n in report.notes)


FACTORS = Parameters.uniform(("theta_1", "theta_2"), [1.0 / 3.0] * 2, [3.0] * 2)
KNOWN = Parameter(name="zeta", kind="damping", lower=0.05, upper=0.05)


@pytest.mark.parametrize("rms", [0.1, 0.27, 0.49])
def test_residuals_far_below_the_noise_are_told_with_their_size(rms):
    (note,) = overstated_noise(Fitting(misfit=rms**2, check=None))
    assert f"by {rms:.2g} times" in note
    assert "wide rather than narrow" in note


@pytest.fixture
def pressed():
    """A posterior whose second factor lies at the upper limit of its prior."""
    rng = np.random.default_rng(0)
    theta = np.stack([rng.uniform(0.9, 1.1, 500), 3.0 - 0.001 * rng.random(500)], axis=1)
    seen = np.ones((1, 4))
    return Posterior(
        parameters=FACTORS + Parameters((KNOWN,)),
        values=np.column_stack([theta, np.full(len(theta), 0.05)])[None],
        log_likelihood=np.zeros((1, 500)),
        drawn=DrawnBy(likelihood="exact", way="drawing", chains=1, evaluations=500),
        observation=Observation(
            frequency_hz=np.arange(1.0, 5.0),
            floors=("RF",),
            log_frf=seen,
            noise_sd=0.1 * seen,
            valid=seen > 0.0,
        ),
        settings={},
    )


def test_a_factor_at_the_limit_of_its_prior_is_told(pressed):
    (note,) = judgement(pressed, Fitting(misfit=1.0, check=None))
    assert note.startswith("theta_2 (3) presses against the prior's upper limit")
    assert "upper of [prior.theta]" in note


def test_a_damping_ratio_at_the_limit_of_its_prior_is_told(pressed):
    free = Parameter(name="zeta", kind="damping", lower=0.003, upper=0.06)
    values = np.concatenate([np.ones((1, 500, 2)), np.full((1, 500, 1), 0.0032)], axis=2)
    at_limit = replace(pressed, parameters=FACTORS + Parameters((free,)), values=values)
    (note,) = judgement(at_limit, Fitting(misfit=1.0, check=None))
    assert note.startswith("the damping ratio (0.003) presses against the prior's lower limit")
    assert "lower of [prior.zeta]" in note


def test_noise_that_no_file_states_is_called_assumed():
    (note,) = overstated_noise(Fitting(misfit=0.04, check=None), assumed=True)
    assert "the noise assumed" in note


@pytest.mark.parametrize(("ratio", "told"), [(1.2, 0), (2.25, 1)])
def test_a_small_p_value_is_no_warning_where_hardly_more_is_missed(pressed, ratio, told):
    check = PredictiveCheck(1e-5, (1e-5,), ("RF",), (ratio,))
    notes = judgement(pressed, Fitting(misfit=1.0, check=check))
    assert sum("1.5 times what is allowed for" in one for one in notes) == told
    assert sum("allowed for" in one for one in notes) == told


def test_a_floor_is_named_that_the_others_outweigh(pressed):
    """Of a thousand squares one floor has four times what is allowed for, and nine have a half."""
    squares = np.array([[4.0, *[0.5] * 9]]) * 100.0
    floors = tuple(f"{k}F" for k in range(2, 12))
    check = predictive_check(squares, [100.0] * 10, floors)
    assert check.whole > 0.99
    first = judgement(pressed, Fitting(misfit=1.0, check=check))[0]
    assert "at 2F by 2 times what is allowed for" in first
    alike = predictive_check(0.0 * squares + 200.0, [100.0] * 10, floors)
    assert (alike.whole < 0.01, alike.missed) == (True, ())  # no floor more than the others


def test_a_misfit_is_told_once(pressed):
    check = PredictiveCheck(1e-5, (1e-5,), ("RF",), (4.0,))
    for learned, count in ((False, 1), (True, 2)):
        notes = judgement(pressed, Fitting(misfit=4.1, check=check, learned=learned))
        assert sum(" times " in one for one in notes) == count


def test_what_decides_comes_before_a_limit(pressed):
    first, second = judgement(pressed, Fitting(misfit=49.0, check=None))
    assert "misses the measured ln|H| by 7.0 times its noise" in first
    assert "theta_2" in second
