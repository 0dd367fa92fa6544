"""Posterior predictive p-values against a linear-Gaussian model, where all is known."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from femupdate.benchmarks.shear4dof.case import authors_case
from femupdate.benchmarks.shipped import benchmark_model
from scipy.stats import chi2

from femupdate.dynamics import Responses
from femupdate.inference import STATED, identifiability, predictive_check, r_hat
from femupdate.inference.diagnostics import separate_modes
from femupdate.inference.frf_data import frf_data
from femupdate.measurement import Observation

POINTS, PARAMETERS, SD = 40, 5, 0.3
FREQUENCY = 0.1 * np.arange(1, POINTS + 1)


def observation(values, sd=SD, **others):
    floors = ("2F", "3F", "RF")[: len(values)]
    valid = others.pop("valid", np.ones(values.shape, dtype=bool))
    return Observation(FREQUENCY, floors, values, np.full(values.shape, sd), valid, **others)


def check_predictions(observation, predicted):
    """Of ln|H| (n, f, k) at posterior draws, as a likelihood checks them."""
    data = frf_data(observation, observation.floors, table=STATED)
    data = replace(data, logs=Responses())
    left, rows = data.compared(torch.from_numpy(predicted)), torch.zeros(len(predicted)).long()
    names, squares, counts = zip(
        *data.checked(*data.error(None).floor_squares(left, rows)), strict=True
    )
    return predictive_check(torch.stack(squares, 1), torch.stack(counts, 1), names)


def posterior_draws(rng, design, data, count):
    """Draws of the linear model's parameters under a flat prior, closed form."""
    information = design.T @ design / SD**2
    mean = np.linalg.solve(information, design.T @ data / SD**2)
    root = np.linalg.cholesky(np.linalg.inv(information))
    return mean + rng.standard_normal((count, design.shape[1])) @ root.T


def linear_p_value(rng, design, count=400):
    """One data set of the model itself, and its p-value by the check."""
    truth = rng.standard_normal(design.shape[1])
    data = design @ truth + SD * rng.standard_normal(len(design))
    draws = posterior_draws(rng, design, data, count)
    return check_predictions(observation(data[None]), (draws @ design.T)[:, None]).whole


def test_the_p_value_is_that_of_replicated_data():
    """Drawn one by one, as the definition says."""
    rng = np.random.default_rng(0)
    design = rng.standard_normal((POINTS, PARAMETERS))
    data = design @ np.ones(PARAMETERS) + SD * rng.standard_normal(POINTS)
    draws = posterior_draws(rng, design, data, 20_000)
    response = draws @ design.T
    replicated = response + SD * rng.standard_normal(response.shape)
    worse = ((replicated - response) ** 2).sum(axis=1) >= ((data - response) ** 2).sum(axis=1)
    found = check_predictions(observation(data[None]), response[:, None]).whole
    # 20,000 replicates: a share to .0035.
    assert found == pytest.approx(worse.mean(), abs=0.014)
    assert 0.05 < found < 0.95


def test_over_data_of_the_model_they_have_the_known_distribution():
    """T = S + Q: what no parameters explain, chi-square of n - p, and the draw's own way from the
    best fit, chi-square of p: p = E_Q[P(chi2_n > S + Q)], drawn from that formula alone."""
    rng = np.random.default_rng(1)
    design = rng.standard_normal((POINTS, PARAMETERS))
    found = [linear_p_value(rng, design) for _ in range(1000)]
    rest = chi2.rvs(POINTS - PARAMETERS, size=4000, random_state=rng)
    moved = chi2.rvs(PARAMETERS, size=400, random_state=rng)
    known = chi2.sf(rest[:, None] + moved, POINTS).mean(axis=1)
    quantiles = [0.05, 0.25, 0.5, 0.75, 0.95]
    # 1,000 cases: a quantile near a half of a nearly uniform distribution to .016.
    np.testing.assert_allclose(
        np.quantile(found, quantiles), np.quantile(known, quantiles), atol=0.06
    )
    # Conservative: nearer to a half than a uniform one, and Meng's bound.
    assert np.std(found) < 12**-0.5
    assert np.mean(np.less(found, 0.05)) < 0.05 + 0.02
    assert abs(np.mean(found) - 0.5) < 0.05


def test_a_response_that_is_missing_something_is_seen_at_its_floor():
    rng = np.random.default_rng(3)
    response = rng.standard_normal((50, 3, POINTS)) * 1e-3
    data = SD * rng.standard_normal((3, POINTS))
    data[1] += 2.0 * SD
    found = check_predictions(observation(data), response)
    assert found.whole < 1e-6
    values = dict(zip(found.names, found.floors, strict=True))
    assert values["3F"] < 1e-6
    assert min(values["2F"], values["RF"]) > 0.01
    assert found.as_dict()["floors"] == values
    assert "(2F " in found.sentence()


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


@pytest.mark.parametrize("chains", [2, 4])
@pytest.mark.parametrize("draws", [40, 51])
def test_it_is_that_of_arviz(chains, draws):
    """Chains of other centres, spreads and tails; an odd number of draws among them."""
    az = pytest.importorskip("arviz")
    rng = np.random.default_rng(chains + draws)
    values = rng.standard_normal((chains, draws, 3))
    values[0, :, 1] += 0.7
    values[-1, :, 2] = 3.0 * rng.standard_t(2, draws)
    expected = [float(az.rhat(np.ascontiguousarray(values[..., k]))) for k in range(3)]
    np.testing.assert_allclose(r_hat(values), expected, rtol=1e-10)
