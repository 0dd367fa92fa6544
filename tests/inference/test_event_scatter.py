"""Scatter between runs, against integrals done by other means and simulated events."""

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.stats import norm

from femupdate.inference import learned_scatter
from femupdate.inference.event_scatter import sd_density

ESTIMATES, ERRORS = np.array([0.03, -0.05, 0.08, 0.0]), np.array([0.01, 0.02, 0.03, 0.015])


def test_the_density_of_the_scatter_is_that_of_the_random_effects_model():
    """Mean, over the prior of tau and a flat one of the mean over events, by quadrature."""

    mean, log_tau = np.linspace(-0.8, 0.8, 801)[:, None], np.linspace(-5.9, 0.0, 601)
    joint = norm.pdf(log_tau, np.log(0.05), 1.0)
    for estimate, error in zip(ESTIMATES, ERRORS, strict=True):
        joint = joint * norm.pdf(estimate, mean, np.hypot(error, np.exp(log_tau)))
    whole, first = (
        simpson(simpson(np.exp(power * log_tau) * joint, x=log_tau), x=mean[:, 0])
        for power in (0, 1)
    )
    tau, weight = sd_density(ESTIMATES, ERRORS, 0.05)
    assert tau @ weight == pytest.approx(first / whole, rel=0.005)


@pytest.mark.parametrize("true", [0.02, 0.05, 0.1])
def test_intervals_of_the_next_event_hold_it(true):
    """Over 400 buildings of five events each, at a scatter that the prior holds."""
    rng, held = np.random.default_rng(2), []
    for seed in range(400):
        errors = rng.uniform(0.005, 0.02, 5)
        seen = true * rng.standard_normal(5) + errors * rng.standard_normal(5)
        found = learned_scatter(
            seen[:, None].repeat(2, 1), errors[:, None].repeat(2, 1), (1, 400), seed
        )
        pooled = (seen / errors**2).sum() / (errors**-2).sum()
        draws = pooled + (errors**-2).sum() ** -0.5 * rng.standard_normal(400)
        of = found.of(np.arange(400))
        following = draws + of.stiffer + of.stiffness * rng.standard_normal(400)
        low, high = np.quantile(following, [0.05, 0.95])
        held.append(low <= true * rng.standard_normal() <= high)
    # The prior is about .05: below it intervals are wide, above a little narrow (.8 at .15).
    assert 0.84 <= np.mean(held) <= 1.0
