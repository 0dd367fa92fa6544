"""Likelihood of identified modes, against closed forms and a posterior by brute force."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.stats import qmc

from femupdate.building import load_building, shear_operators
from femupdate.dynamics import ConstantDamping, System
from femupdate.dynamics import lumped as reduce
from femupdate.effects import structure_of
from femupdate.inference import (
    STATED,
    ModalErrors,
    Parameter,
    Parameters,
    best_of_prior,
    draws_about,
    found_from,
    likelihood_of,
    settled,
)
from femupdate.inference.mode_data import mode_data
from femupdate.measurement import IdentifiedModes
from tests.documents import reduced_stick

TRUTH = torch.tensor([[1.3, 0.8, 1.1, 0.7, 0.02]], dtype=torch.float64)
FLOORS = ("2F", "3F", "4F", "RF")


@pytest.fixture(scope="module")
def lumped():
    return shear_operators(load_building("shear_4dof"))


@pytest.fixture(scope="module")
def system():
    return System(reduce(structure_of(load_building("shear_4dof"))).model, ConstantDamping())


def chain(theta, lumped):
    """Frequencies (n, 4), Hz, and shapes (n, 4, 4), a column each, without the package's modes."""
    terms, mass = lumped
    root = np.diag(mass) ** -0.5
    stiffness = np.einsum("np,pij->nij", theta, terms)
    squared, vectors = np.linalg.eigh(root[:, None] * stiffness * root)
    return np.sqrt(squared) / (2.0 * np.pi), root[:, None] * vectors


FACTORS = Parameters.uniform(("a", "b", "c", "d"), [0.33] * 4, [3.0] * 4)


def zeta(low=0.01, high=0.1):
    return Parameters((Parameter(name="zeta", kind="damping", lower=low, upper=high),))


def at_its_word(data):
    """The same as if the errors of its file were all that there is."""
    return replace(data, table=STATED, wild=np.inf)


def likelihood_by(system, *modes, errors=None, prior=None, **options):
    """Of files of modes that are taken at their word."""
    data = [
        at_its_word(mode_data(one, system, errors or ModalErrors(), **options)) for one in modes
    ]
    return likelihood_of(data, system, prior or FACTORS + zeta())


def paired(likelihood, parameters):
    """The modes of the model that belong to those of the first file."""
    own, (data, *_) = likelihood.prior.split(parameters), likelihood.data
    return data.paired(data.predicted(likelihood.system, own.theta, own.zeta, own.sizes))


def checked(likelihood):
    """Squares at the truth and independent figures, by the names of what is checked."""
    found = likelihood.checked(likelihood.raw(TRUTH), 1)
    return {name: (float(squares), float(count)) for name, squares, count in found}


def identified(frequency, shape, *, damping=np.nan, **changed):
    """Modes with shapes (f, m), without standard deviations unless given."""
    count, floors = len(frequency), shape.shape[0]
    blank = np.full(count, np.nan)
    given = {
        "names": tuple("1234"[:count]),
        "frequency_hz": np.asarray(frequency),
        "frequency_sd_hz": blank,
        "damping": np.full(count, damping),
        "damping_sd": blank,
        "floors": FLOORS[:floors],
        "shape": shape.T,
        "shape_sd": np.full((count, floors), np.nan),
    }
    return IdentifiedModes(**{**given, **changed})


@pytest.fixture(scope="module")
def exact(lumped):
    frequency, shape = chain(TRUTH[:, :4].numpy(), lumped)
    return frequency[0], shape[0]


@pytest.mark.parametrize("floors", [0, 4])
def test_true_modes_leave_nothing_in_any_scale_and_order(system, exact, floors):
    frequency, shape = exact
    order, scale = [2, 3, 1], np.array([-7.0, 2.0, -1.0])
    modes = identified(frequency[order], shape[:floors, order] * scale, damping=0.02)
    likelihood = likelihood_by(system, modes)
    assert float(likelihood(TRUTH)) == pytest.approx(0.0, abs=1e-20)
    found = paired(likelihood, TRUTH)[0]
    np.testing.assert_allclose(found[:, 0].exp(), 2.0 * np.pi * frequency[order], rtol=1e-9)
    np.testing.assert_allclose(found[:, 2:], modes.shape, rtol=1e-9, atol=1e-9)


