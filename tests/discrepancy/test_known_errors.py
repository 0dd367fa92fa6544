"""Errors that are known beforehand widen what the data tell, whatever a single point says."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from femupdate.dynamics import System
from femupdate.inference import (
    Parameters,
    base_logs,
    damping_parameter,
    likelihood_of,
    settled,
    theta_prior,
)
from tests.chains import Chain
from tests.discrepancy.posed import building_of, observe, reduced_of

GRID, COMMON = 0.05 * np.arange(1, 241), 0.004


class Alike:
    """A change of all factors by one common share, as a line; the system holds nothing of it."""

    likeliest = torch.zeros(0, dtype=torch.float64)

    def __call__(self, data, system, values):
        at = values.zeta, torch.from_numpy(GRID)
        here = system.log_frf(values.theta, *at)
        there = system.log_frf(values.theta * (1.0 + 1e-5), *at)
        return data[0].moved(here, here + COMMON * (there - here) / 1e-5)

    def held(self, likeliest, system):
        return self, system

    def freed(self, system):
        return system, lambda errors: errors


def posed(truth, count, noise):
    """The likelihood of |H| of a chain of equal springs times factors, and its prior."""
    masses, springs = np.ones(len(truth)), np.full(len(truth), 600.0)
    grid = {"frequency_grid": {"start": 0.05, "step": 0.05, "count": count}}
    building = building_of(masses, springs, **grid)
    frf = Chain(masses, springs * truth, zeta=0.01).frf(GRID[:count])
    seen = observe(building.floors, GRID[:count], frf, noise, 3, phase=False)
    data = base_logs(seen, system := System(reduced_of(building).model), modes=None)
    prior = theta_prior(building) + Parameters((damping_parameter(building),))
    return likelihood_of((data,), system, prior), prior


def test_what_moves_all_factors_alike_is_never_told_from_them():
    likelihood, prior = posed(np.array([0.9, 1.1, 1.0]), 240, 0.02)
    found = settled(replace(likelihood, known=Alike()), 1)
    middle = prior.from_normal(found.found.z[:1])
    steps = torch.cat([torch.zeros(1, 4), 1e-6 * torch.eye(4)]).to(middle)
    whitened = found.likelihood.residuals(middle * torch.exp(steps))
    slopes = (whitened[1:] - whitened[:1]) / 1e-6
    covariance = torch.linalg.inv(slopes @ slopes.T).numpy()
    together = np.array([1.0, 1.0, 1.0, 0.0]) / 3.0
    sd = float(np.sqrt(together @ covariance @ together))
    # The noise alone leaves a tenth of this.
    assert sd == pytest.approx(COMMON, rel=0.05)


def test_twelve_factors_are_found_from_low_frequencies_on():
    truth = np.append(np.exp(np.random.default_rng(0).uniform(-0.69, 0.69, 12)), 0.01)
    likelihood, prior = posed(truth[:12], 80, 0.01)
    found = settled(likelihood, 0)
    sd = torch.linalg.inv(found.found.precision[0]).diagonal().sqrt()
    away = (found.found.z[0] - prior.to_normal(torch.from_numpy(truth)[None])[0]) / sd
    assert away.abs().max() < 4.0  # 13 normal ones: one case in 1,200 has more
    assert found.tried == 0
