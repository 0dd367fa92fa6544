"""The hand-written chain itself, against closed forms: the other tests stand on it."""

import numpy as np
import pytest

GRID = np.linspace(0.3, 9.0, 40)


def oscillator(frequency_hz, own_hz, zeta):
    """Absolute acceleration over the base's: (1 + 2 i zeta r) / (1 - r^2 + 2 i zeta r)."""
    r = frequency_hz / own_hz
    return (1 + 2j * zeta * r) / (1 - r**2 + 2j * zeta * r)


def test_one_story_is_an_oscillator(chains):
    m, k = 3.0, 2000.0
    seen = chains.Chain(np.array([m]), np.array([k]), zeta=0.04).frf(GRID)
    exact = oscillator(GRID, np.sqrt(k / m) / (2 * np.pi), 0.04)
    np.testing.assert_allclose(seen[0], exact, rtol=1e-12)


def test_a_soft_base_is_one_more_spring_in_series(chains):
    """k and K_b in series; damping that is proportional to stiffness goes along."""
    k, sway = 2000.0, 5000.0
    chain = chains.Chain(np.array([3.0]), np.array([k]), proportional=(0.0, 0.002))
    soft = chain.but(sway=sway).frf(GRID)
    np.testing.assert_allclose(soft, chain.but(springs=[k * sway / (k + sway)]).frf(GRID))


def test_rocking_of_one_story_is_a_spring_in_series_too(chains):
    k, turn, height = 2000.0, 90e3, 4.0
    chain = chains.Chain(
        np.array([3.0]), np.array([k]), proportional=(0.0, 0.002), heights=np.array([height])
    )
    both = 1.0 / (1.0 / k + height**2 / turn)
    np.testing.assert_allclose(
        chain.but(rocking=turn).frf(GRID), chain.but(springs=[both]).frf(GRID)
    )


def test_a_rigid_tower_on_the_roof_is_roof_mass(chains):
    chain = chains.Chain(np.array([3.0, 2.0]), np.array([2000.0, 900.0]), proportional=(0.1, 0.001))
    stiff = chain.but(tower=(np.array([0.5]), np.array([1e9]), np.array([0.0])))
    heavy = chain.but(masses=np.array([3.0, 2.5]))
    np.testing.assert_allclose(stiff.frf(GRID), heavy.frf(GRID), rtol=1e-5)


@pytest.mark.parametrize("story", [0, 1])
def test_a_dashpot_damps_a_mode_by_its_drift(chains, story):
    """zeta = c drift^2 / (2 omega) for a small c: half-power width of the first peak."""
    plain = chains.Chain(np.array([3.0, 2.0]), np.array([2000.0, 900.0]), zeta=1e-6)
    omega, shapes = plain.modes
    drift = np.diff(shapes[:, 0], prepend=0.0)[story]
    dashpots = np.zeros(2)
    dashpots[story] = 0.01 * 2.0 * omega[0] / drift**2
    near = omega[0] / (2 * np.pi) * np.linspace(0.9, 1.1, 20001)
    power = np.abs(plain.but(dashpots=dashpots).frf(near)[1]) ** 2
    width = np.ptp(near[power > 0.5 * power.max()])
    assert width / near[power.argmax()] == pytest.approx(2 * 0.01, rel=0.01)
