"""What channels say of themselves: gains, delays and signs put into an exact low end."""

import re

import numpy as np
import pytest

from femupdate.discrepancy import screen_channels

MASSES, SPRINGS = np.array([3.0, 2.0, 1.5]), np.array([9e3, 5e3, 4e3])
GRID, FLOORS = np.arange(0.1, 10.0, 0.1), ("2F", "3F", "RF")
ONE = np.ones((3, 1))


@pytest.fixture(scope="module")
def screen(chains, building_of, observe, pose):
    """A function: sentences on a chain whose FRFs are multiplied by a factor (3, k)."""
    exact = chains.Chain(MASSES, SPRINGS, zeta=0.02).frf(GRID)

    def make(factor, seed=0, sd=0.01, phase=True, keep=slice(None)):
        grid = GRID[keep]
        seen = observe(FLOORS, grid, (factor * exact)[:, keep], sd, seed, phase)
        problem = pose(building_of(MASSES, SPRINGS), seen)
        return screen_channels(seen, problem.system, np.ones(3))

    return make


@pytest.mark.parametrize("seed", range(2))
def test_good_channels_are_left_alone(screen, seed):
    assert screen(ONE, seed) == ()


@pytest.mark.parametrize("gain", [1.08, 0.9])
def test_a_gain_is_read_off_the_rigid_end(screen, gain):
    (sentence,) = screen(np.array([[1.0], [gain], [1.0]]))
    (percent,) = re.findall(r"3F reads ([+-][\d.]+)%", sentence)
    # The intercept of 13 points with an error of 1 % is known to 0.4 %.
    assert float(percent) == pytest.approx(100.0 * (gain - 1.0), abs=1.3)
    assert "2F" not in sentence
    assert "RF" not in sentence


def test_a_delay_is_read_off_the_slope_of_the_phase(screen):
    late = np.exp(-2j * np.pi * GRID * np.array([[0.0], [0.0], [0.008]]))
    (sentence,) = screen(late, sd=0.003)
    assert re.search(r"RF \+(8\.\d|7\.\d) ± 0\.\d ms", sentence)
    assert "2F" not in sentence


def test_a_reversed_sensor_is_told_and_not_taken_for_a_delay(screen):
    (sentence,) = screen(np.array([[-1.0], [1.0], [1.0]]))
    assert "2F" in sentence
    assert "reversed" in sentence


@pytest.mark.parametrize("factor", [1.0 / 9.80665, 100.0])
def test_a_wrong_unit_is_told_even_where_the_low_end_is_narrow(screen, factor):
    (sentence,) = screen(np.array([[1.0], [factor], [1.0]]), keep=slice(8, None))
    (times,) = re.findall(r"3F reads ([\d.e+]+) times the base", sentence)
    assert float(times) == pytest.approx(factor, rel=0.2)
    assert "unit" in sentence
