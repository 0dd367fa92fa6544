"""The likelihoods against hand calculation and chi-square."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.stats import chi2, kstest

from femupdate.dynamics import System
from femupdate.errors import SurrogateError
from femupdate.inference import (
    STATED,
    LatentLikelihood,
    Parameter,
    Parameters,
    base_logs,
    likelihood_of,
)
from femupdate.inference.frf_data import log_responses
from femupdate.measurement import Observation, select_floors
from femupdate.surrogate import Mvae, NetworkSizes, Surrogate, SurrogateInfo
from tests.documents import reduced_stick
from tests.helpers import tensor

FLOORS = ("2F", "3F", "RF")
MASS, SPRING = np.array([3.0, 2.0, 1.5]), np.array([4000.0, 3000.0, 1500.0])
FREQUENCY = 0.1 * np.arange(1, 121)
TRUTH, ZETA = np.array([1.3, 0.7, 1.1]), 0.03


MODEL = reduced_stick(MASS, SPRING)


def exact_log_frf(theta, zeta):
    """ln|H| (3, k) by linear solutions with modal damping."""
    k = np.append(theta * SPRING, 0.0)
    K = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    root = np.sqrt(MASS)
    squared, modes = np.linalg.eigh(K / np.outer(root, root))
    C = modes @ np.diag(2.0 * zeta * np.sqrt(squared)) @ modes.T * np.outer(root, root)
    rows = [
        1.0 + w**2 * np.linalg.solve(K + 1j * w * C - w**2 * np.diag(MASS), MASS)
        for w in 2.0 * np.pi * FREQUENCY
    ]
    return np.log(np.abs(np.array(rows).T))


def observation(noise_sd, seed=0, floors=FLOORS, **others):
    rng = np.random.default_rng(seed)
    rows = [FLOORS.index(name) for name in floors]
    clean, sd = exact_log_frf(TRUTH, ZETA)[rows], np.broadcast_to(noise_sd, (3, 120))[rows]
    values = clean + sd * rng.normal(size=clean.shape)
    valid = others.pop("valid", np.ones(clean.shape, dtype=bool))
    return Observation(FREQUENCY, floors, values, sd, valid, **others)


def damped(theta, zeta=ZETA):
    """Parameters (n, 4) of factors (n, 3), all with one damping ratio."""
    return torch.cat([tensor(theta), torch.full((len(theta), 1), zeta, dtype=torch.float64)], dim=1)


def likelihood_by(system, measured, **options):
    """Of FRFs that are taken at their word."""
    factors = Parameters.uniform(("a", "b", "c"), [0.33] * 3, [3.0] * 3)
    prior = factors + Parameters((Parameter(name="zeta", kind="damping", lower=0.01, upper=0.1),))
    data = base_logs(measured, system, table=STATED, **options)
    return likelihood_of((data,), system, prior)


def squares(likelihood, parameters):
    """Sum of squared residuals (n,) of all points."""
    return likelihood.raw(parameters).square().sum(dim=1)


def test_misfit_by_hand():
    """Several floors in another order, each point with its own noise."""
    rng = np.random.default_rng(1)
    sd = rng.uniform(0.1, 0.4, (3, 120))
    measured = observation(sd, floors=("RF", "2F"))
    theta = np.array([[0.8, 1.4, 2.2], [1.3, 0.7, 1.1]])
    found = likelihood_by(System(MODEL), measured)
    for row, one in enumerate(theta):
        expected = exact_log_frf(one, ZETA)[[2, 0]]
        whitened = (measured.log_frf - expected) / sd[[2, 0]]
        assert float(found.misfit(found.raw(damped(theta)))[row]) == pytest.approx(
            (whitened**2).mean(), rel=1e-9
        )
        assert float(found(damped(theta))[row]) == pytest.approx(
            -0.5 * (whitened**2).sum(), rel=1e-9
        )
        ratios = tensor([ZETA, ZETA])
        predicted = log_responses(found.base, found.system, tensor(theta), ratios)[row]
        np.testing.assert_allclose(predicted, expected, atol=1e-9)


def test_points_that_are_not_valid_do_not_count():
    valid = np.ones((3, 120), dtype=bool)
    valid[1, 30:50] = valid[2, :5] = False
    measured = observation(0.2, valid=valid)
    spoiled = np.where(valid, measured.log_frf, np.nan)
    noise = np.where(valid, 0.2, np.nan)
    noise[1, 30], spoiled[1, 31] = 0.0, -np.inf
    other = Observation(FREQUENCY, FLOORS, spoiled, noise, valid)
    theta = damped([TRUTH])
    one = likelihood_by(System(MODEL), measured)
    two = likelihood_by(System(MODEL), other)
    assert one.base.points == two.base.points == 360 - 25
    assert float(one(theta)) == float(two(theta))
    whitened = ((measured.log_frf - exact_log_frf(TRUTH, ZETA)) / 0.2)[valid]
    assert float(squares(one, theta)) == pytest.approx((whitened**2).sum(), rel=1e-9)


def test_what_is_explained_is_variation_not_drift_that_seems_to_have_no_noise():
    """The records of other buildings drift as this one's own do, well below the first mode."""
    sd = np.full((3, 120), 0.05)
    sd[:, 0] = 1e-4
    right, flat = observation(sd), replace(observation(sd), log_frf=np.zeros((3, 120)))
    right.log_frf[:, 0] = flat.log_frf[:, 0] = 0.5
    sides = (likelihood_by(System(MODEL), seen) for seen in (right, flat))
    shares = [side.explained(side.raw(damped([TRUTH]))) for side in sides]
    assert shares[0] > 0.95
    assert shares[1] < 0.0


