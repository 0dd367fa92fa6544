"""The error of a coarse mesh, learned from a finer one, against a still finer one."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch

from femupdate.building import from_document
from femupdate.discrepancy import MeshError, corrected, learn_mesh_error, left_open
from femupdate.discrepancy.fit import about, fit_baseline, settle
from femupdate.dynamics import ConstantDamping, System, reduced_on
from femupdate.effects import structure_of
from femupdate.errors import StructureError
from femupdate.fe import driven_shapes, factorize
from femupdate.inference import COARSE_ERROR, Parameters, likelihood_of, settled
from femupdate.inference.frf_data import frf_data
from femupdate.measurement import Observation
from tests import documents

GRID = np.arange(0.5, 18.0, 0.25)
PRIOR = Parameters.uniform(["theta_1", "theta_2"], [0.5, 0.5], [2.0, 2.0]) + Parameters.uniform(
    ["zeta"], [0.05], [0.05], kind="damping"
)
THETAS = np.array([[1.0, 1.0], [0.6, 1.5], [1.7, 0.8]])


def frame(size):
    slab = {"x": ["A", "B"], "y": ["P", "Q"], "thickness": 0.2}
    x, y, heights = {"A": 0.0, "B": 5.0}, {"P": 0.0, "Q": 6.0}, {"low": 3.4, "high": 2.9}
    known = {"beams": [], "slabs": [slab], "sensors": {"direction": "x", "points": ["A-P", "B-Q"]}}
    made = documents.frame(x, y, heights, size=size, grid=(0.25, 72), ratio=0.05, **known)
    return from_document(made)


def near(structure, others=0):
    """A basis of so many shapes of no meaning, and those at every theta that is asked."""

    def make(*thetas):
        force, rows = structure.rigid_force[:, :1], structure.floor_rows
        shapes = []
        for factor, theta in itertools.product((1.0, 0.9, 1.1), thetas):
            K = structure.stiffness(factor ** np.arange(1, 3) * theta)
            found = driven_shapes(factorize(K), structure.mass, force, rows, GRID[-1])
            shapes.append(found.shapes)
        left, size, _ = np.linalg.svd(np.column_stack(shapes), full_matrices=False)
        first = np.random.default_rng(2).standard_normal((len(left), others))
        basis = np.column_stack([first, left[:, size > 1e-8 * size[0]]])
        root = np.linalg.cholesky(basis.T @ (structure.mass @ basis))
        return reduced_on(structure, np.linalg.solve(root, basis.T).T)

    return make


def frf(reduced, theta):
    system = System(reduced.model, ConstantDamping(), (), ())
    zeta, none = torch.tensor([0.05], dtype=torch.float64), torch.zeros((1, 0))
    return system.frf(torch.from_numpy(theta[None]), zeta, none, torch.from_numpy(GRID))[0].numpy()


def errors_left_open(problem, learned, fitted):
    """One standard deviation of each (c, n), about a fit."""
    open_ = left_open(learned, problem.reduced)
    return open_(problem.data, fitted.system, problem.prior.split(fitted.parameters))


def posed(reduced, data):
    return likelihood_of((data,), System(reduced.model), PRIOR, reduced=reduced)


def amplitudes_at_one(coarse, learned, others=0):
    """The corrected model at theta = 1, the problem of its own |H| with a noise of .1, its fit."""
    theta = np.array([1.0, 1.0])
    reduced = corrected(near(coarse, others)(theta), learned)
    measured = np.abs(frf(reduced, theta))
    noise = np.full(measured.shape, 0.1)
    seen = Observation(GRID, reduced.model.floors, np.log(measured), noise, noise > 0)
    problem = posed(reduced, frf_data(seen, reduced.model.floors, table=COARSE_ERROR))
    base = fit_baseline(problem)[0]
    return reduced, theta, problem, base


@pytest.fixture(scope="module")
def coarse():
    return structure_of(frame(1.5))


@pytest.fixture(scope="module")
def fine():
    return near(structure_of(frame(1.5), 1.0))(*THETAS)


@pytest.fixture(scope="module")
def learned(coarse, fine):
    found = learn_mesh_error(near(coarse)(*THETAS).model, fine, THETAS, GRID[-1])
    return replace(found, share=1.4)


def test_a_mode_that_is_hardly_the_same_on_both_meshes_hardly_counts(coarse, fine):
    """So no limit moves what is learned as modes of two meshes are drawn apart."""
    theta, ours = THETAS[0], near(coarse)(*THETAS).model
    squared, vectors = np.linalg.eigh(fine.model.stiffness(theta))
    mode, learned = squared[0] * np.outer(vectors[:, 0], vectors[:, 0]), []
    limit = np.linalg.eigvalsh(ours.stiffness(theta))[0] * np.exp(2.0 * 0.15)  # .15 in ln f
    for apart in (0.998, 1.002):
        stiffness = fine.model.stiffness_constant + (apart * limit / squared[0] - 1.0) * mode
        drawn = replace(fine, model=replace(fine.model, stiffness_constant=stiffness))
        learned.append(learn_mesh_error(ours, drawn, THETAS, GRID[-1]))
    below, above = learned
    # Where a limit took or left the first mode, a mean moved by .01.
    np.testing.assert_allclose(below.mean, above.mean, atol=1e-3)
    np.testing.assert_allclose(below.sd, above.sd, atol=1e-3)
    assert below.left == pytest.approx(above.left, abs=1e-3)


def test_the_model_comes_nearer_to_a_still_finer_mesh(coarse, learned):
    theta = np.array([0.8, 1.2])  # none of those that it was learned at
    finest = frf(near(structure_of(frame(1.5), 0.7))(theta), theta)
    before = near(coarse)(theta)
    distance = [
        np.abs(np.log(frf(one, theta) / finest)).max()
        for one in (before, corrected(before, learned))
    ]
    assert distance[0] > 0.02
    assert distance[1] < 0.4 * distance[0]


@pytest.mark.parametrize("ratio", [1.0, 2 / 3])
def test_the_middle_between_the_finer_mesh_and_the_limit_is_corrected(ratio):
    """Of an error that falls as the square of the mesh size, which is one at the building's own."""
    seen = MeshError(("cracked_beams@low",), (0.25 - ratio**2,), (0.1,), 0.0, 0.0, 0.0)
    coarse, half = seen.of_mesh(ratio), replace(seen, mean=(-0.75,)).of_half()
    assert ratio**2 + coarse.share * coarse.mean[0] == pytest.approx(0.125)
    assert 0.25 + half.share * half.mean[0] == pytest.approx(0.125)
    for one in (coarse, half):  # .6 of the way to both
        assert one.share_sd * one.mean[0] == pytest.approx(-0.6 * 0.125)
    assert half.sd[0] == pytest.approx(0.1 / 3)


