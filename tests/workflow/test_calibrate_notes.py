"""What calibrate says of a posterior beside its table."""

import numpy as np
import pytest

from femupdate.workflow.calibrate_draws import Fitting
from femupdate.workflow.calibrate_notes import overstated_noise


@pytest.mark.parametrize("rms", [0.1, 0.27, 0.49])
def test_residuals_far_below_the_noise_are_told_with_their_size(rms):
    (note,) = overstated_noise(Fitting(misfit=rms**2, check=None))
    assert f"by {rms:.2g} times" in note
    assert "wide rather than narrow" in note


@pytest.mark.parametrize("rms", [0.5, 1.0, 6.7, np.nan])
def test_residuals_like_the_noise_are_not(rms):
    assert overstated_noise(Fitting(misfit=rms**2, check=None)) == ()
