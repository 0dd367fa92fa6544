"""Small effects that an error of the model could make up for as well."""

import numpy as np
import pytest

from femupdate.discrepancy.diagnose import diagnose
from femupdate.discrepancy.fit import fit_baseline
from femupdate.effects import building_effects
from tests.chains import Chain
from tests.discrepancy.posed import building_of, observe, pose

MASSES, SPRINGS = np.array([3.0, 2.0, 1.5, 1.5]), np.array([9e3, 5e3, 4e3, 4e3])
FLOORS = ("2F", "3F", "4F", "RF")
GRID = 0.2 * np.arange(1, 80)


def test_a_gain_of_three_percent_at_one_floor_is_named():
    """All of it lies within what the model may err by at that floor, at any frequency."""
    masses, springs = MASSES[1:], SPRINGS[1:]
    exact = Chain(masses, springs, zeta=0.02).frf(GRID)
    exact[2] *= 1.03
    seen = observe(("2F", "3F", "RF"), GRID, exact, 0.01, 3)
    found = diagnose(pose(building_of(masses, springs), seen))
    assert found.leading is not None
    assert found.leading.placed.label == "channel_gain@RF"
    assert found.verdict == "named"
    assert found.leading.size == pytest.approx(0.03, abs=3.0 * found.leading.size_sd)


def test_a_light_appendage_is_named_where_no_mode_of_the_building_is():
    """3 % of the roof's mass on a spring of its own: it acts in a narrow band alone."""
    masses, springs = MASSES[1:], SPRINGS[1:]
    plain = Chain(masses, springs, zeta=0.02)
    mass, omega = 0.03 * masses[-1], 2.6 * plain.modes[0][0]
    parts = [mass], [mass * omega**2], [2.0 * 0.05 * mass * omega]
    exact = plain.but(tower=tuple(map(np.array, parts))).frf(GRID)
    seen = observe(("2F", "3F", "RF"), GRID, exact, 0.01, 3)
    found = diagnose(pose(building_of(masses, springs), seen))
    assert found.leading is not None
    assert found.leading.placed.label == "tuned_appendage@RF"
    assert found.leading.size == pytest.approx(0.03, rel=0.2)


def test_too_few_points_tell_nothing():
    exact = Chain(MASSES, SPRINGS, zeta=0.02).frf(GRID)[:, 10:12]
    seen = observe(FLOORS, GRID[10:12], exact, 0.05, 0, False)
    found = diagnose(pose(building_of(MASSES, SPRINGS), seen))
    assert found.verdict == "unknown"
    assert found.sentence.startswith("The data are too few to tell: 8 independent points for 5")


def test_a_name_goes_beyond_the_usual_tolerances():
    """Masses off by one per cent, each by chance: a name only where the file says zero."""
    masses, among = MASSES * np.array([1.009, 0.988, 1.011, 0.992]), frozenset({"added_mass@4F"})
    seen = observe(FLOORS, GRID, Chain(masses, SPRINGS, zeta=0.01).frf(GRID), 0.005, 3)
    exact = diagnose(pose(building_of(MASSES, SPRINGS), seen), among=among)
    assert exact.leading.placed.label == "added_mass@4F"
    assert exact.verdict in ("named", "partly")
    found = diagnose(pose(building_of(MASSES, SPRINGS, tolerances=None), seen), among=among)
    assert found.verdict == "none"
    assert "masses that are known to 1.5 %" in found.sentence


@pytest.mark.parametrize(
    ("heavier", "verdict", "far"),
    [(0.03, "none", False), (0.05, "none", True), (0.1, "named", False)],
)
def test_a_mass_beyond_its_stated_tolerance_is_named(heavier, verdict, far):
    """Masses known to 1.5 %, of which ratios show: 1.7, 2.9 and 5.6 standard deviations."""
    masses = MASSES * np.array([1.0, 1.0, 1.0, 1.0 + heavier])
    seen = observe(FLOORS, GRID, Chain(masses, SPRINGS, zeta=0.01).frf(GRID), 0.005, 3)
    problem = pose(building_of(MASSES, SPRINGS, tolerances={"mass": 0.015}), seen)
    known = building_effects(problem.building)
    found = diagnose(problem, base=fit_baseline(problem, known.placed, known.values)[0])
    told = "twice the tolerance of masses (RF" in found.sentence
    assert (found.verdict, told) == (verdict, far)
    if verdict == "named":
        assert found.leading.placed.label == "added_mass@RF"
        assert found.leading.size == pytest.approx(heavier, abs=2.0 * found.leading.size_sd)


def test_one_cause_on_several_floors_is_one_name():
    heavy = MASSES * np.array([1.0, 1.15, 1.15, 1.0])
    exact = Chain(heavy, SPRINGS, zeta=0.02).frf(GRID)
    found = diagnose(pose(building_of(MASSES, SPRINGS), observe(FLOORS, GRID, exact, 0.01, 3)))
    assert (found.verdict, found.leading.placed.label) == ("named", "added_mass@3F to 4F")
    assert found.leading.size == pytest.approx(0.15, abs=3.0 * found.leading.size_sd)
    assert found.leading.in_words.startswith("Each of 3F to 4F carries 1")


def test_a_slow_clock_is_named_with_what_it_loses():
    """The roof's delays follow one another evenly; a clock that is late all the while competes."""
    growth = -0.03
    exact = Chain(MASSES, SPRINGS, zeta=0.02).frf(GRID)
    exact[3] *= np.exp(-2j * np.pi * np.outer(np.linspace(0.0, growth, 400), GRID)).mean(axis=0)
    problem = pose(building_of(MASSES, SPRINGS), observe(FLOORS, GRID, exact, 0.02, 5))
    names = ("drifting_clock", "channel_delay", "channel_gain")
    among = frozenset(f"{name}@{floor}" for name in names for floor in FLOORS)
    found = diagnose(problem, among=among)
    assert found.leading is not None
    assert (found.verdict, found.leading.placed.label) == ("named", "drifting_clock@RF")
    assert found.leading.size == pytest.approx(growth, abs=4.0 * found.leading.size_sd)
    assert found.leading.size_sd < 0.1 * abs(growth)


def test_what_stops_at_an_error_of_the_model_is_tried_by_noise_alone():
    """All floors err by 12 %, smoothly over frequency; joints that rotate would then lead."""
    masses, springs, rng = MASSES[1:], SPRINGS[1:], np.random.default_rng(1)
    exact = Chain(masses * [1.0, 1.0, 1.115], springs * [1.09, 0.68, 0.78], zeta=0.016)
    phases = np.pi * np.outer(np.arange(1, 12), GRID / GRID[-1])
    amplitudes = rng.standard_normal((2, 3, 11))
    error = amplitudes[0] @ np.cos(phases) + amplitudes[1] @ np.sin(phases)
    frf = exact.frf(GRID) * np.exp(0.117 * error / error.std())
    seen = observe(("2F", "3F", "RF"), GRID, frf, 0.01, 1)
    found = diagnose(pose(building_of(masses, springs), seen))
    assert (found.verdict, found.leading.placed.label) == ("partly", "added_mass@RF")
    assert found.leading.size == pytest.approx(0.115, abs=4.0 * found.leading.size_sd)
