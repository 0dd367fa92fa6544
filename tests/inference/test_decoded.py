"""The latent posterior on a decoder that has learned something wrong, by quadrature."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from femupdate.dynamics.system import Responses
from femupdate.inference.decoded import Decoded, fit_correction
from femupdate.inference.decoded_chains import decoded_posterior
from femupdate.inference.frf_data import Believed, Block, FrfData
from femupdate.inference.joint_error import joint_error
from femupdate.inference.likelihood import likelihood_of
from femupdate.inference.model_error import ErrorTable
from femupdate.inference.parameters import Parameters
from femupdate.surrogate.network import Mvae
from femupdate.surrogate.sizes import NetworkSizes

FREQUENCY = torch.arange(1, 61) / 60.0
LOWER, UPPER, NOISE = 0.3, 3.0, 0.3
# A few rows, of few harmonics: the quadrature asks for all of them at every point.
TABLE = ErrorTable(sizes=(0.1, 0.5), lengths=(1 / 20, 1 / 8), noise=(1.0, 2.0), harmonics=15)


class TwoSprings(torch.nn.Module):
    """Stands for a decoder: modes at sums and products of z; the ground floor says little."""

    def __init__(self, scale):
        super().__init__()
        self.scale = scale

    def forward(self, z, points=slice(None)):
        w = FREQUENCY[points].to(z)
        low = self.scale * (0.35 + 0.05 * (z[:, :1] + z[:, 1:] + z[:, 1:] ** 2 / 4.0))
        high = 0.8 + 0.03 * z[:, :1] * z[:, 1:]
        terms = [torch.log((one**2 - w**2) ** 2 + (0.1 * one * w) ** 2) for one in (low, high)]
        return torch.stack([-0.05 * terms[1], -0.5 * (terms[0] + terms[1])], dim=1)

    def excess_variance(self, points=slice(None)):
        return torch.full((2, 60), 0.05**2)[:, points]

    def damping(self, z):
        return z.new_full((len(z),), 0.02)

    def damping_coordinate(self, zeta):
        return zeta.new_zeros(len(zeta), 0)


BUILDING, LEARNED = TwoSprings(1.0), TwoSprings(1.03)


@pytest.fixture
def mvae():
    torch.manual_seed(0)
    made = Mvae(NetworkSizes(2, 60, 2, False, 2, width=16, parameter_width=16))
    made.decoder = LEARNED
    made.decode = LEARNED
    made.lower.fill_(LOWER)
    made.upper.fill_(UPPER)
    return made.requires_grad_(False)


def place(theta):
    root = (theta.sqrt() - LOWER**0.5) / (UPPER**0.5 - LOWER**0.5)
    return 3.0**0.5 * (2.0 * root - 1.0)


def respond(theta):
    return BUILDING(place(theta))


def building(theta, zeta):
    return respond(theta)[:, 1:]


@pytest.fixture
def pose(box):
    """A function: the likelihood of the roof alone, with a gap, a noise of .3 and an error."""

    def make(error=0.0):
        truth = torch.tensor([[1.4, 0.9]], dtype=torch.float64)
        noise = torch.randn(60, generator=torch.Generator().manual_seed(2), dtype=torch.float64)
        sd = torch.full((1, 60), NOISE, dtype=torch.float64)
        sd[0, 25:28] = torch.inf
        values = respond(truth)[0, 1:] + NOISE * noise + error
        data = FrfData(
            floors=("2F", "RF"),
            rows=(1,),
            frequency_hz=FREQUENCY.double(),
            log_frf=torch.where(sd.isfinite(), values, 0.0),
            phase=None,
            sd=sd,
            blocks=(Block(60, 1.0),),
            believed=Believed(table=TABLE),
            logs=Responses(),
            stand_in=building,
        )
        return likelihood_of((data,), None, parameters(box))

    return make


def parameters(box):
    """theta, and a damping ratio that is known."""
    return box([LOWER] * 2, [UPPER] * 2) + Parameters.uniform(
        ["zeta"], [0.02], [0.02], kind="damping"
    )


def by_quadrature(likelihood):
    """Mean and standard deviation of theta."""
    axis = torch.linspace(LOWER, UPPER, 151, dtype=torch.float64)
    theta = torch.cartesian_prod(axis, axis)
    values = likelihood(torch.column_stack([theta, torch.full((len(theta),), 0.02)]))
    weight = torch.softmax(values, 0)
    mean = weight @ theta
    return mean.numpy(), (weight @ (theta - mean) ** 2).sqrt().numpy()


# An error of 45 % that bends over a twelfth of the band: no factors make up for that.
BENDS = 0.45 * torch.sign(torch.sin(2.0 * torch.pi * 6.0 * FREQUENCY.double() + 0.3))


def with_a_slope(exact, parameters):
    """Beside an error that is known: ln|H| may rise or fall over the band by twice the noise."""
    slope = torch.linspace(-1.0, 1.0, 60, dtype=torch.float64) * exact.base.valid
    return replace(exact, error=joint_error(exact.data, (slope,)))


@pytest.mark.parametrize(
    ("error", "beside"),
    [(0.0, None), (BENDS, None), (0.0, with_a_slope)],
    ids=["a right model", "a wrong one", "one with a known error"],
)
def test_the_posterior_is_the_building_s_and_not_the_decoder_s(mvae, pose, error, beside):
    exact = pose(error)
    found = decoded_posterior(exact, Decoded(mvae, exact.base), 1200, 0, beside=beside)
    mean, sd = by_quadrature(found.likelihood)
    draws = found.draws.theta.flatten(0, 1).numpy()[:, :2]
    # 128 particles and some hundred independent draws more: .06 sd, 4 % of a standard deviation.
    np.testing.assert_allclose((draws.mean(0) - mean) / sd, 0.0, atol=0.25)
    np.testing.assert_allclose(draws.std(0), sd, rtol=0.2)
    # By all rows of the coarse table, whose steps are threefold.
    whole = by_quadrature(exact if beside is None else beside(exact, None))[1]
    np.testing.assert_allclose(sd, whole, rtol=0.3)
    assert found.error < 0.2 * found.decoder_error
    assert (
        128 * 2 * 3
        < found.responses
        <= 128 * (2 * 3 + 1 + 6 + 10 + 3 * len(found.population.levels))
    )


def test_an_error_that_the_data_show_widens_the_posterior(mvae, pose):
    """Or else the second of these cases would ask for nothing."""
    right = by_quadrature(pose())[1]
    exact = pose(BENDS)
    wrong = by_quadrature(exact)[1]
    assert (wrong > 1.3 * right).all()
    assert (by_quadrature(with_a_slope(pose(), None))[1].max() > 1.1 * right).any()
    none = replace(exact, error=exact.error.kept([[0]]))
    assert (by_quadrature(none)[1] < 1.2 * right).all()


def test_without_a_correction_the_decoder_s_own_variance_counts(mvae, pose):
    exact = pose()
    theta = torch.tensor([[1.0, 2.0, 0.02], [0.5, 0.7, 0.02]], dtype=torch.float64)
    variance = NOISE**2 + 0.05**2
    missed = (exact.base.log_frf - LEARNED(place(theta[:, :2]))[:, 1:])[:, exact.base.valid]
    found = Decoded(mvae, exact.base).likelihood(exact).log_density(theta)
    np.testing.assert_allclose(found, -0.5 * (missed**2).sum(1) / variance, rtol=1e-3)


def test_a_correction_of_the_second_order_is_found_and_its_error_is_told():
    generator = torch.Generator().manual_seed(4)

    def drawn(*shape):
        return torch.randn(*shape, generator=generator, dtype=torch.float64)

    spread = torch.tensor([1.0, 0.7, 0.5, 0.1, 0.02, 0.01, 0.01], dtype=torch.float64)
    straight, bent = drawn(7, 5), drawn(5)
    noise = 0.05

    def error(z):
        return 2.0 + z @ straight + (z[:, :1] * z[:, 1:2]) * bent + noise * drawn(len(z), 5)

    z, fresh = 0.4 + spread * drawn(300, 7), 0.4 + spread * drawn(2000, 7)
    fit = fit_correction(z, error(z))
    missed = (error(fresh) - fit(fresh)).square().mean(0)
    # 300 points and some 30 numbers: a tenth of the variance on top.
    np.testing.assert_allclose(missed, noise**2, rtol=0.35)
    np.testing.assert_allclose(fit.left, missed, rtol=0.3)
