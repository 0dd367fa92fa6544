"""calibrate from identified modes, alone and together with FRFs."""

from dataclasses import replace

import numpy as np
import pytest

from femupdate.errors import MeasurementError
from femupdate.study import Study
from femupdate.workflow import (
    CalibrationSettings,
    ObservationSource,
    calibrate_study,
    check_calibration,
    choose_building,
    measured_of,
    open_study,
    settled_likelihood,
)
from tests.workflow.by_hand import GRID, tower_frf, tower_modes, write_table

TRUTH, ZETA = np.array([0.8, 1.3]), 0.05
SETTINGS = CalibrationSettings(particles=1000)  # --exact goes without saying


@pytest.fixture(scope="module")
def modes_file(tmp_path_factory):
    omega, shape = tower_modes(TRUTH)
    rows = [
        f"{k},{own:.6g},{0.002 * own:.3g},5.0,{column[0]:.6g},{column[1]:.6g}"
        for k, (own, column) in enumerate(zip(omega, shape.T, strict=True), start=1)
    ]
    path = tmp_path_factory.mktemp("modes") / "modes.csv"
    head = "mode,frequency_hz,frequency_sd_hz,damping (%),2F,RF"
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


@pytest.fixture(scope="module")
def frf_file(tmp_path_factory):
    noise = 0.3 * np.random.default_rng(5).standard_normal((2, GRID.size))
    log_frf = np.log(np.abs(tower_frf(TRUTH, ZETA, GRID))) + noise
    return write_table(tmp_path_factory.mktemp("frf") / "frf.csv", log_frf, 0.3)


@pytest.fixture
def calibrate(tmp_path, tower_file):
    def run(*paths, settings=SETTINGS, **reading):
        study = Study(tmp_path / "_".join(path.stem for path in paths))
        source = ObservationSource(paths[0], further=paths[1:], **reading)
        check_calibration(study, source, settings, str(tower_file))
        model = open_study(study, str(tower_file))
        return study, calibrate_study(study, model, source, settings)

    return run


def test_modes_and_frfs_agree_and_narrow_together(calibrate, modes_file, frf_file):
    _, modes = calibrate(modes_file)
    _, both = calibrate(frf_file, modes_file)
    assert modes.posterior.drawn.exact
    assert modes.posterior.observation.source == "modes.csv"
    assert both.posterior.observation.source == "frf.csv and modes.csv"
    for report in (modes, both):
        draws = report.posterior.samples
        assert (np.abs(draws.mean(axis=0) - TRUTH) < 3 * draws.std(axis=0)).all()
    assert (both.posterior.samples.std(axis=0) < 0.8 * modes.posterior.samples.std(axis=0)).all()
    assert modes.check.names == ("frequencies", "damping ratios", "shapes")
    assert both.check.names == ("2F", "RF", "frequencies", "damping ratios", "shapes")
    assert any(note.startswith("Mode 2 at ") and "MAC 1.000" in note for note in modes.notes)
    assert modes.misfit < 0.1


def test_of_a_table_coarser_than_the_grid_its_own_points_count(tower_file, tmp_path):
    """Its frequencies are odd multiples of half its spacing, which the building's grid has."""
    grid = np.arange(0.6, 12.0, 0.4)
    path = write_table(
        tmp_path / "frf.csv", np.log(np.abs(tower_frf(TRUTH, ZETA, grid))), 0.05, grid=grid
    )
    model = open_study(Study(tmp_path / "study"), str(tower_file))
    measured = measured_of(model.building, ObservationSource(path))
    found = settled_likelihood(model, measured, SETTINGS)
    np.testing.assert_allclose(found.likelihood.base.frequency_hz, grid)
    mean = found.likelihood.prior.from_normal(found.found.z[:1])[0]
    # Without noise, to the five digits at which the search ends.
    np.testing.assert_allclose(mean[:2], TRUTH, rtol=1e-3)


def test_sensors_and_band(modes_file, tower_file, tmp_path):
    building = choose_building(Study(tmp_path), str(tower_file))
    (some,) = measured_of(building, ObservationSource(modes_file, sensors=("RF",))).modes
    assert (some.floors, some.shape.shape) == (("RF",), (2, 1))
    source = ObservationSource(modes_file, band_hz=(1.0, 6.0))
    assert measured_of(building, source).modes[0].names == ("1",)
    with pytest.raises(MeasurementError, match=r"no mode lies between 20 and 30 Hz; widen --band"):
        measured_of(building, ObservationSource(modes_file, band_hz=(20.0, 30.0)))


@pytest.fixture(scope="module")
def force_file(tmp_path_factory):
    """Accelerance of both floors under a force at the roof, with noise of .1 on ln|A|."""
    own, shape = tower_modes(TRUTH)
    omega, natural = 2 * np.pi * GRID[:, None], 2 * np.pi * own
    share = shape * shape[1]  # (floor, mode)
    motion = 1.0 / (natural**2 - omega**2 + 2j * ZETA * natural * omega)
    noise = 0.1 * np.random.default_rng(8).standard_normal((2, GRID.size))
    values = np.abs((-(omega**2) * motion) @ share.T).T * np.exp(noise)
    path = tmp_path_factory.mktemp("force") / "force.csv"
    rows = [f"{f:.1f},{a:.9g},{b:.9g},0.1,0.1" for f, a, b in zip(GRID, *values, strict=True)]
    head = "frequency_hz,2F/RF (m/s2/N),RF/RF (m/s2/N),2F/RF_sd,RF/RF_sd"
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


def test_force_and_base_agree_and_narrow_together(calibrate, force_file, frf_file, modes_file):
    _, force = calibrate(force_file)
    _, every = calibrate(force_file, frf_file, modes_file)
    for report in (force, every):
        draws = report.posterior.samples
        assert (np.abs(draws.mean(axis=0) - TRUTH) < 3.5 * draws.std(axis=0)).all()
        assert report.check.whole > 0.01
    assert (every.posterior.samples.std(axis=0) < force.posterior.samples.std(axis=0)).all()
    assert force.check.names == ("2F/RF", "RF/RF")
    assert every.posterior.observation.source == "frf.csv and force.csv and modes.csv"
    assert any("accelerance of 2F, RF under a force at RF" in note for note in force.notes)


@pytest.mark.parametrize(
    ("unit", "message"),
    [
        ("g/N", "building's masses allow; it fits if it is in m/s2, not in g"),
        ("m/s/N", "it fits if it is accelerance;"),
        ("m/s2/kN", "it fits if it is a thousand times too small;"),
    ],
)
def test_a_wrong_unit_is_told_by_the_masses(calibrate, force_file, tmp_path, unit, message):
    path = tmp_path / "wrong.csv"
    path.write_text(force_file.read_text().replace("m/s2/N", unit))
    with pytest.raises(MeasurementError, match=message):
        calibrate(path)


def test_a_hammer_without_units_is_not_taken_for_base_motion(calibrate, force_file, tmp_path):
    path = tmp_path / "bare.csv"
    path.write_text(force_file.read_text().replace(" (m/s2/N)", "").replace("/RF", ""))
    with pytest.raises(MeasurementError, match="if a hammer or a shaker excited it, say so"):
        calibrate(path, settings=replace(SETTINGS, exact=True))
    _, named = calibrate(path, force="RF", unit="m/s2/N")
    assert named.check.names == ("2F/RF", "RF/RF")