def test_residuals_are_those_written_by_hand(system, lumped, exact):
    frequency, shape = exact
    modes = identified(
        1.03 * frequency[:2],
        shape[:, :2] + [[0.0, 0.0], [0.05, 0.0], [0.0, 0.0], [0.0, 0.1]],
        damping=0.025,
        frequency_sd_hz=np.array([0.02, np.nan]),
    )
    errors = ModalErrors(model_frequency=0.02, shape=0.05)
    found = checked(likelihood_by(system, modes, errors=errors))
    relative = np.array([0.02 / modes.frequency_hz[0], errors.frequency])
    of_frequency = (np.log(1.03) ** 2 / (relative**2 + 0.02**2)).sum()
    of_damping = 2 * (0.005 / (0.025 * np.hypot(0.25, 0.2))) ** 2
    # sd .05 of the largest component; a shape leaves y'y (1 - MAC).
    sd = 0.05 * np.abs(modes.shape).max(axis=1)
    cosine = np.einsum("mf,fm->m", modes.shape, shape[:, :2]) / np.linalg.norm(shape[:, :2], axis=0)
    of_shape = (((modes.shape**2).sum(1) - cosine**2) / sd**2).sum()
    assert list(found) == ["frequencies", "damping ratios", "shapes"]
    squares, freedom = zip(*found.values(), strict=True)
    np.testing.assert_allclose(squares, [of_frequency, of_damping, of_shape], rtol=1e-9)
    assert freedom == (2.0, 2.0, 6.0)


def test_gradient_is_that_of_differences(system, exact):
    frequency, shape = exact
    likelihood = likelihood_by(system, identified(1.05 * frequency, shape, damping=0.03))
    point = TRUTH.clone().requires_grad_()
    (slope,) = torch.autograd.grad(likelihood(point).sum(), point)
    step = 1e-6 * torch.eye(5, dtype=torch.float64)
    both = likelihood(TRUTH + step) - likelihood(TRUTH - step)
    np.testing.assert_allclose(slope[0], both / 2e-6, rtol=1e-5)


SD = 0.08  # of ln f


def brute_force(lumped, modes):
    """Points of the prior and log likelihood of frequencies and shapes, by numpy alone."""
    unit = qmc.Sobol(4, seed=11).random_base2(18)
    theta = 0.33 + 2.67 * unit
    value = np.zeros(len(theta))
    for rows in np.array_split(np.arange(len(theta)), 16):
        frequency, shape = chain(theta[rows], lumped)
        away = np.log(frequency / modes.frequency_hz) / SD
        value[rows] = -0.5 * (away**2).sum(axis=1)
        seen = shape[:, [0, 3]]
        y = modes.shape
        cosine = np.einsum("mf,nfm->nm", y, seen) / np.linalg.norm(seen, axis=1)
        sd = 0.3 * np.abs(y).max(axis=1)
        value[rows] -= 0.5 * (((y**2).sum(1) - cosine**2) / sd**2).sum(axis=1)
    return theta, value


def test_posterior_is_that_by_brute_force(system, lumped, exact):
    """Four frequencies and shapes at two floors: solutions of different weights."""
    frequency, shape = exact
    noise = np.random.default_rng(4).normal(size=4)
    modes = identified(frequency * np.exp(0.5 * SD * noise), shape[[0, 3]], floors=("2F", "RF"))
    theta, value = brute_force(lumped, modes)
    weight = np.exp(value - value.max())
    weight /= weight.sum()
    assert 1.0 / (weight**2).sum() > 3000.0
    errors = ModalErrors(model_frequency=SD, frequency=1e-9, shape=0.3)
    prior = FACTORS + zeta(0.02, 0.02)
    likelihood = likelihood_by(system, modes, errors=errors, prior=prior)
    starts, _ = best_of_prior(prior, likelihood, 1)
    maxima = found_from(prior, likelihood.residuals, starts)
    drawn = draws_about(prior, likelihood, maxima, 6000, 2)
    assert drawn is not None
    assert drawn.effective > 1000.0
    found = drawn.resampled(6000, 3).theta[:, :4].numpy()
    evidence = np.log(np.exp(value - value.max()).mean()) + value.max()
    assert drawn.log_evidence == pytest.approx(evidence, abs=0.05)
    mean = weight @ theta
    sd = np.sqrt(weight @ (theta - mean) ** 2)
    np.testing.assert_allclose(found.mean(axis=0), mean, atol=0.1 * sd.min())
    ratio = found.std(axis=0) / sd
    assert ((ratio > 0.95) & (ratio < 1.10)).all()
    # Story 1 softer or stiffer than story 3 tells the solutions apart.
    heavy = float(weight[theta[:, 0] > theta[:, 2]].sum())
    assert 0.1 < heavy < 0.9
    assert abs(np.mean(found[:, 0] > found[:, 2]) - heavy) < 0.03


