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

MASSES, SPRINGS = np.ones(3), np.full(3, 600.0)
GRID = 0.05 * np.arange(1, 241)
TRUTH, COMMON = np.array([0.9, 1.1, 1.0]), 0.004


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


def test_what_moves_all_factors_alike_is_never_told_from_them(
    chains, building_of, observe, reduced_of
):
    frf = chains.Chain(MASSES, SPRINGS * TRUTH, zeta=0.01).frf(GRID)
    grid = {"frequency_grid": {"start": 0.05, "step": 0.05, "count": 240}}
    building = building_of(MASSES, SPRINGS, **grid)
    seen = observe(building.floors, GRID, frf, 0.02, 3, phase=False)
    system = System(reduced_of(building).model)

    prior = theta_prior(building) + Parameters((damping_parameter(building),))
    likelihood = likelihood_of((base_logs(seen, system, modes=None),), system, prior)
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
