"""Likelihood of responses to a force, against closed forms and against base motion."""

import numpy as np
import pytest
import torch

from femupdate.building import load_building
from femupdate.dynamics import ConstantDamping, Excitation, System, lumped
from femupdate.effects import structure_of
from femupdate.inference import (
    STATED,
    Parameter,
    Parameters,
    draws_about,
    forced_data,
    likelihood_of,
    settled,
)
from femupdate.measurement import Observation
from tests.sticks import accelerance

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


FACTORS = Parameters.uniform(("a", "b", "c", "d"), [0.33] * 4, [3.0] * 4)


def likelihood_by(system, forced, low=0.01, high=0.1):
    """Of responses to a force that are taken at their word."""
    zeta = Parameters((Parameter(name="zeta", kind="damping", lower=low, upper=high),))
    return likelihood_of(
        (forced_data(forced, system.floors, table=STATED),), system, FACTORS + zeta
    )


def forced(log_frf, valid=None, noise=0.1):
    there = np.ones(log_frf.shape, dtype=bool) if valid is None else valid
    sd = np.full(log_frf.shape, noise)
    return Observation(
        FREQUENCY, ("2F", "RF"), log_frf, sd, there, excitation=Excitation(force="3F")
    )


def test_residuals_are_those_written_by_hand(system, exact):
    away = np.random.default_rng(1).normal(size=(2, 60))
    valid = np.ones((2, 60), dtype=bool)
    valid[0, :7] = valid[:, 9] = False
    data = np.where(valid, exact[[0, 3]] + 0.1 * away, np.nan)
    likelihood = likelihood_by(system, forced(data, valid))
    squares = np.where(valid, away**2, 0.0).sum(axis=1)
    names, found, freedom = zip(*likelihood.checked(likelihood.raw(TRUTH), 1), strict=True)
    np.testing.assert_allclose(torch.cat(found), squares, rtol=1e-9)
    assert float(likelihood(TRUTH)) == pytest.approx(-0.5 * squares.sum(), rel=1e-9)
    residual = likelihood.residuals(TRUTH)
    assert float(residual.square().sum()) == pytest.approx(squares.sum(), rel=1e-9)
    assert names == ("2F/3F", "RF/3F")
    assert torch.cat(freedom).tolist() == [52.0, 59.0]


def test_gradient_is_that_of_differences(system, exact):
    likelihood = likelihood_by(system, forced(exact[[0, 3]] + 0.1))
    point = (TRUTH * 1.02).requires_grad_()
    (slope,) = torch.autograd.grad(likelihood(point).sum(), point)
    step = 1e-6 * torch.eye(5, dtype=torch.float64)
    both = likelihood(point.detach() + step) - likelihood(point.detach() - step)
    np.testing.assert_allclose(slope[0], both / 2e-6, rtol=1e-4)


def test_an_error_of_the_model_is_learned_under_forces(system):
    """Gains off by 4 %, and a damping ratio of each mode: frequencies stay inside the intervals."""
    grid, rng = np.arange(0.5, 12.0, 1.0 / 16.0), np.random.default_rng(3)
    ratios = np.array([0.016, 0.022, 0.02, 0.015])
    modes = system.modes(TRUTH[:, :4], TRUTH[:, :0])
    own, shape = modes.omega[0].numpy(), (modes.rows[0, :4] * modes.omega[0]).numpy()
    omega = 2.0 * np.pi * grid[:, None]
    bend = omega**2 / (own**2 - omega**2 + 2j * ratios * own * omega)
    data = []
    for force, floor in enumerate(system.floors):
        frf = np.einsum("fm,m,km->fk", shape, shape[force], bend)
        log_frf = np.log(np.abs(frf)) + 0.04 * rng.normal(size=(4, 1))
        log_frf += 0.02 * rng.normal(size=log_frf.shape)
        told = Observation(
            grid,
            system.floors,
            log_frf,
            np.full(log_frf.shape, 0.02),
            np.ones(log_frf.shape, dtype=bool),
            excitation=Excitation(force=floor),
        )
        data.append(forced_data(told, system.floors))
    zeta = Parameters((Parameter(name="zeta", kind="damping", lower=0.002, upper=0.1),))
    found = settled(likelihood_of(data[::2], system, FACTORS + zeta), 0)
    prior = found.likelihood.prior
    drawn = draws_about(prior, found.likelihood, found.found, 1000, 0).resampled(1000, 1)
    frequency = system.modes(drawn.theta[:, :4], drawn.theta[:, :0]).omega.numpy()
    away = (frequency.mean(0) - own) / frequency.std(0)
    assert np.abs(away).max() < 3.0
    for data, error, row in zip(
        found.likelihood.data, found.likelihood.error.parts, found.likelihood.row, strict=True
    ):
        assert error.levels[row].own + error.levels[row].common > 0.0, data.name


def test_damping_is_found_beside_wrong_antiresonances(system):
    """Masses off by a tenth: factors can hit all peaks, and no anti-resonance."""
    mass, ratio = np.array([1.05, 0.88, 0.92, 1.1]), 0.004
    spring = 1000.0 * np.append(TRUTH[0, :4].numpy(), 0.0)
    stiffness = np.diag(spring[:4] + spring[1:]) - np.diag(spring[1:4], 1)
    stiffness -= np.diag(spring[1:4], -1)
    squared, shape = np.linalg.eigh(stiffness / np.sqrt(np.outer(mass, mass)))
    shape, poles = shape / np.sqrt(mass)[:, None], np.sqrt(squared)
    grid, rng = np.arange(1.0, 11.0, 1.0 / 32.0), np.random.default_rng(1)
    omega = 2.0 * np.pi * grid[:, None]
    bend = omega**2 / (squared - omega**2 + 2j * ratio * poles * omega)
    frf = np.einsum("fm,m,km->fk", shape, shape[3], bend)
    log_frf = np.log(np.abs(frf)) + 0.05 * rng.normal(size=frf.shape)
    told = Observation(
        grid,
        system.floors,
        log_frf,
        np.full(frf.shape, 0.05),
        np.ones(frf.shape, dtype=bool),
        excitation=Excitation(force="RF"),
    )
    zeta = Parameters((Parameter(name="zeta", kind="damping", lower=0.001, upper=0.05),))
    likelihood = likelihood_of((forced_data(told, system.floors),), system, FACTORS + zeta)
    found = settled(likelihood, 0)
    drawn = draws_about(likelihood.prior, found.likelihood, found.found, 500, 0)
    drawn = drawn.resampled(500, 1).theta
    frequency = system.modes(drawn[:, :4], drawn[:, :0]).omega.numpy()
    # Counted whole, the anti-resonances make damping 15 % too high.
    np.testing.assert_allclose(frequency.mean(0), poles, rtol=1e-3)
    assert float(drawn[:, 4].mean()) == pytest.approx(ratio, rel=0.06)
