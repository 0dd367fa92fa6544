"""Histories against closed forms, scipy's integrators and the frequency domain."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from femupdate.dynamics import (
    ConstantDamping,
    ReducedModel,
    System,
    floor_histories,
    history_batches,
)
from femupdate.dynamics.recurrence import interpolate_record
from femupdate.errors import StructureError

STRAIGHT = {"oversampling": 1, "tolerance": 0.0}
MASS = np.array([3000.0, 2000.0, 1700.0, 900.0])
SPRING = np.array([9e6, 5e6, 4e6, 1.5e6])
THETA = np.array([[1.0, 1.0, 1.0, 1.0], [0.5, 2.1, 0.8, 1.3], [2.7, 0.4, 1.9, 0.6]])


def shear_building(mass, spring, seed=7, law=None) -> System:
    """A chain in rotated mass-orthonormal coordinates: nothing is diagonal, nothing symmetric."""
    count = len(mass)
    rotation = np.linalg.qr(np.random.default_rng(seed).normal(size=(count, count)))[0]
    basis = rotation / np.sqrt(mass)[:, None]
    drift = np.eye(count) - np.eye(count, k=-1)
    above = np.triu(np.ones((count, count))) * mass
    model = ReducedModel(
        stiffness_terms=np.stack(
            [k * np.outer(basis.T @ d, basis.T @ d) for k, d in zip(spring, drift, strict=True)]
        ),
        stiffness_constant=np.zeros((count, count)),
        excitation=basis.T @ mass,
        floor_shapes=basis,
        floors=(*(f"{i + 2}F" for i in range(count - 1)), "RF"),
        story_inertia=above @ basis,
        story_mass=above.sum(axis=1),
        story_drift=drift @ basis,
    )
    return System(model, law or ConstantDamping())


def oscillator(omega: float) -> System:
    return shear_building(np.array([2.5]), np.array([2.5 * omega**2]))


def chain_matrices(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    drift = np.eye(len(MASS)) - np.eye(len(MASS), k=-1)
    return np.diag(MASS), drift.T @ np.diag(theta * SPRING) @ drift


def modal_damping_matrix(M: np.ndarray, K: np.ndarray, zeta: float) -> np.ndarray:
    root = np.sqrt(M)
    squared, modes = np.linalg.eigh(np.linalg.solve(root, K) @ np.linalg.inv(root))
    return root @ modes @ np.diag(2.0 * zeta * np.sqrt(squared)) @ modes.T @ root


def integrate(M, K, C, record, step):
    """Relative displacement and absolute acceleration (n, dof) by DOP853, lines between samples."""
    time = np.arange(len(record)) * step
    size = len(M)
    one = np.ones(size)

    def rate(t, y):
        force = -M @ one * np.interp(t, time, record) - C @ y[size:] - K @ y[:size]
        return np.concatenate([y[size:], np.linalg.solve(M, force)])

    y = solve_ivp(
        rate,
        (0.0, time[-1]),
        np.zeros(2 * size),
        method="DOP853",
        t_eval=time,
        max_step=step,
        rtol=1e-10,
        atol=1e-14,
    ).y.T
    relative, speed = y[:, :size], y[:, size:]
    return relative, -np.linalg.solve(M, (C @ speed.T) + (K @ relative.T)).T


def step_response(omega: float, zeta: float, t: np.ndarray) -> np.ndarray:
    """u of u'' + 2 zeta omega u' + omega^2 u = -1 from rest (any textbook of dynamics)."""
    if zeta == 1.0:
        shape = np.exp(-omega * t) * (1.0 + omega * t)
    elif zeta < 1.0:
        damped = omega * np.sqrt(1.0 - zeta**2)
        decay = np.exp(-zeta * omega * t)
        shape = decay * (np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t))
    else:
        spread = omega * np.sqrt(zeta**2 - 1.0)
        slow, fast = -zeta * omega + spread, -zeta * omega - spread
        shape = (fast * np.exp(slow * t) - slow * np.exp(fast * t)) / (fast - slow)
    return -(1.0 - shape) / omega**2


@pytest.mark.parametrize("zeta", [0.0, 0.02, 0.3, 1.0, 2.5])
@pytest.mark.parametrize("step_over_period", [0.01, 0.4, 3.3])
def test_free_response_to_a_step_is_exact_for_any_time_step(zeta, step_over_period):
    omega = 2.0 * np.pi * 1.7
    step = step_over_period / 1.7
    found = floor_histories(oscillator(omega), [[1.0]], zeta, np.full(60, 0.8), step, **STRAIGHT)
    exact = 0.8 * step_response(omega, zeta, np.arange(60) * step)
    # Round-off of the matrix exponential grows with the 60 steps.
    np.testing.assert_allclose(found.story_drift[0, 0], exact, atol=1e-11 * np.abs(exact).max())
    np.testing.assert_allclose(
        found.story_shear[0, 0], -2.5 * found.floor_acceleration[0, 0], rtol=1e-9, atol=1e-12
    )


def test_resonance_builds_up_in_proportion_to_time():
    omega, step = 2.0 * np.pi * 2.0, 0.5 / 400
    t = np.arange(4000) * step
    found = floor_histories(oscillator(omega), [[1.0]], 0.0, np.sin(omega * t), step)
    exact = -(np.sin(omega * t) - omega * t * np.cos(omega * t)) / (2.0 * omega**2)
    # The record is band-limited but starts with a kink, which sampling rounds off.
    assert np.abs(found.story_drift[0, 0] - exact).max() < 1e-4 * np.abs(exact).max()


@pytest.mark.parametrize("sample", range(len(THETA)))
def test_chain_against_scipy(sample):
    rng = np.random.default_rng(sample)
    record, step, zeta = rng.normal(size=150), 0.02, 0.04
    M, K = chain_matrices(THETA[sample])
    relative, absolute = integrate(M, K, modal_damping_matrix(M, K, zeta), record, step)
    found = floor_histories(
        shear_building(MASS, SPRING), THETA, [zeta] * 3, record, step, **STRAIGHT
    )
    drift = np.diff(relative, axis=1, prepend=0.0).T
    shear = -np.cumsum((MASS * absolute)[:, ::-1], axis=1)[:, ::-1].T
    for got, wanted in (
        (found.story_drift[sample], drift),
        (found.floor_acceleration[sample], absolute.T),
        (found.story_shear[sample], shear),
    ):  # scipy's tolerance of 1e-10 a step over 150 steps
        np.testing.assert_allclose(got, wanted, atol=1e-7 * np.abs(wanted).max())


@pytest.mark.parametrize("factor", [2, 5, 8])
def test_interpolation_keeps_samples_and_band(factor):
    t = np.arange(400.0)
    record = np.sin(2.0 * np.pi * 0.4 * t + 0.3)
    fine = interpolate_record(record, factor)
    assert len(fine) == 399 * factor + 1
    np.testing.assert_allclose(fine[::factor], record, atol=1e-12)
    between = np.sin(2.0 * np.pi * 0.4 * np.arange(len(fine)) / factor + 0.3)
    middle = slice(100 * factor, 300 * factor)
    np.testing.assert_allclose(fine[middle], between[middle], atol=5e-4)  # 80 dB is 1e-4


def test_a_building_without_stiffness_is_told():
    building = shear_building(MASS, SPRING)
    theta = np.array([[1, 1, 1, 1], [1, -1, 1, 1]])
    with pytest.raises(StructureError, match="sample 1 is not positive"):
        list(history_batches(building, theta, 0.02, np.ones(50), 0.01))
