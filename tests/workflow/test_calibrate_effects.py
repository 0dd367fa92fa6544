"""A building that lists effects is calibrated as any other, and told as much of."""

import json
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from femupdate.building import load_building
from femupdate.errors import MeasurementError
from femupdate.inference import load_posterior
from femupdate.simulation import SimulationSettings, simulate_observation, write_simulation
from femupdate.study import Study
from femupdate.workflow import CalibrationSettings, ObservationSource, calibrate_study, open_study
from tests.workflow.by_hand import GRID, tower_frf, write_table

ZETA, SD = 0.05, 0.05
EXACT = CalibrationSettings(particles=1000, exact=True)


@pytest.fixture(scope="module")
def listed(tmp_path_factory, tower_file):
    """The tower with a gain of its roof's channel."""
    path = tmp_path_factory.mktemp("listed") / "listed.toml"
    effect = '\n[[effects]]\nname = "channel_gain"\nplace = "RF"\n'
    path.write_text(Path(tower_file).read_text() + effect)
    return path


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """Writes |H| of both floors at some stiffness factors."""
    folder, made = tmp_path_factory.mktemp("tables"), []

    def write(theta, seed, noise=SD, off=0.0):
        clean = np.log(np.abs(tower_frf(np.array(theta), ZETA, GRID)))
        clean[0] += off
        noisy = clean + noise * np.random.default_rng(seed).standard_normal(clean.shape)
        made.append(write_table(folder / f"{len(made)}.csv", noisy, SD))
        return made[-1]

    return write


@pytest.fixture
def calibrate(tmp_path):
    def run(building, *paths, settings=EXACT, **reading):
        study = Study(tmp_path / Path(building).stem)
        source = ObservationSource(paths[0], further=paths[1:], **reading)
        return study, calibrate_study(study, open_study(study, str(building)), source, settings)

    return run


def test_an_effect_of_size_nothing_leaves_every_interval_as_it_is(calibrate, tmp_path):
    """P-Delta of a building whose stories are 10 km high, beside the building without it."""
    plain = files("femupdate.models").joinpath("shear_3dof.toml").read_text()
    tall = plain.replace("stiffness_per_mass", 'height = "10000 m"\nstiffness_per_mass')
    assert tall.count("10000 m") == 3
    path = tmp_path / "tall.toml"
    path.write_text(tall + '\n[[effects]]\nname = "p_delta"\nplace = "all"\n')
    asked = SimulationSettings(
        theta=(0.8, 1.2, 1.1),
        zeta=0.02,
        duration_s=120.0,
        sampling_hz=120.0,
        band_hz=(0.3, 25.0),
        rms_m_s2=0.3,
        sensor_noise_m_s2=0.003,
        seed=3,
    )
    made = simulate_observation(load_building("shear_3dof"), asked)
    record = write_simulation(made, tmp_path / "record.csv").observation
    without, with_it = (
        calibrate(building, record)[1].posterior for building in ("shear_3dof", path)
    )
    points = without.observation.valid.sum(), with_it.observation.valid.sum()
    assert points[0] == points[1]
    both = [np.column_stack([one.samples, one.zeta_samples]) for one in (without, with_it)]
    away = np.abs(both[0].mean(0) - both[1].mean(0)) / both[0].std(0)
    # A thousand draws know a mean to .03 standard deviations, and these to 2.2 %.
    assert away.max() < 0.06
    np.testing.assert_allclose(both[1].std(0), both[0].std(0), rtol=0.06)
    # What the model errs by, and the noise, are the same too.
    levels = [one.model_error.amplitude.levels.reshape(-1, 4).mean(0) for one in (without, with_it)]
    np.testing.assert_allclose(levels[1], levels[0], rtol=0.02, atol=1e-4)


def test_runs_that_differ_widen_what_is_predicted_of_the_next(calibrate, listed, table):
    """Stiffness of three runs: 4 % less, as it is, and 4 % more."""
    paths = [table(np.array([0.8, 1.3]) * share, k) for k, share in enumerate((0.96, 1.0, 1.04))]
    _, report = calibrate(listed, *paths)
    found = load_posterior(report.path)
    assert found.scatter is not None
    assert 0.02 < np.median(found.scatter.sd[..., 0]) < 0.1
    assert found.model_error is not None
    assert any("Between the 3 runs stiffness scatters" in note for note in report.notes)


