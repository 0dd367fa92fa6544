"""What calibrate says of a posterior beside its table."""

from dataclasses import replace

import numpy as np
import pytest

from femupdate.inference import (
    DrawnBy,
    Parameter,
    Parameters,
    Posterior,
    PredictiveCheck,
    predictive_check,
)
from femupdate.measurement import Observation
from femupdate.workflow.conclusion import Fitting, judgement, overstated_noise

FACTORS = Parameters.uniform(("theta_1", "theta_2"), [1.0 / 3.0] * 2, [3.0] * 2)
KNOWN = Parameter(name="zeta", kind="damping", lower=0.05, upper=0.05)


@pytest.mark.parametrize("rms", [0.1, 0.27, 0.49])
def test_residuals_far_below_the_noise_are_told_with_their_size(rms):
    (note,) = overstated_noise(Fitting(misfit=rms**2, check=None))
    assert f"by {rms:.2g} times" in note
    assert "wide rather than narrow" in note


@pytest.fixture
def pressed():
    """A posterior whose second factor lies at the upper limit of its prior."""
    rng = np.random.default_rng(0)
    theta = np.stack([rng.uniform(0.9, 1.1, 500), 3.0 - 0.001 * rng.random(500)], axis=1)
    seen = np.ones((1, 4))
    return Posterior(
        parameters=FACTORS + Parameters((KNOWN,)),
        values=np.column_stack([theta, np.full(len(theta), 0.05)])[None],
        log_likelihood=np.zeros((1, 500)),
        drawn=DrawnBy(likelihood="exact", way="drawing", chains=1, evaluations=500),
        observation=Observation(
            frequency_hz=np.arange(1.0, 5.0),
            floors=("RF",),
            log_frf=seen,
            noise_sd=0.1 * seen,
            valid=seen > 0.0,
        ),
        settings={},
    )


def test_a_factor_at_the_limit_of_its_prior_is_told(pressed):
    (note,) = judgement(pressed, Fitting(misfit=1.0, check=None))
    assert note.startswith("theta_2 (3) presses against the prior's upper limit")
    assert "upper of [prior.theta]" in note


def test_a_damping_ratio_at_the_limit_of_its_prior_is_told(pressed):
    free = Parameter(name="zeta", kind="damping", lower=0.003, upper=0.06)
    values = np.concatenate([np.ones((1, 500, 2)), np.full((1, 500, 1), 0.0032)], axis=2)
    at_limit = replace(pressed, parameters=FACTORS + Parameters((free,)), values=values)
    (note,) = judgement(at_limit, Fitting(misfit=1.0, check=None))
    assert note.startswith("the damping ratio (0.003) presses against the prior's lower limit")
    assert "lower of [prior.zeta]" in note


def test_noise_that_no_file_states_is_called_assumed():
    (note,) = overstated_noise(Fitting(misfit=0.04, check=None), assumed=True)
    assert "the noise assumed" in note


@pytest.mark.parametrize(("ratio", "told"), [(1.2, 0), (2.25, 1)])
def test_a_small_p_value_is_no_warning_where_hardly_more_is_missed(pressed, ratio, told):
    check = PredictiveCheck(1e-5, (1e-5,), ("RF",), (ratio,))
    notes = judgement(pressed, Fitting(misfit=1.0, check=check))
    assert sum("1.5 times what is allowed for" in one for one in notes) == told
    assert sum("allowed for" in one for one in notes) == told


def test_a_floor_is_named_that_the_others_outweigh(pressed):
    """Of a thousand squares one floor has four times what is allowed for, and nine have a half."""
    squares = np.array([[4.0, *[0.5] * 9]]) * 100.0
    floors = tuple(f"{k}F" for k in range(2, 12))
    check = predictive_check(squares, [100.0] * 10, floors)
    assert check.whole > 0.99
    first = judgement(pressed, Fitting(misfit=1.0, check=check))[0]
    assert "at 2F by 2 times what is allowed for" in first
    alike = predictive_check(0.0 * squares + 200.0, [100.0] * 10, floors)
    assert (alike.whole < 0.01, alike.missed) == (True, ())  # no floor more than the others


def test_a_misfit_is_told_once(pressed):
    check = PredictiveCheck(1e-5, (1e-5,), ("RF",), (4.0,))
    for learned, count in ((False, 1), (True, 2)):
        notes = judgement(pressed, Fitting(misfit=4.1, check=check, learned=learned))
        assert sum(" times " in one for one in notes) == count


def test_what_decides_comes_before_a_limit(pressed):
    first, second = judgement(pressed, Fitting(misfit=49.0, check=None))
    assert "misses the measured ln|H| by 7.0 times its noise" in first
    assert "theta_2" in second
