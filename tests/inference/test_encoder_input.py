"""What of an observation the observation encoder gets to see."""

import numpy as np
import pytest
import torch

from femupdate.inference.latent_likelihood import encoder_input
from femupdate.measurement import Observation

FLOORS = ("2F", "3F", "RF")
FREQUENCY = 0.5 + 0.25 * np.arange(41)


def observation(floors, valid, log_frf=None, frequency=FREQUENCY):
    """Straight lines in ln|H|, a different one each floor; NaN where not valid."""
    valid = np.asarray(valid, dtype=bool)
    lines = np.array([[0.3 + row - (0.1 + row) * frequency] for row in range(len(floors))])[:, 0]
    values = np.where(valid, lines if log_frf is None else log_frf, np.nan)
    noise = np.where(valid, 0.2, np.nan)
    return Observation(frequency, tuple(floors), values, noise, valid, source="shaking.csv")


def everything(floors):
    return np.ones((len(floors), FREQUENCY.size), dtype=bool)


def test_a_complete_observation_passes_as_it_is():
    log_frf, visibility, notes = encoder_input(observation(FLOORS, everything(FLOORS)), FLOORS)
    assert log_frf.shape == (1, 3, 41)
    assert log_frf.dtype == visibility.band.dtype == torch.float32
    assert visibility.floors.tolist() == [[1.0, 1.0, 1.0]]
    assert visibility.band.tolist() == [[0.0, 1.0]]
    assert notes == ()
    lines = observation(FLOORS, everything(FLOORS)).log_frf
    np.testing.assert_allclose(log_frf[0], lines, rtol=1e-6)


def test_gaps_are_filled_by_straight_lines_and_told():
    valid = everything(FLOORS)
    valid[1, 10:14] = False
    valid[1, 20] = False
    log_frf, _, notes = encoder_input(observation(FLOORS, valid), FLOORS)
    lines = observation(FLOORS, everything(FLOORS)).log_frf
    np.testing.assert_allclose(log_frf[0], lines, rtol=1e-6)  # they were straight
    assert notes == ("Interpolated parts of the band: 3F 12.2 %.",)


def test_the_band_is_what_all_floors_have_in_common():
    valid = everything(FLOORS)
    valid[0, :7] = False
    valid[2, 33:] = False
    visibility = encoder_input(observation(FLOORS, valid), FLOORS)[1]
    first, last = (40.0 * visibility.band[0]).round().int().tolist()
    # A window of three points may reach over the edge by one.
    assert first in (6, 7)
    assert last in (32, 33)
    # Just these points count: the network is told so by weights that are zero elsewhere.
    weights = visibility.weights(41)
    assert weights[0, :, first : last + 1].eq(1.0).all()
    assert weights[0, :, :first].eq(0.0).all()
    assert weights[0, :, last + 1 :].eq(0.0).all()


@pytest.mark.parametrize(("low", "high", "told"), [(0, 40, 0), (4, 13, 0), (6, 40, 1), (0, 10, 1)])
def test_a_band_that_no_training_has_seen_is_told(low, high, told):
    valid = everything(("RF",))
    valid[0, :low] = valid[0, high + 1 :] = False
    notes = encoder_input(observation(("RF",), valid), FLOORS)[2]
    assert sum("narrower than the surrogate was trained for" in note for note in notes) == told