def test_what_is_missing_is_told_and_kept_with_the_posterior(calibrate, listed, table):
    """Noise four times the stated one."""
    study, report = calibrate(listed, table((0.8, 1.3), 3, noise=4.0 * SD))
    assert report.misfit > 10.0
    told = report.posterior.warnings
    said = "something is missing in the model; the intervals allow for what shows"
    assert any(said in note for note in told)
    assert report.notes[: len(told)] == told
    # Larger noise is part of the likelihood, and so of the check.
    assert 0.01 < report.check.whole < 0.99
    kept = study.artefacts()["posterior"].settings
    assert (kept["particles"], kept["exact"], kept["seed"]) == (1000, True, 0)
    content = json.loads(study.result("posterior_summary.json").read_text())
    assert content["drawn_by"]["way"] == "importance sampling about the maxima"
    assert content["drawn_by"]["evaluations"] == report.posterior.drawn.evaluations


def test_errors_of_the_next_event_are_those_of_this_one(calibrate, listed, table):
    """What |H| of 2F has beside the model's, a wave over frequency, with its sign and size."""
    wave = 0.25 * np.sin(2.0 * np.pi * GRID / 4.0)
    path = table((0.8, 1.3), 6, off=wave)
    found = calibrate(listed, path)[1].posterior.model_error.amplitude.mean
    assert np.corrcoef(found[0], wave)[0, 1] > 0.95
    assert found[0].std() == pytest.approx(wave.std(), rel=0.2)


def test_a_file_of_another_building_is_refused(calibrate, listed, table, tmp_path):
    rng, path = np.random.default_rng(0), tmp_path / "other.csv"
    rows = np.column_stack([GRID, np.exp(0.6 * rng.standard_normal((60, 2)))])
    np.savetxt(path, rows, delimiter=",", header="frequency_hz,2F,RF", comments="", fmt="%.6g")
    with pytest.raises(MeasurementError, match="unlike anything that"):
        calibrate(listed, path)


def test_every_solution_is_drawn(calibrate, listed, table):
    """The roof alone knows k_1 / m_1 and k_2 (1 / m_1 + 1 / m_2), not which of them is which."""
    other = np.array([2.5 * (1 / 3 + 1 / 2) * 1.1 * 3 / 4, 0.9 * 4 / 3 / (1 / 3 + 1 / 2) / 2.5])
    draws = calibrate(listed, table((0.9, 1.1), 4), sensors=("RF",))[1].posterior.samples[:, :2]
    away = [np.abs(draws / theta - 1.0).max(axis=1) for theta in ((0.9, 1.1), other)]
    assert (np.minimum(*away) < 0.15).all()
    assert 0.05 < (away[0] < away[1]).mean() < 0.95


@pytest.fixture(scope="module")
def two_levels(tmp_path_factory, tower_file):
    """The tower at two levels, two doublings apart, with a tenth less stiffness at the higher."""
    folder, building = tmp_path_factory.mktemp("levels"), load_building(tower_file)
    soft, paths = folder / "soft.toml", []
    effect = '\n[[effects]]\nname = "amplitude_softening"\nplace = "all"\n'
    soft.write_text(Path(tower_file).read_text() + effect)
    for name, share, rms in (("weak", 1.0, 0.1), ("strong", 0.9, 0.4)):
        asked = SimulationSettings(
            theta=(0.8 * share, 1.3 * share),
            zeta=ZETA,
            duration_s=60.0,
            sampling_hz=50.0,
            band_hz=(0.3, 20.0),
            rms_m_s2=rms,
            sensor_noise_m_s2=0.003 * rms,
            seed=len(paths),
        )
        made = simulate_observation(building, asked)
        paths.append(write_simulation(made, folder / f"{name}.csv").observation)
    return soft, paths


def test_runs_at_several_levels_are_each_explained_at_its_own(calibrate, two_levels):
    soft, paths = two_levels
    _, report = calibrate(soft, *paths)
    posterior, draws = report.posterior, report.posterior.samples
    lost = draws[:, list(posterior.names).index("amplitude_softening@all.size")]
    level = np.log2(1.9)  # a softer tower moves less: nearly two doublings
    assert (1.0 + lost.mean()) ** 2.0 == pytest.approx(0.9, abs=0.02)
    # What the level explains is no difference between events.
    assert np.median(posterior.scatter.sd[..., 0]) < 0.03
    (told,) = [note for note in report.notes if "runs are explained together" in note]
    assert "each at its own level: strong.csv at " in told
    assert "agree" not in told
    low, high = posterior.settings["level_span"]
    assert low == 0.0
    assert level < high < 2.2
