"""Modes of reduced models against scipy, and modes left out against all of them."""

import numpy as np
import pytest
import torch
from femupdate.benchmarks.modal_frf import complex_frf
from scipy.linalg import eigh

from femupdate.dynamics import ConstantDamping, ReducedModel, System, modal_sum
from tests.chains import Chain
from tests.helpers import tensor


def test_modes_are_those_of_scipy(chain, thetas):
    modes = System(chain.reduced()).modes(tensor(thetas), tensor(np.zeros((3, 0))))
    for row, theta in enumerate(thetas):
        M, K = chain.at(theta).matrices
        squared = eigh(K, M, eigvals_only=True)
        # Two eigenvalue solvers in float64.
        np.testing.assert_allclose(modes.omega[row] ** 2, squared, rtol=1e-12)
        shapes = (modes.rows[row] * modes.omega[row]).numpy()  # of unit mass
        np.testing.assert_allclose(shapes.T @ M @ shapes, np.eye(4), atol=1e-12)
        np.testing.assert_allclose(K @ shapes, M @ shapes * squared, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("batch", [1, 2, 1000])
def test_batches_equal_one_by_one(chain, batch):
    theta = tensor(np.random.default_rng(0).uniform(0.4, 2.5, (5, 4)))
    data = System(chain.reduced()).modal_data(theta, batch=batch)
    for row in range(5):
        one = System(chain.reduced()).modal_data(theta[row : row + 1])
        np.testing.assert_allclose(data.omega[row], one.omega[0], rtol=1e-13)
        np.testing.assert_allclose(data.effect[row], one.effect[0], atol=1e-12)


def errors_of_leaving_out(model, theta, kept, top_hz):
    """Largest change of the complex H, whose size is 1 at rest and ten or more at resonances."""
    frequency, law = torch.linspace(0.05, top_hz, 400, dtype=torch.float64), ConstantDamping()
    zeta = torch.full((len(theta),), 0.01, dtype=torch.float64)
    full = complex_frf(System(model).modal_data(theta), frequency, law, zeta)
    errors = []
    for modes in kept:
        data = System(model).modal_data(theta, modes=modes, top_frequency_hz=top_hz)
        assert data.omega.shape[1] == modes
        errors.append(float((complex_frf(data, frequency, law, zeta) - full).abs().max()))
    return errors


def test_leaving_modes_out_converges_to_all_of_them(tall_chain):
    theta = tensor(np.random.default_rng(1).uniform(0.5, 2.0, (4, 30)))
    top = 8.0
    assert bool(
        ((System(tall_chain.reduced()).modal_data(theta).omega < 16.0 * np.pi).sum(1) == 5).all()
    )
    errors = errors_of_leaving_out(tall_chain.reduced(), theta, [7, 9, 12, 16, 22, 30], top)
    # Five modes lie in the band; the seventh above 10 Hz. The series has no damping: what is left
    # is 2 zeta r^3 of each effect, r < .8 the top over the frequency left out.
    assert errors[0] < 0.02 * 0.8**3
    assert errors[3] < 1e-4
    assert errors[4] < 1e-5
    assert errors[5] == 0.0
    assert errors == sorted(errors, reverse=True)


def test_modes_in_the_band_that_no_floor_feels_do_not_spoil_the_series():
    """Slab modes: inside the band, excited by next to nothing, hence the first to be left out."""
    omega = 2.0 * np.pi * np.array([2.0, 0.4, 3.5, 4.2, 5.0, 40.0, 60.0])
    excitation = np.array([5.0, 1e-7, 1e-7, 1e-7, 2.0, 1.0, 0.5])
    shapes = np.array([[0.1, 1e-3, 2e-3, 1e-3, -0.1, 0.2, -0.3]])
    zeros = np.zeros((1, 7))
    model = ReducedModel(
        np.diag(omega**2)[None],
        np.zeros((7, 7)),
        excitation,
        shapes,
        ("RF",),
        zeros,
        zeros[0],
        zeros,
    )
    theta = torch.ones(1, 1, dtype=torch.float64)
    kept = System(model).modal_data(theta, modes=2, top_frequency_hz=10.0)
    np.testing.assert_allclose(kept.omega[0], omega[[0, 4]], rtol=1e-12)
    # The stiff ones lose 2 zeta (10 / 40)^3 of an effect of .2, the others their peak of 1e-8. In
    # the series the one at 0.4 Hz would count (10 / 0.4)^6 times its effect, .02.
    assert errors_of_leaving_out(model, theta, [2], 10.0)[0] < 1e-4


@pytest.mark.parametrize("size", [1, 2])
def test_the_smallest_buildings(size):
    chain = Chain(np.array([2.0, 1.0])[:size], np.array([700.0, 300.0])[:size])
    theta = np.array([[1.7, 0.6]])[:, :size]
    frequency = np.array([0.5, 1.9, 4.0])
    data = System(chain.reduced()).modal_data(tensor(theta))
    found = complex_frf(data, tensor(frequency), ConstantDamping(), tensor([0.03]))
    expected = chain.at(theta[0], zeta=0.03).frf(frequency)
    np.testing.assert_allclose(found[0], expected, rtol=1e-11)


def modal_case(seed=0):
    rng = np.random.default_rng(seed)
    inverse, ratio = rng.uniform(0.2, 2.0, (2, 3)), rng.uniform(0.05, 0.2, (2, 3))
    values = inverse, ratio, rng.standard_normal((2, 4, 3))
    return [torch.from_numpy(one) for one in values]


def test_the_sum_over_modes_is_the_complex_one_at_any_number_of_frequencies():
    inverse, ratio, pairs = modal_case()
    omega = torch.linspace(0.0, 5.0, 1300, dtype=torch.float64)  # more than are summed at once
    real, imaginary = modal_sum(inverse, ratio, pairs, omega)
    own = inverse.numpy()[..., None] ** -0.5
    share = omega.numpy() / own
    each = 1.0 / (1.0 - share**2 + 2j * ratio.numpy()[..., None] * share)
    expected = np.einsum("npm,nmk->npk", pairs.numpy(), each)
    np.testing.assert_allclose(real.numpy() + 1j * imaginary.numpy(), expected, rtol=1e-10)


def test_the_sum_over_modes_has_the_gradient_of_differences():
    """The trajectories of the sampler follow it."""
    inputs = [one.requires_grad_() for one in modal_case()]
    omega = torch.linspace(0.1, 3.0, 7, dtype=torch.float64)
    assert torch.autograd.gradcheck(lambda *some: modal_sum(*some, omega), inputs)