def test_a_coarse_mesh_is_a_stiff_one(learned):
    """A slab bends more softly the finer it is meshed."""
    slab = [m for name, m in zip(learned.labels, learned.mean, strict=True) if "slab" in name]
    assert max(slab) < 0.0
    assert min(learned.sd) > 0.0


def test_a_mesh_that_errs_by_a_tenth_is_compared_and_called_coarse(coarse):
    same = near(coarse)(*THETAS)
    softer = replace(same.model, stiffness_terms=0.81 * same.model.stiffness_terms)
    found = learn_mesh_error(same.model, replace(same, model=softer), THETAS, GRID[-1])
    assert found.moved == pytest.approx(0.095)  # half of .19
    assert "moves frequencies by 9.5 %" in found.too_coarse
    assert replace(found, moved=0.02).too_coarse == ""


def test_meshes_without_a_common_mode_are_refused(coarse, fine):
    with pytest.raises(StructureError, match=r"no mode below 0\.1 Hz .* write a smaller"):
        learn_mesh_error(near(coarse)(*THETAS).model, fine, THETAS[:1], GRID[0] / 5)


def test_what_is_left_open_widens_the_intervals(coarse, learned):
    theta = np.array([1.0, 1.0])
    reduced = corrected(near(coarse)(theta), learned)
    measured = frf(reduced, theta)
    noise = np.full(measured.shape, 0.01)
    shown = np.log(np.abs(measured)), noise, noise > 0, np.angle(measured)
    seen = Observation(GRID, reduced.model.floors, *shown, None, 0.25, "made", ())
    data = frf_data(seen, reduced.model.floors, table=COARSE_ERROR)
    problem = posed(reduced, data)
    base = fit_baseline(problem)[0]
    left = replace(problem, known=left_open(learned, reduced))
    open_ = settle(about(left, base), base)
    np.testing.assert_allclose(base.theta()[0], theta, rtol=1e-3)
    np.testing.assert_allclose(open_.theta()[0], theta, rtol=1e-3)
    assert (open_.theta()[1] > 1.2 * base.theta()[1]).all()
    # Both unknowns are far within their limits, so that the estimates are linear in the errors.
    rng = np.random.default_rng(6)
    S = errors_left_open(problem, learned, base).numpy()
    errors = rng.standard_normal((16000, S.shape[1])) + rng.standard_normal((16000, len(S))) @ S
    error, row = open_.likelihood.error, open_.likelihood.row
    white = error.whiten(torch.from_numpy(errors), row).numpy()
    estimates = np.linalg.lstsq(open_.jacobian.numpy(), white.T, rcond=None)[0].T
    # Intervals are no narrower than these errors ask for, and wider by 4 % at most.
    ratio = estimates.std(axis=0) / (open_.theta()[1] / theta)
    assert (ratio > 0.96).all()
    assert (ratio < 1.01).all()
    # No worse than by ordinary least squares (Gauss, Markov, Aitken).
    # The first rows are the points; those behind are errors that a model alone has none of.
    plain = np.linalg.lstsq(base.jacobian[: len(errors.T)].numpy(), errors.T, rcond=None)[0]
    assert (estimates.std(axis=0) < plain.std(axis=1)).all()


