"""What lies outside of a model is named: a foreign mode, and factors beyond their prior."""

import numpy as np
import pytest

import femupdate
from femupdate.errors import InferenceError, MeasurementError

HOW = {"building": "shear_3dof", "exact": True, "particles": 200}

MODES = """mode,frequency_hz,damping (%),2F,3F,RF
1,3.8218,2.0,0.4779,0.7597,1.0000
2,6.3,1.5,0.4,-0.2,0.9
3,16.0182,2.0,0.9401,-1.0000,0.3105
"""


def test_a_mode_that_fits_none_of_the_model_is_named_and_left_out(tmp_path):
    (tmp_path / "modes.csv").write_text(MODES, encoding="utf-8")
    report = femupdate.calibrate(tmp_path / "study", tmp_path / "modes.csv", **HOW)
    assert "mode 2 at 6.3 Hz is left out" in report.posterior.warnings[0]
    away = (report.posterior.samples.mean(0) - [0.9, 1.2, 0.8]) / report.posterior.samples.std(0)
    assert np.abs(away).max() < 1.0


def test_circular_frequencies_and_periods_without_their_unit_are_told(tmp_path):
    hertz = np.array([3.8218, 10.0582, 16.0182])
    rows = [row.split(",")[2:] for row in MODES.splitlines()[1:]]
    rows[1] = ["2.0", "-1.0", "-0.6406", "0.9646"]
    for said, values in {"rad/s": 2.0 * np.pi * hertz, "s": 1.0 / hertz}.items():
        lines = [",".join([f"{f:.5g}", *row]) for f, row in zip(values, rows, strict=True)]
        text = "\n".join(["frequency,damping (%),2F,3F,RF", *lines])
        (tmp_path / "modes.csv").write_text(text, encoding="utf-8")
        with pytest.raises(MeasurementError, match=f"fit shear_3dof in {said}, but not in Hz"):
            femupdate.calibrate(tmp_path / "study", tmp_path / "modes.csv", **HOW)


FREQUENCIES = np.arange(0.15, 25.0, 0.05)


def weak(hz):
    """Responses (n, 3) of three masses of 1 kg on springs of 3000 N/m, the lowest a fifth of it."""
    k = 3000.0 * np.array([0.2, 1.2, 0.8, 0.0])
    stiffness = np.diag(k[:3] + k[1:]) - np.diag(k[1:3], 1) - np.diag(k[1:3], -1)
    squared, modes = np.linalg.eigh(stiffness)
    ratio = hz[:, None] / (np.sqrt(squared) / (2.0 * np.pi))
    amplified = 1.0 + ratio**2 / (1.0 - ratio**2 + 2j * 0.02 * ratio)
    return amplified @ (modes * modes.sum(0)).T


def write_columns(path, names, columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=names, comments="")


def test_a_factor_below_its_prior_is_refused_with_the_key_that_widens_it(tmp_path):
    noise = np.exp(0.03 * np.random.default_rng(0).normal(size=(len(FREQUENCIES), 3)))
    columns = [FREQUENCIES, noise * np.abs(weak(FREQUENCIES))]
    write_columns(tmp_path / "frf.csv", "frequency_hz,2F,3F,RF", columns)
    with pytest.raises(InferenceError, match=r"\[prior.theta\].* --anyway") as refused:
        femupdate.calibrate(tmp_path / "study", tmp_path / "frf.csv", **HOW)
    assert "theta_1 near 0.2 (lower limit 0.333)" in str(refused.value)
    assert not (tmp_path / "study" / "posterior.nc").exists()


def test_what_is_odd_about_a_file_is_told_before_its_prior_is_blamed(tmp_path):
    """The sensor of the roof is turned round."""
    rng, count, step = np.random.default_rng(4), 6000, 0.02
    spectrum = np.fft.rfft(rng.normal(size=count)) * (np.fft.rfftfreq(count, step) > 0.2)
    floors = spectrum * weak(np.fft.rfftfreq(count, step)).T * np.array([[1.0], [1.0], [-1.0]])
    rows = np.fft.irfft([spectrum, *floors], count) + 0.01 * rng.normal(size=(4, count))
    names = "time_s,base (m/s2),2F (m/s2),3F (m/s2),RF (m/s2)"
    write_columns(tmp_path / "run.csv", names, [step * np.arange(count), *rows])
    with pytest.raises(InferenceError, match=r"direction reversed. Else change .*\[prior.theta\]"):
        femupdate.calibrate(tmp_path / "study", tmp_path / "run.csv", **HOW)
