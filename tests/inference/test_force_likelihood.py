"""Likelihood of responses to a force, against closed forms and against base motion."""

import numpy as np
import pytest
import torch

from femupdate.building.files import load_building
from femupdate.dynamics.damping import ConstantDamping
from femupdate.dynamics.force_response import accelerance
from femupdate.dynamics.projection import lumped
from femupdate.dynamics.system import System
from femupdate.effects.structure import structure_of
from femupdate.inference.force_likelihood import ForceLikelihood
from femupdate.measurement.force_frf import ForcedObservation
from femupdate.measurement.observation import Observation

TRUTH = torch.tensor([[1.3, 0.8, 1.1, 0.7, 0.02]], dtype=torch.float64)
FREQUENCY = np.linspace(0.5, 12.0, 60)


@pytest.fixture(scope="module")
def system():
    return System(lumped(structure_of(load_building("shear_4dof"))).model, ConstantDamping())


@pytest.fixture(scope="module")
def exact(system):
    """ln|A| (4, 60) under a force at 3F."""
    zeta, frequency = TRUTH[:, 4], torch.from_numpy(FREQUENCY)
    return accelerance(system, TRUTH[:, :4], zeta, frequency, 1)[0].abs().log().numpy()


def forced(log_frf, valid=None, noise=0.1):
    there = np.ones(log_frf.shape, dtype=bool) if valid is None else valid
    own = Observation(FREQUENCY, ("2F", "RF"), log_frf, np.full(log_frf.shape, noise), there)
    return ForcedObservation("3F", "accelerance", own)


def test_residuals_are_those_written_by_hand(system, exact):
    away = np.random.default_rng(1).normal(size=(2, 60))
    valid = np.ones((2, 60), dtype=bool)
    valid[0, :7] = valid[:, 9] = False
    data = np.where(valid, exact[[0, 3]] + 0.1 * away, np.nan)
    likelihood = ForceLikelihood(system, forced(data, valid))
    squares = np.where(valid, away**2, 0.0).sum(axis=1)
    np.testing.assert_allclose(likelihood.squares(TRUTH)[0], squares, rtol=1e-9)
    assert float(likelihood(TRUTH)) == pytest.approx(-0.5 * squares.sum(), rel=1e-9)
    residual = likelihood.residuals(TRUTH)
    assert float(residual.square().sum()) == pytest.approx(squares.sum(), rel=1e-9)
    assert likelihood.names == ("2F/3F", "RF/3F")
    assert likelihood.freedom == (52.0, 59.0)


def test_a_known_damping_ratio_is_left_out_of_the_parameters(system, exact):
    both = ForceLikelihood(system, forced(exact[[0, 3]] + 0.05))
    known = ForceLikelihood(system, forced(exact[[0, 3]] + 0.05), 0.02)
    assert float(known(TRUTH[:, :4])) == pytest.approx(float(both(TRUTH)))


def test_gradient_is_that_of_differences(system, exact):
    likelihood = ForceLikelihood(system, forced(exact[[0, 3]] + 0.1))
    point = (TRUTH * 1.02).requires_grad_()
    (slope,) = torch.autograd.grad(likelihood(point).sum(), point)
    step = 1e-6 * torch.eye(5, dtype=torch.float64)
    both = likelihood(point.detach() + step) - likelihood(point.detach() - step)
    np.testing.assert_allclose(slope[0], both / 2e-6, rtol=1e-4)