def test_errors_of_members_are_those_of_small_steps(coarse, learned):
    """By differences of ln|H|, whether complex responses or their logs alone are made."""
    reduced, theta, problem, base = amplitudes_at_one(coarse, learned, others=150)
    count, known = len(learned.steps), problem.prior.split(base.parameters)
    alone = errors_left_open(problem, learned, base)
    logs = problem.data[0].as_logs(base.system, modes=None)
    fast = left_open(learned, reduced)((logs,), base.system, known)
    np.testing.assert_allclose(fast, alone, atol=2e-3)  # what can only crack is reflected
    part, here = 1e-3, np.log(np.abs(frf(reduced, theta)))
    terms = [reduced.terms(one).stiffness for one in learned.placed]
    for step, told in zip(learned.steps, alone[:count], strict=True):
        stiffness = reduced.model.stiffness_terms.copy()
        for size, own in zip(step, terms, strict=True):
            for story, matrix, _ in own:
                stiffness[story] += part * size * matrix.numpy()
        moved = replace(reduced, model=replace(reduced.model, stiffness_terms=stiffness))
        change = (np.log(np.abs(frf(moved, theta))) - here) / part / 0.1
        np.testing.assert_allclose(told.numpy().reshape(2, -1), change, atol=0.03)


def test_errors_of_members_far_beyond_the_noise_leave_factors_right(coarse, learned):
    """On straight lines from no error factors would make up for them."""
    theta, away = np.array([0.9, 1.1]), []
    reduced = corrected(near(coarse)(theta), learned)
    system, open_ = System(reduced.model, ConstantDamping()), left_open(learned, reduced)
    for seed in (4, 5):
        errors = torch.from_numpy(np.random.default_rng(seed).standard_normal(len(learned.steps)))
        true = open_.held(2.0 * errors, system)[1]
        measured = np.abs(frf(replace(reduced, model=true.model), theta))
        noise = np.full(measured.shape, 0.003)
        seen = Observation(GRID, reduced.model.floors, np.log(measured), noise, noise > 0)
        data = frf_data(seen, reduced.model.floors, table=COARSE_ERROR)
        found = settled(replace(likelihood_of((data,), system, PRIOR), known=open_), 1)
        middle = PRIOR.from_normal(found.found.z[:1])
        slope = (PRIOR.from_normal(found.found.z[:1] + 1e-5) - middle)[0, :2] / 1e-5
        sd = slope * torch.linalg.inv(found.found.precision[0]).diagonal().sqrt()
        away.append((middle[0, :2] - torch.from_numpy(theta)) / sd)
        assert (sd < 0.1).all()
        # Sought once more with factors, errors stay where they are.
        again = found.likelihood.holding_likeliest(middle).known.likeliest
        torch.testing.assert_close(again, found.likelihood.known.likeliest, rtol=0.0, atol=0.02)
    # The errors are twice as large as stated; by straight lines from none it is 9.2 and 3.2.
    assert (torch.stack(away).square().mean(0).sqrt() < 4.0).all()
