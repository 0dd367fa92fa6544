"""What the data leave open: closed forms, and draws made to measure."""

import numpy as np
import pytest
import torch
from femupdate.benchmarks.shear4dof.case import authors_case
from femupdate.benchmarks.shipped import benchmark_model

from femupdate.inference import identifiability
from femupdate.inference.diagnostics import separate_modes

NAMES = ("theta_1", "theta_2", "theta_3")
LOWER, UPPER = np.full(3, 0.2), np.array([3.0, 4.0, 5.0])


def draws_of(covariance, count=20_000, mean=(0.1, -0.2, 0.0)):
    """Draws whose ln theta, in the prior's standard deviations, have this covariance."""
    white = np.random.default_rng(3).multivariate_normal(mean, covariance, size=count)
    # Moments of ln u, u uniform on the range, by sums over its middles.
    ln = np.log(LOWER + (UPPER - LOWER) * (np.arange(200_000)[:, None] + 0.5) / 200_000)
    return np.exp(ln.mean(axis=0) + ln.std(axis=0) * white)


def test_eigenvectors_of_a_gaussian():
    """theta_2 up with theta_3 down is open, their sum and theta_1 are determined."""
    apart = np.array([0.0, 0.8, -0.6])
    together = np.array([0.0, 0.6, 0.8])
    first = np.array([1.0, 0.0, 0.0])
    sizes = ((0.7, apart), (0.1, together), (0.05, first))
    covariance = sum(sd**2 * np.outer(v, v) for sd, v in sizes)
    found = identifiability(draws_of(covariance), LOWER, UPPER, NAMES)
    assert found.undetermined == 1
    assert len(found.modes) == 1
    for part, (sd, direction) in zip(found.combinations, sizes, strict=True):
        assert part.kept == pytest.approx(sd, rel=0.02)
        np.testing.assert_allclose(part.weight, direction, atol=0.01)
    assert found.left_alone == ()
    (sentence,) = found.sentences()
    assert "hardly determine theta_2 up with theta_3 down (69 % of the prior's" in sentence
    assert "theta_1" not in sentence


def test_a_parameter_that_the_data_leave_alone_is_named_by_itself():
    covariance = np.diag([0.95**2, 0.1**2, 0.2**2])
    found = identifiability(draws_of(covariance), LOWER, UPPER, NAMES)
    assert found.left_alone == ("theta_1",)
    (sentence,) = found.sentences()
    assert "next to nothing about theta_1" in sentence


def test_a_curved_ridge_is_one_mode():
    rng = np.random.default_rng(2)
    t = rng.uniform(-1.0, 1.0, 4000)
    x = np.column_stack([2.0 * t, 2.0 * t**2]) + 0.1 * rng.normal(size=(4000, 2))
    assert int(separate_modes(torch.from_numpy(x)).max()) == 0


def test_the_four_modes_of_the_four_story_roof():
    """As they are: `test_shear4dof` finds them, with these weights, by sampling."""
    model, rng = benchmark_model(), np.random.default_rng(3)
    case, weight = authors_case(model), [0.34, 0.34, 0.19, 0.13]
    of = rng.choice(4, 2000, p=weight)
    drawn = case.solutions[of] + (case.sd * rng.normal(size=(2000, 4, 4)))[np.arange(2000), of]
    found = identifiability(drawn, model.prior.lower, model.prior.upper, model.prior.names)
    assert len(found.modes) == 4
    # Weights of 2000 draws scatter by .011.
    assert [mode.weight for mode in found.modes] == pytest.approx(weight, abs=0.05)
    for mode in found.modes:
        assert np.abs(case.solutions - mode.mean).max(axis=1).min() < 0.02
    assert found.undetermined == 0
    assert "4 separate modes" in next(found.sentences())
