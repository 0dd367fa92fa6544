"""Effects so large that nothing near the model without them explains the data."""

import numpy as np
import pytest

from femupdate.discrepancy.diagnose import diagnose
from femupdate.discrepancy.findings import NAMED
from femupdate.discrepancy.fit import fit_baseline
from femupdate.discrepancy.global_search import global_fit
from tests.chains import Chain
from tests.discrepancy.posed import building_of, observe, pose

GRID = 0.2 * np.arange(1, 61)
FLOORS = ("2F", "3F", "4F", "5F", "RF")
MASSES, SPRINGS, SD = np.ones(5), np.full(5, 600.0), 0.02


def posed(floor, share, theta):
    """The problem with another mass on one floor, and its best fit without it."""
    masses = MASSES + share * np.array([name == floor for name in FLOORS])
    frf = Chain(masses, SPRINGS * np.array(theta), zeta=0.01).frf(GRID)
    seen = observe(FLOORS, GRID, frf, SD, 7)
    problem = pose(building_of(MASSES, SPRINGS), seen)
    return problem, fit_baseline(problem)[0]


def test_a_large_effect_is_found_from_afar():
    """Theta has made up for so much of it that other effects score higher."""
    label, share, theta = "added_mass@4F", -0.48, (1.36, 1.03, 0.84, 0.84, 1.49)
    problem, base = posed(label.split("@")[1], share, theta)
    # Of the effects near by those count that take most of it up; all others are only tested.
    among = frozenset({label, "added_mass@5F", "added_mass@3F", "story_damper@RF"})
    near = diagnose(problem, base=base, among=among)
    far = global_fit(problem, base, near.scores)
    assert far.placed[-1].label == label
    found = diagnose(problem, base=base, distant=far, among=among)
    assert (found.verdict, found.leading.placed.label) == (NAMED, label)
    # One draw of the noise each; 4.5 standard deviations are passed by one in a hundred thousand.
    assert abs(found.leading.size - share) < 4.5 * found.leading.size_sd
    mean, sd = found.leading.fitted.theta()
    assert (np.abs(mean - theta) < 4.5 * sd).all()


@pytest.mark.parametrize(
    ("share", "theta", "sd", "seed"),
    [(0.73, [0.75, 0.79, 1.46], 0.01, 2), (-0.45, [1.109, 1.475, 0.784], 0.003, 102)],
    ids=["by coarse noise", "from a standard deviation off"],
)
def test_a_large_effect_is_reached(share, theta, sd, seed):
    """Its peaks have parted from those without it: by the noise itself, a fit stops on the way."""
    masses, springs = np.array([2.0, 1.5, 1.5]), np.array([5e3, 4e3, 4e3])
    heavy, stiff = masses * [1.0, 1.0 + share, 1.0], springs * theta
    grid = 0.1 * np.arange(1, 159)
    exact = Chain(heavy, stiff, zeta=0.006).frf(grid)
    problem = pose(
        building_of(masses, springs, zeta=(0.003, 0.06)),
        observe(("2F", "3F", "RF"), grid, exact, sd, seed),
    )
    found = diagnose(problem, among=frozenset({"added_mass@3F"}))
    assert found.verdict == NAMED
    assert found.leading.size == pytest.approx(share, abs=4.0 * found.leading.size_sd)


def test_of_two_floors_either_mass_is_told():
    """Without a force only ratios of masses show; a search alone ends at one of the two."""
    masses, springs = np.array([2.0, 1.5]), np.array([3e3, 2e3])
    frf = Chain(masses * [1.0, 1.6], springs * [0.8, 1.5], zeta=0.006).frf(GRID)
    building = building_of(masses, springs, zeta=(0.003, 0.06))
    problem = pose(building, observe(("2F", "RF"), GRID, frf, 0.01, 2))
    found, both = diagnose(problem), frozenset({"added_mass@2F", "added_mass@RF"})
    assert {found.leading.placed.label, *found.twins} == both
    assert all(f"{floor} carries" in found.sentence for floor in ("2F", "RF"))
    assert diagnose(problem, base=found.leading.fitted, among=both).verdict != NAMED
