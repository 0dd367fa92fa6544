"""What instruments do to FRFs, in closed form."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def plain(stick):
    return stick.frf(zeta=0.03)


def test_gain_of_a_channel(stick, plain):
    plain = plain.copy()
    plain[1] *= 1.07
    np.testing.assert_allclose(stick.frf("channel_gain@3F", sizes=[0.07]), plain, rtol=1e-13)


def test_gain_of_the_base(stick, plain):
    """A base sensor that reads too much makes all ratios too small."""
    ours = stick.frf("base_gain@base", sizes=[0.25])
    np.testing.assert_allclose(ours, plain / 1.25, rtol=1e-13)


def test_delay(stick, plain):
    plain = plain.copy()
    plain[2] *= np.exp(-2j * np.pi * stick.frequency_hz * 0.004)
    np.testing.assert_allclose(stick.frf("channel_delay@4F", sizes=[0.004]), plain, rtol=1e-12)


def test_roll_off_is_3_db_down_at_the_corner(stick, plain):
    """Size 4: the corner is at 5 Hz."""
    ours = stick.frf("roll_off@floors", sizes=[4.0])
    np.testing.assert_allclose(ours, plain / (1.0 + 1j * stick.frequency_hz / 5.0), rtol=1e-12)


def test_noise_adds_power_and_keeps_phase(stick, plain):
    ours = stick.frf("noise_floor@floors", sizes=[0.2])
    np.testing.assert_allclose(np.abs(ours) ** 2, np.abs(plain) ** 2 + 0.04, rtol=1e-12)
    np.testing.assert_allclose(np.angle(ours), np.angle(plain), rtol=1e-9)


def test_reversed_channel(stick, plain):
    plain = plain * np.array([1.0, 1.0, -1.0, 1.0])[:, None]
    np.testing.assert_allclose(stick.frf("reversed_channel@4F"), plain, rtol=1e-13)


def test_instruments_act_in_order_after_the_structure(stick):
    """First the noise, then the gain of the recorder."""
    noisy = stick.frf("noise_floor@floors", sizes=[0.2])
    ours = stick.frf("noise_floor@floors", "base_gain@base", sizes=[0.2, 0.25])
    np.testing.assert_allclose(ours, noisy / 1.25, rtol=1e-12)
