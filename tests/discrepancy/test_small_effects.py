"""Small effects that an error of the model could make up for as well."""

import numpy as np
import pytest

from femupdate.discrepancy.diagnose import diagnose

MASSES, SPRINGS = np.array([3.0, 2.0, 1.5, 1.5]), np.array([9e3, 5e3, 4e3, 4e3])
FLOORS = ("2F", "3F", "4F", "RF")
GRID = 0.2 * np.arange(1, 80)


def test_a_gain_of_three_percent_at_one_floor_is_named(chains, building_of, observe, pose):
    """All of it lies within what the model may err by at that floor, at any frequency."""
    exact = chains.Chain(MASSES, SPRINGS, zeta=0.02).frf(GRID)
    exact[3] *= 1.03
    found = diagnose(pose(building_of(MASSES, SPRINGS), observe(FLOORS, GRID, exact, 0.01, 3)))
    assert found.leading is not None
    assert found.leading.placed.label == "channel_gain@RF"
    assert found.verdict == "named"
    assert found.leading.size == pytest.approx(0.03, abs=3.0 * found.leading.size_sd)


@pytest.mark.parametrize("ratio", [2.6])
def test_a_light_appendage_is_named_wherever_it_is_tuned(chains, building_of, observe, pose, ratio):
    """3 % of the roof's mass on a spring of its own: it acts in a narrow band alone."""
    plain = chains.Chain(MASSES, SPRINGS, zeta=0.02)
    mass, omega = 0.03 * MASSES[-1], ratio * plain.modes[0][0]
    parts = [mass], [mass * omega**2], [2.0 * 0.05 * mass * omega]
    exact = plain.but(tower=tuple(map(np.array, parts))).frf(GRID)
    found = diagnose(pose(building_of(MASSES, SPRINGS), observe(FLOORS, GRID, exact, 0.01, 3)))
    assert found.leading is not None
    assert found.leading.placed.label == "tuned_appendage@RF"
    assert found.leading.size == pytest.approx(0.03, rel=0.2)


def test_too_few_points_tell_nothing(chains, building_of, observe, pose):
    exact = chains.Chain(MASSES, SPRINGS, zeta=0.02).frf(GRID)[:, 10:12]
    seen = observe(FLOORS, GRID[10:12], exact, 0.05, 0, False)
    found = diagnose(pose(building_of(MASSES, SPRINGS), seen))
    assert found.verdict == "unknown"
    assert found.sentence.startswith("The data are too few to tell: 8 independent points for 5")
