"""Clocks of channels: late, and fast or slow."""

import numpy as np
import pytest

from femupdate.discrepancy.diagnose import diagnose

MASSES, SPRINGS = np.array([3.0, 2.0, 1.5, 1.5]), np.array([9e3, 5e3, 4e3, 4e3])
FLOORS = ("2F", "3F", "4F", "RF")
GRID = np.arange(0.1, 16.0, 0.1)


@pytest.fixture(scope="module")
def seen(chains, building_of, observe, pose):
    """A function: a chain whose roof is late, by delays (s) that follow one another evenly."""

    def make(delays, seed=5):
        frf = chains.Chain(MASSES, SPRINGS, zeta=0.02).frf(GRID)
        frf[3] *= np.exp(-2j * np.pi * np.outer(np.asarray(delays), GRID)).mean(axis=0)
        return pose(building_of(MASSES, SPRINGS), observe(FLOORS, GRID, frf, 0.02, seed))

    return make


@pytest.mark.parametrize("growth", [0.012, -0.03, 0.05])
def test_a_clock_that_is_fast_or_slow_is_named_with_what_it_loses(seen, growth):
    found = diagnose(seen(np.linspace(0.0, growth, 400)))
    assert found.leading is not None
    assert (found.verdict, found.leading.placed.label) == ("named", "drifting_clock@RF")
    assert found.leading.size == pytest.approx(growth, abs=4.0 * found.leading.size_sd)
    assert found.leading.size_sd < 0.1 * abs(growth)


def test_a_channel_that_is_late_by_as_much_throughout_is_not_called_a_clock(seen):
    """A drifting clock with a drift of nothing is a delay, which has a parameter less."""
    found = diagnose(seen([0.003]))
    assert found.leading is not None
    assert (found.verdict, found.leading.placed.label) == ("named", "channel_delay@RF")
    assert found.leading.size == pytest.approx(0.003, abs=4.0 * found.leading.size_sd)
