"""A one-story building that softens, at the level it reaches, against scipy and bisection."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from scipy.optimize import bisect
from scipy.signal import StateSpace, lsim

from femupdate.building import from_document
from femupdate.dynamics import ConstantDamping, System, motion_level, reduced_on
from femupdate.effects import CATALOGUE, Placed, structure_of
from femupdate.inference import Values
from femupdate.measurement import GroundMotion
from femupdate.workflow.amplitude import at_own_level, far_stronger, own_level
from tests.documents import stick

MASS, SPRING, STEP = 2000.0, 8e5, 0.005
SOFTER, MORE_DAMPING = -0.12, 0.25
THETA, ZETA = np.array([[0.9], [1.1]]), np.array([0.03, 0.05])
SIZES = np.tile([SOFTER, MORE_DAMPING], (2, 1))
DRAWS = Values(*map(torch.from_numpy, (THETA, ZETA, SIZES)))
WEAK = 0.4  # m/s2


@pytest.fixture(scope="module")
def house():
    building = from_document(stick([MASS], [SPRING], grid=(0.2, 60), ratio=0.03))
    structure = structure_of(building)
    reduced = reduced_on(structure, np.diag(structure.points.mass**-0.5))
    placed = (Placed(CATALOGUE["amplitude_softening"], "all"),)
    terms = tuple(reduced.terms(one) for one in placed)
    system = System(reduced.model, ConstantDamping(), placed, terms)
    (floor,) = reduced.model.floors
    return SimpleNamespace(system=system, settings={"level_m_s2": {floor: WEAK}})


@pytest.fixture(scope="module")
def motion():
    """Shaking about the building's frequency, between five seconds of silence and ten."""
    time = np.arange(4000) * STEP
    swell = np.sin(np.pi * time / time[-1]) ** 2
    rng = np.random.default_rng(8)
    waves = sum(
        np.sin(2.0 * np.pi * f * time + phase)
        for f, phase in zip(np.linspace(1.0, 6.0, 21), rng.uniform(0, 6, 21), strict=True)
    )
    shaking = np.concatenate([np.zeros(1000), 0.4 * swell * waves, np.zeros(2000)])
    return GroundMotion(shaking, STEP)


def strong(acceleration):
    """Rms between the instants at which 5 and 95 % of the energy have passed."""
    energy = np.cumsum(acceleration**2) / (acceleration**2).sum()
    first, last = np.searchsorted(energy, [0.05, 0.95])
    return np.sqrt((acceleration[first:last] ** 2).mean())


def roof(theta, zeta, base):
    """Absolute acceleration of a mass on a spring by scipy."""
    omega = np.sqrt(theta * SPRING / MASS)
    A = np.array([[0.0, 1.0], [-(omega**2), -2.0 * zeta * omega]])
    system = StateSpace(A, [[0.0], [-1.0]], [[-(omega**2), -2.0 * zeta * omega]], [[0.0]])
    return lsim(system, base, np.arange(base.size) * STEP)[1]


def by_hand(theta, zeta, base):
    """Level (doublings) at which the response has that level, stiffness and damping there."""

    def at(level):
        return theta * (1.0 + SOFTER) ** level, zeta * (1.0 + MORE_DAMPING) ** level

    level = bisect(lambda x: np.log2(strong(roof(*at(x), base)) / WEAK) - x, -6.0, 8.0, xtol=1e-3)
    return level, *at(level)


def scaled(motion, factor):
    return GroundMotion(factor * motion.acceleration, STEP)


def test_stiffness_and_damping_are_those_at_the_level_of_the_response(house, motion):
    own = scaled(motion, 4.0)
    there, levels, _ = at_own_level(house.system, DRAWS, own, house.settings)
    for row in range(2):
        level, theta, zeta = by_hand(THETA[row, 0], ZETA[row], own.acceleration)
        # Levels are found to 0.005 doublings; scipy takes the motion as straight between samples.
        assert levels[row] == pytest.approx(level, abs=0.02)
        assert float(there.theta[row, 0]) == pytest.approx(theta, rel=0.003)
        assert float(there.zeta[row]) == pytest.approx(zeta, rel=0.006)


def test_a_ratio_that_the_user_chose_stays(house, motion):
    there, _, _ = at_own_level(
        house.system, DRAWS, scaled(motion, 4.0), house.settings, keep_damping=True
    )
    np.testing.assert_array_equal(there.zeta, ZETA)
    assert (there.theta.numpy() < 0.95 * THETA).all()


def test_without_a_known_level_nothing_changes_and_the_user_is_told(house, motion):
    there, _, said = at_own_level(house.system, DRAWS, motion, {})
    np.testing.assert_array_equal(there.theta, THETA)
    np.testing.assert_array_equal(there.zeta, ZETA)
    assert "not known" in said


def test_the_note_says_how_far_the_motion_is_from_the_records(house, motion):
    def note(factor):
        settings = {**house.settings, "level_span": [0.0, 1.0]}
        return at_own_level(house.system, DRAWS, scaled(motion, factor), settings)[-1]

    _, level, _ = at_own_level(house.system, DRAWS, scaled(motion, 10.0), house.settings)
    assert level.mean() > 1.5
    times = f"{2.0 ** level.mean():.2g} times as strong"
    assert times in note(10.0)
    assert "beyond the records (1 to 2 times)" in note(10.0)
    inside = WEAK / strong(roof(1.0, 0.04, motion.acceleration))
    assert "beyond" not in note(1.5 * inside)


def test_levels_are_found_also_where_repeating_would_run_away():
    """Of the first draw the answer falls twice as fast as the question rises."""
    at_rest, slope, asked = np.array([1.8, 1.5, 0.7, 0.0]), np.array([-2.0, -0.1, 0.3, 0.0]), []

    def reached(rows, level):
        asked.extend(rows)
        return at_rest[rows] + slope[rows] * level

    found = own_level(reached, 4, 0.0)
    np.testing.assert_allclose(found, at_rest / (1.0 - slope), atol=0.01)
    # What is found is not asked again.
    assert [asked.count(row) for row in range(4)] == [3, 3, 6, 1]


def test_silence_does_not_lower_a_level():
    wave = 3.0 * np.sin(0.1 * np.arange(20_000))
    padded = np.concatenate([np.zeros(7000), wave, np.zeros(40_000)])
    both = motion_level(np.stack([padded, 2.0 * padded]))
    np.testing.assert_allclose(both, 3.0 / np.sqrt(2.0) * np.array([1.0, 2.0]), rtol=2e-3)
    assert float(motion_level(wave)) == pytest.approx(3.0 / np.sqrt(2.0), rel=2e-3)
    assert float(motion_level(np.zeros(50))) == 0.0


@pytest.mark.parametrize(
    ("peak", "warned"), [(0.3, False), (0.5, True), (6.1, True)], ids=["alike", "above", "77 times"]
)
def test_a_motion_far_stronger_than_the_record_of_the_posterior_is_told(peak, warned):
    said = far_stronger({"base_peak_m_s2": 0.08}, peak)
    assert bool(said) == warned
    assert all(f"{peak / 0.08:.2g} times" in sentence for sentence in said)
    assert far_stronger({"base_peak_m_s2": 0.0}, peak) == far_stronger({}, peak) == ()