def test_misfit_of_the_truth_is_chi_square():
    """For simulated noise, with as many degrees of freedom as there are valid points."""
    misfits = []
    for seed in range(200):
        likelihood = likelihood_by(System(MODEL), observation(np.linspace(0.05, 0.5, 120), seed))
        assert likelihood.base.points == 360
        misfits.append(float(squares(likelihood, damped([TRUTH]))))
    assert kstest(misfits, chi2(360).cdf).pvalue > 0.01


@pytest.fixture(scope="module")
def surrogate():
    """Small networks with random weights: what is checked is how they are asked."""
    torch.manual_seed(0)
    sizes = NetworkSizes(
        3, 120, 3, True, 4, floor_features=8, width=16, parameter_width=16, decoder_width=16
    )
    mvae = Mvae(sizes)
    mvae.lower.fill_(0.33)
    mvae.upper.fill_(3.0)
    for parameter in mvae.parameters():
        torch.nn.init.normal_(parameter, std=0.2)
    return Surrogate(mvae.eval(), SurrogateInfo("toy", "", FLOORS, 0.2, "0", {}, {}))


def test_latent_likelihood_is_the_integral_of_its_gaussians(surrogate):
    """By completing the square with numpy, component by component."""
    measured = select_floors(observation(0.2), ["3F", "RF"])
    likelihood = LatentLikelihood(surrogate, System(MODEL), measured)
    theta = tensor(np.random.default_rng(0).uniform(0.4, 2.5, (6, 3)))
    found = likelihood(theta)
    with torch.no_grad():
        assert likelihood.visibility.floors.tolist() == [[0.0, 1.0, 1.0]]
        z = surrogate.mvae.encode_parameters(theta.float()).double().numpy()
    x = likelihood.found
    assert x.mean.shape[1] == 4  # three stiffness factors and the damping ratio
    means = np.pad(z, ((0, 0), (0, 1)))
    # A theta is a point of z; a width of a thousandth of the narrowest posterior stands for it.
    inverse = np.diag([1e10, 1e10, 1e10, 1.0])
    expected = []
    for b in means:
        parts = []
        for weight, a, A in zip(x.log_weight, x.mean.numpy(), x.precision.numpy(), strict=True):
            precision = A + inverse - np.eye(4)
            linear = A @ a + inverse @ b
            square = linear @ np.linalg.solve(precision, linear) - a @ A @ a - b @ inverse @ b
            logs = [np.linalg.slogdet(matrix)[1] for matrix in (A, inverse, precision)]
            parts.append(float(weight) + 0.5 * (square + logs[0] + logs[1] - logs[2]))
        expected.append(np.logaddexp.reduce(parts))
    np.testing.assert_allclose(found.numpy(), expected, rtol=1e-4, atol=2e-3)
    assert not found.requires_grad


def test_an_observation_on_another_grid_is_refused(surrogate):
    measured = observation(0.2)
    shorter = Observation(
        FREQUENCY[:100],
        FLOORS,
        measured.log_frf[:, :100],
        measured.noise_sd[:, :100],
        measured.valid[:, :100],
    )
    with pytest.raises(SurrogateError, match=r"knows 120 frequencies, .* has 100"):
        LatentLikelihood(surrogate, System(MODEL), shorter)
