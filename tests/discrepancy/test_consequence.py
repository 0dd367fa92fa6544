"""What an effect changes, and what a model still misses, against closed forms."""

import numpy as np
import pytest

from femupdate.discrepancy.evidence import consequence
from femupdate.discrepancy.fit import extended, fit, fit_baseline, settle
from tests.chains import Chain
from tests.discrepancy.posed import building_of, observe, place, pose

GRID = 0.2 * np.arange(1, 61)
MASSES, SPRINGS, SD = np.ones(1), np.full(1, 900.0), 0.01  # 4.8 Hz


@pytest.fixture(scope="module")
def problem():
    frf = Chain(MASSES, SPRINGS, zeta=0.03).frf(GRID)
    return pose(building_of(MASSES, SPRINGS), observe(("RF",), GRID, frf, SD, 1))


def with_size(problem, placed, size):
    """The fit without an effect, and that with it in place of a size that nothing moves."""
    base = fit_baseline(problem)[0]
    return base, fit(problem, placed, extended(problem, base, placed, [size]), 0)


@pytest.mark.parametrize("share", [-0.2, 0.02, 0.3])
def test_mass_changes_the_frequency_of_an_oscillator_by_its_root(problem, share):
    found = consequence(problem, *with_size(problem, place("added_mass@RF"), share))
    assert found.frequency == pytest.approx(abs((1.0 + share) ** -0.5 - 1.0), rel=1e-6)


def test_a_gain_changes_the_readings_by_itself_and_no_frequency(problem):
    found = consequence(problem, *with_size(problem, place("channel_gain@RF"), 0.07))
    assert found.frequency == 0.0
    assert found.response == pytest.approx(0.07, rel=1e-6)
    # What matters is either change.
    assert found.matters(0.01, 0.05)
    assert not found.matters(0.01, 0.08)


def test_what_is_left_is_found_where_it_was_put():
    """The response of the second floor is 25 % larger between 8 and 10 Hz, and there alone."""
    masses, springs = np.ones(2), np.full(2, 900.0)
    frf = Chain(masses, springs, zeta=0.03).frf(GRID)
    bump = np.exp(-0.5 * ((GRID - 9.0) / 0.5) ** 2)
    frf[0] *= np.exp(0.22 * bump)
    problem = pose(building_of(masses, springs), observe(("2F", "RF"), GRID, frf, SD, 2))
    left = settle(problem, fit_baseline(problem)[0]).remains()
    assert left.floor == "2F"
    low, high = left.band_hz
    assert low < 9.5
    assert high > 8.5
    rms = 0.22 * float(np.sqrt((bump[(low <= GRID) & (high > GRID)] ** 2).mean()))
    # The factors and the damping take some of it up; the learned error is smooth.
    assert left.there == pytest.approx(rms, rel=0.5)
    assert "2F" in left.sentence
