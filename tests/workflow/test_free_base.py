"""A specimen that slides is hit and its modes are identified: against its equations, free."""

import numpy as np
import pytest
from scipy.linalg import eigh

from femupdate.building import from_document, save_building
from femupdate.study import Study
from femupdate.workflow import CalibrationSettings, ObservationSource, calibrate_study, open_study
from tests.documents import stick

THETA = np.array([0.8, 1.2])
# Base of 3 t on rails, floors of 2 t and 1 t.
MASS = np.diag([3e3, 2e3, 1e3])
HUNG = stick(
    [2e3, 1e3],
    [4e6, 2.5e6],
    supports={"base": "slides", "mass": 3e3},
    prior={"theta": {"lower": 0.3, "upper": 3}, "zeta": {"lower": 0.005, "upper": 0.06}},
    frequency_grid={"start": 1.0, "step": 0.1, "count": 150},
)


def modes(more=0.0):
    """Circular frequencies (3,) and shapes (3, 3) of unit mass: base, 2F, RF."""
    k1, k2 = THETA * [4e6, 2.5e6]
    mass = MASS * [1.0, 1.0, 1.0 + more]
    squared, shapes = eigh([[k1, -k1, 0], [-k1, k1 + k2, -k2], [0, -k2, k2]], mass)
    return np.sqrt(np.maximum(squared, 0.0)), shapes


def hammer(path, more=0.0):
    omega, shapes = modes(more)
    frequency, rng = np.arange(1.0, 15.9, 0.1), np.random.default_rng(4)
    lines = ["frequency_hz,2F/RF (m/s2/N),RF/RF (m/s2/N),2F/RF_sd,RF/RF_sd"]
    for f in frequency:
        w = 2.0 * np.pi * f
        moved = shapes * shapes[2] / (omega**2 - w**2 + 2j * 0.02 * omega * w)
        a = -(w**2) * moved.sum(axis=1)[1:] * np.exp(0.05 * rng.standard_normal(2))
        lines.append(f"{f:.2f},{a[0]:.6e},{a[1]:.6e},0.05,0.05".replace("(", "").replace(")", ""))
    path.write_text("\n".join(lines) + "\n")
    return path


def identified(path, more=0.0):
    omega, shapes = modes(more)
    rows = [
        f"{k},{omega[k] / (2 * np.pi):.5f},0.02,{shapes[1, k]:.5f},{shapes[2, k]:.5f}"
        for k in (1, 2)
    ]
    path.write_text("\n".join(["mode,frequency_hz,damping,2F,RF", *rows]) + "\n")
    return path


@pytest.mark.parametrize("write", [hammer, identified])
def test_its_stories_are_found(write, tmp_path):
    study = Study(tmp_path / "study")
    model = open_study(study, str(save_building(from_document(HUNG), tmp_path / "hung.toml")))
    source = ObservationSource(write(tmp_path / "measured.csv"))
    report = calibrate_study(study, model, source, CalibrationSettings(particles=1000))
    draws = report.posterior.samples
    sd = draws.std(axis=0)
    assert (np.abs(draws.mean(axis=0) - THETA) < 3.0 * sd).all()
    # With the base held, the factors would be off by half and more.
    assert (sd < 0.1).all()
    assert any("base slides" in note for note in report.notes)


def test_a_listed_effect_is_found_from_both(tmp_path):
    """A fifth more mass on the roof."""
    effect = {"name": "added_mass", "place": "RF", "parameters": {"size": 0.0}}
    path = save_building(from_document(HUNG | {"effects": [effect]}), tmp_path / "hung.toml")
    files = [write(tmp_path / f"{write.__name__}.csv", 0.2) for write in (hammer, identified)]
    study = Study(tmp_path / "study")
    model = open_study(study, str(path))
    source = ObservationSource(files[0], further=tuple(files[1:]))
    report = calibrate_study(study, model, source, CalibrationSettings(particles=1000))
    draws = report.posterior.samples
    assert (np.abs(draws.mean(axis=0) - [*THETA, 0.2]) < 3.0 * draws.std(axis=0)).all()
    apart = {"2F/RF", "RF/RF", "frequencies", "damping ratios", "shapes"}
    assert apart == set(report.check.names)
