"""Clocks of channels: late, and fast or slow."""

import numpy as np
import pytest

from femupdate.discrepancy.diagnose import diagnose

MASSES, SPRINGS = np.array([3.0, 2.0, 1.5, 1.5]), np.array([9e3, 5e3, 4e3, 4e3])
FLOORS = ("2F", "3F", "4F", "RF")
GRID = 0.2 * np.arange(1, 80)


@pytest.fixture(scope="module")
def seen(chains, building_of, observe, pose):
    """A function: a chain whose roof is late, by delays (s) that follow one another evenly."""

    def make(delays, seed=5):
        frf = chains.Chain(MASSES, SPRINGS, zeta=0.02).frf(GRID)
        frf[3] *= np.exp(-2j * np.pi * np.outer(np.asarray(delays), GRID)).mean(axis=0)
        return pose(building_of(MASSES, SPRINGS), observe(FLOORS, GRID, frf, 0.02, seed))

    return make


def test_a_slow_clock_is_named_with_what_it_loses(seen):
    growth = -0.03
    found = diagnose(seen(np.linspace(0.0, growth, 400)))
    assert found.leading is not None
    assert (found.verdict, found.leading.placed.label) == ("named", "drifting_clock@RF")
    assert found.leading.size == pytest.approx(growth, abs=4.0 * found.leading.size_sd)
    assert found.leading.size_sd < 0.1 * abs(growth)
