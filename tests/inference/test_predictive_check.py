"""Posterior predictive p-values against a linear-Gaussian model, where all is known."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.stats import chi2

from femupdate.dynamics import Responses
from femupdate.inference import STATED, predictive_check
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
