"""`femupdate identify`: from a record of floors to a table of modes, and on to a posterior."""

import numpy as np
import pytest

from tests.cli.commands import femupdate

pytest.importorskip("pyoma2")


@pytest.fixture(scope="module")
def ambient(tmp_path_factory):
    """A record of the three-story frame, without its base, in names of its own."""
    from femupdate.building import load_building
    from femupdate.simulation import SimulationSettings, simulate_observation

    settings = SimulationSettings(
        theta=(0.9, 1.1, 1.0),
        zeta=0.02,
        duration_s=300.0,
        sampling_hz=80.0,
        band_hz=(0.5, 35.0),
        sensor_noise_m_s2=0.01,
        seed=3,
    )
    seen = simulate_observation(load_building("shear_3dof"), settings)
    time = seen.histories.time_step * np.arange(seen.histories.acceleration.shape[1])
    path = tmp_path_factory.mktemp("ambient") / "ambient.csv"
    names = ["time_s", *(f"floor {k}" for k in (2, 3, 4))]
    values = np.column_stack([time, seen.histories.acceleration[1:].T])
    np.savetxt(path, values, fmt="%.7g", delimiter=",", header=",".join(names), comments="")
    return path, seen.truth


COLUMNS = "2F=floor 2,3F=floor 3,RF=floor 4"


def test_modes_of_a_record_give_the_building(ambient, tmp_path):
    path, truth = ambient
    inspected = femupdate("inspect", path).out
    assert f"femupdate identify {path} -o {path.stem}_modes.csv" in inspected.splitlines()[-2]
    modes = tmp_path / "modes.csv"
    answer = femupdate("identify", path, "-o", modes, "--columns", COLUMNS, "--json").answer
    for own, exact in zip(answer["modes"], truth["frequencies_hz"], strict=False):
        assert abs(own["frequency_hz"] - exact) < 3.0 * own["frequency_sd_hz"]
    assert (tmp_path / "modes.png").read_bytes().startswith(b"\x89PNG")
    again = femupdate("identify", path, "-o", modes, "--columns", COLUMNS)
    assert "is there already" in again.complaint
    study = tmp_path / "study"
    options = ("--building", "shear_3dof", "--study", study, "--no-pictures", "--json")
    posterior = femupdate("calibrate", modes, *options, "--particles", 1000).answer
    for mean, sd, exact in zip(posterior["mean"], posterior["sd"], truth["theta"], strict=False):
        assert abs(mean - exact) < 3.0 * sd


def test_the_missing_package_is_named(ambient, tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "pyoma2.functions", None)
    done = femupdate("identify", ambient[0], "-o", tmp_path / "m.csv", "--columns", COLUMNS)
    assert "pip install 'femupdate[ambient]'" in done.complaint
