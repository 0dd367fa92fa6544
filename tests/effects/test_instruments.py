"""Effects of instruments, and effects in identified modes."""

import numpy as np
import pytest
import torch

from femupdate.dynamics import RayleighDamping, Responses


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


ZETA = 0.03
GROUND = ("base_sway@base", "foundation_rocking@base", "table_pitch@base", "channel_gain@RF")
SIZES = [0.1, 0.3, 0.05, -0.2]


def one(case, sizes):
    """Parameters (1, p + q) of a case."""
    return torch.from_numpy(np.concatenate([case.theta, sizes])[None])


def ours(case, system, parameters, **options):
    grid = torch.from_numpy(case.frequency_hz)
    zeta = torch.full((len(parameters),), ZETA, dtype=torch.float64)
    modal = system.modal_data(parameters, top_frequency_hz=float(grid[-1]), **options)
    return torch.cat(list(system.log_frf_batches(modal, parameters, zeta, grid))).numpy()


def by_hand(case):
    """A base on springs that turns besides, and a channel that reads a fifth less."""
    K = case.structure.stiffness(np.ones(len(case.theta))).toarray()
    roof = case.equations.rows[-1] @ np.linalg.solve(K, case.equations.force[:, 0])
    mass, height = case.equations.rigid_mass, case.equations.levels[-1]
    springs = {0: mass[0, 0] / (SIZES[0] * roof), 1: mass[0, 1] * height / (SIZES[1] * roof)}
    exact = case.equations.but(ground=springs, pitch=SIZES[2]).frf(case.frequency_hz, ZETA)
    exact[-1] *= 1.0 + SIZES[3]
    return np.log(np.abs(exact))


def test_all_modes(case):
    found = ours(case, case.system(*GROUND), one(case, SIZES))[0]
    # Rounding, over the depth of the deepest anti-resonance.
    np.testing.assert_allclose(found, by_hand(case), atol=1e-6)


def test_as_many_modes_as_a_stick_has_on_a_rigid_base(stick):
    """A base without mass has modes of its own that are static only: they go to the series."""
    system = stick.system(*GROUND)
    kept = system.modal_data(one(stick, SIZES), modes=4, top_frequency_hz=20.0)
    assert kept.omega.shape == (1, 4)
    assert float(kept.omega.max()) < 1e4
    found = ours(stick, system, one(stick, SIZES), modes=4)[0]
    np.testing.assert_allclose(found, by_hand(stick), atol=1e-6)


def test_a_law_of_damping_that_the_effect_changes(case):
    law = RayleighDamping(0.04, (1.0, 20.0))
    system = case.system("damping_law@proportional", law=law)
    exact = case.frf("damping_law@proportional", sizes=[0.7], zeta=ZETA, law=law)
    np.testing.assert_allclose(
        ours(case, system, one(case, [0.7]))[0], np.log(np.abs(exact)), atol=1e-7
    )


def test_beyond_a_limit_the_response_goes_on_smoothly(stick):
    """A spring cannot be of negative flexibility; a search may ask for it."""
    system = stick.system("foundation_rocking@base")
    grid, zeta = torch.from_numpy(stick.frequency_hz), torch.full((5,), ZETA, dtype=torch.float64)
    sizes = 1e-4 * np.arange(-2, 3)
    both = torch.from_numpy(np.column_stack([np.tile(stick.theta, (5, 1)), sizes]))
    values = system.log_frf(both, zeta, grid).numpy()
    slopes = np.diff(values, axis=0) / 1e-4
    largest = np.abs(slopes).max()
    assert largest > 0.1
    # Slopes to both sides of the limit differ as neighbours do on one side.
    assert np.abs(slopes[2] - slopes[1]).max() < 0.02 * largest
    np.testing.assert_allclose(values[0] + values[4], 2.0 * values[2], atol=1e-12)


class PlusOne:
    inputs = 1

    def __call__(self, frf, turned=None):
        return frf + 1.0


def test_what_an_estimate_shows_is_taken_before_the_logarithm(stick):
    system, grid = stick.system("added_mass@3F"), torch.from_numpy(stick.frequency_hz)
    zeta = torch.tensor([0.02], dtype=torch.float64)
    found = system.log_frf(one(stick, [0.1]), zeta, grid, Responses(seen=PlusOne()))
    alone = stick.frf("added_mass@3F", sizes=[0.1], zeta=0.02)
    np.testing.assert_allclose(found[0], np.log(np.abs(alone + 1.0)), atol=1e-9)