def test_few_draws_hold_every_solution(system, lumped):
    """Four frequencies of a chain fit several chains; 500 draws know the evidence as 20,000 do."""
    frequency, _ = chain(np.array([[1.9, 1.15, 0.44, 1.07]]), lumped)
    one = identified(frequency[0], np.zeros((0, 4)), damping=0.02)
    data = at_its_word(mode_data(one, system, ModalErrors(model_frequency=0.003, frequency=0.001)))
    found = settled(likelihood_of((data,), system, FACTORS + zeta()), 0)
    prior, maxima = found.likelihood.prior, factors_of(found)
    assert len(maxima) > 2
    many = draws_about(prior, found.likelihood, found.found, 20_000, 0)
    share = shares(many, maxima)
    for seed in range(1, 6):
        few = draws_about(prior, found.likelihood, found.found, 500, seed)
        away = few.log_evidence - many.log_evidence
        assert abs(away) < 4.0 * few.log_evidence_error + many.log_evidence_error
        np.testing.assert_allclose(shares(few, maxima), share, atol=0.09)


def test_wide_errors_of_the_model_weigh_as_much_as_narrow_ones():
    """One frequency meets one factor by any error; the evidence is a sum over a fine grid."""
    frequency, count = np.array([1.7]), 20_001  # nine points a standard deviation
    system = System(reduced_stick([1e5], [1e7]), ConstantDamping())
    modes = identified(frequency, np.zeros((0, 1)), damping=0.02, frequency_sd_hz=5e-4 * frequency)
    prior = Parameters.uniform(("a",), [0.5], [3.0]) + zeta(0.02, 0.02)
    whole = likelihood_of((mode_data(modes, system, ModalErrors()),), system, prior)
    grid = torch.full((count, 2), 0.02, dtype=torch.float64)
    grid[:, 0] = torch.linspace(0.5, 3.0, count, dtype=torch.float64)
    value = torch.cat([whole(some) for some in grid.split(5000)])
    exact, shares = float(value.logsumexp(0)) - np.log(count), value.softmax(0)
    sd = float(shares @ (grid[:, 0] - shares @ grid[:, 0]) ** 2) ** 0.5
    found = settled(whole, 0)
    drawn = draws_about(found.likelihood.prior, found.likelihood, found.found, 4000, 1)
    assert drawn.log_evidence == pytest.approx(exact, abs=4.0 * drawn.log_evidence_error + 0.01)
    assert drawn.resampled(4000, 2).theta[:, 0].std() == pytest.approx(sd, rel=0.1)


def factors_of(found):
    """Stiffness factors (s, 4) of the maxima."""
    return found.likelihood.prior.from_normal(found.found.z)[:, :4]


def shares(draws, maxima):
    """Of the draws' weight that lies nearest to every maximum (s, 4)."""
    nearest = torch.cdist(draws.points[:, :4].log(), maxima.log()).argmin(1)
    weight = draws.log_weight.softmax(0)
    return [float(weight[nearest == k].sum()) for k in range(len(maxima))]


def test_an_error_of_the_model_costs_every_figure_that_is_known(system, exact):
    """Modes without a residual, whose scales are free: half of ln of variances, over the stated."""
    frequency, shape = exact
    frequency, sd = frequency[:2], 0.01 * frequency[:2]
    modes = identified(frequency, shape[:3, :2], damping=0.02, frequency_sd_hz=sd)
    data = mode_data(modes, system, ModalErrors())
    (part,) = likelihood_of((data,), system, FACTORS + zeta()).error.parts
    found = part.log_densities(torch.zeros(1, data.residuals, dtype=torch.float64))[0]
    size = np.array([level.own for level in part.levels])
    table = data.table
    prior = np.array([table.none, *((1.0 - table.none) * np.array(table.likely))])
    # Two frequencies, two damping ratios, and two components beyond the scale of each shape.
    figures = ((1.0, 0.01, 2), (20.0, np.hypot(0.25, 0.2), 2), (2.0, 0.03, 4))
    cost = sum(0.5 * count * np.log1p((over * size / sd) ** 2) for over, sd, count in figures)
    np.testing.assert_allclose(found - found[0], np.log(prior / prior[0]) - cost, rtol=1e-6)


def test_modes_of_a_right_model_are_taken_at_their_word_and_of_a_wrong_one_not(system, lumped):
    """Frequencies to .1 %, shapes to 1 %; a floor has a fifth more mass than the model."""
    rng, sizes = np.random.default_rng(7), []
    for mass in (1.0, 1.2):
        other = lumped[0], lumped[1] * np.array([1.0, mass, 1.0, 1.0])
        (frequency,), (shape,) = chain(TRUTH[:, :4].numpy(), other)
        shape = shape / np.abs(shape).max(0) + 0.01 * rng.normal(size=(4, 4))
        frequency, sd = frequency * np.exp(0.001 * rng.normal(size=4)), np.full((4, 4), 0.01)
        modes = identified(frequency, shape, frequency_sd_hz=0.001 * frequency, shape_sd=sd)
        found = settled(
            likelihood_of((mode_data(modes, system, ModalErrors()),), system, FACTORS + zeta()), 0
        )
        sizes.append(found.likelihood.error.parts[0].levels[found.likelihood.row[0]].own)
    assert sizes[0] == 0.0
    assert 0.005 < sizes[1] < 0.05
