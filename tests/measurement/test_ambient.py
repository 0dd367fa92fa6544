"""Modes of ambient records, against a chain of masses and springs of known modes."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter, ss2tf

from femupdate.errors import MeasurementError
from femupdate.measurement import identified_modes, identify_modes, read_measured, write_modes
from femupdate.measurement.ambient import Subspace

pytest.importorskip("pyoma2")

STEP, ZETA = 0.02, 0.02
FLOORS = ("2F", "3F", "RF")


def chain():
    """Frequencies (3,), Hz, and shapes (3, 3) of three masses on springs, no two alike."""
    stiffness = np.array([900.0, 700.0, 400.0])
    K = np.diag(stiffness) + np.diag([*stiffness[1:], 0.0])
    K -= np.diag(stiffness[1:], 1) + np.diag(stiffness[1:], -1)
    squared, shapes = np.linalg.eigh(K)
    return np.sqrt(squared) / (2 * np.pi), shapes


def record(seconds, seed, tone_hz=None):
    """Accelerations (3, n) under independent white forces, with sensor noise."""
    rng = np.random.default_rng(seed)
    frequency, shapes = chain()
    force = shapes.T @ rng.standard_normal((3, int(seconds / STEP)))
    modal = []
    for own, load in zip(2 * np.pi * frequency, force, strict=True):
        A = np.array([[0.0, 1.0], [-(own**2), -2 * ZETA * own]])
        system = cont2discrete((A, np.array([[0.0], [1.0]]), A[1:], np.eye(1)), STEP)[:4]
        above, below = ss2tf(*system)
        modal.append(lfilter(above[0], below, load))
    values = shapes @ np.array(modal)
    values += 0.05 * values.std() * rng.standard_normal(values.shape)
    if tone_hz is not None:
        tone = np.sin(2 * np.pi * tone_hz * STEP * np.arange(values.shape[1]))
        values += values.std() * np.array([[1.0], [0.8], [0.9]]) * tone
    return values


def errors(found):
    """Errors of frequencies, damping ratios and shapes over their standard deviations."""
    frequency, shapes = chain()
    away = [[], [], []]
    for mode, own, shape in zip(found.modes, frequency, shapes.T, strict=True):
        away[0].append((mode.frequency_hz - own) / mode.frequency_sd_hz)
        away[1].append((mode.damping - ZETA) / mode.damping_sd)
        scale = mode.shape @ shape / (shape @ shape)
        away[2].extend((mode.shape - scale * shape) / mode.shape_sd)
    return away


def test_errors_of_modes_are_as_large_as_their_standard_deviations():
    found = [errors(identify_modes(record(400.0, seed), STEP, FLOORS)) for seed in range(8)]
    for k, low in enumerate((0.7, 0.7, 0.6)):
        away = np.concatenate([each[k] for each in found])
        # 24 values: their rms of 1 scatters by 14 %. A shape has a component less than it states.
        assert low < np.sqrt(np.mean(away**2)) < 1.4


def test_standard_deviations_are_those_of_pyoma2():
    """The same propagation to first order, by derivatives of its authors."""
    from pyoma2.functions import ssi

    values = record(400.0, 3)
    values -= values.mean(axis=1, keepdims=True)
    rows, order = 15, 6
    subspace = Subspace(values, STEP, rows, order, 30)
    poles = [pole for pole in subspace.poles() if pole.order == order]
    with np.errstate(all="ignore"):
        hankel, blocks = ssi.build_hank(values, values, rows, "cov", True, 30)
        parts = ssi.SSI_fast(hankel, rows, order)[:3]
        theirs = ssi.SSI_poles(*parts, order, STEP, 1, True, 0.2, True, hankel, blocks)
    frequency, frequency_sd, damping_sd = theirs[0][:, -1], theirs[4][:, -1], theirs[5][:, -1]
    for pole, spread in zip(poles, subspace.spreads(poles), strict=True):
        k = np.nanargmin(np.abs(frequency - pole.frequency_hz))
        # They leave out that a variance from 30 blocks is uncertain itself.
        wider = np.sqrt(29.0 / 27.0)
        assert spread[0] == pytest.approx(wider * frequency_sd[k], rel=0.03)
        assert spread[1] == pytest.approx(wider * damping_sd[k], rel=0.03)


def test_a_tone_of_a_machine_is_left_out():
    found = identify_modes(record(400.0, 1, tone_hz=7.0), STEP, FLOORS)
    assert len(found.modes) == 3
    assert all(abs(mode.frequency_hz - 7.0) > 0.3 for mode in found.modes)


def test_modes_are_read_again_as_they_were_written(tmp_path):
    found = identify_modes(record(400.0, 2), STEP, FLOORS)
    path = write_modes(tmp_path / "modes.csv", found.modes, found.notes)
    again = identified_modes(read_measured(path))
    assert again.floors == FLOORS
    for k, mode in enumerate(found.modes):
        assert again.frequency_hz[k] == pytest.approx(mode.frequency_hz, rel=1e-5)
        assert again.damping_sd[k] == pytest.approx(mode.damping_sd, rel=1e-5)
        np.testing.assert_allclose(again.shape[k], mode.shape, rtol=1e-5)
        np.testing.assert_allclose(again.shape_sd[k], mode.shape_sd, rtol=1e-5)


@pytest.mark.parametrize(
    ("seconds", "band", "words"),
    [
        (40.0, None, "give a longer record"),
        (400.0, (1.0, 40.0), "shows nothing above 25 Hz"),
        (400.0, (0.001, 0.002), "too short to show"),
        (400.0, (15.0, 20.0), "no mode comes back"),
    ],
)
def test_what_a_record_cannot_show_is_said(seconds, band, words):
    with pytest.raises(MeasurementError, match=words):
        identify_modes(record(seconds, 5), STEP, FLOORS, band)
