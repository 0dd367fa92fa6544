"""Reduced models against the full ones, and shear buildings against hand calculation."""

import numpy as np
import pytest
import torch
from femupdate.benchmarks.modal_frf import complex_frf, log_frf
from scipy.linalg import eigh
from scipy.sparse import csc_matrix

from femupdate.dynamics import (
    ConstantDamping,
    RayleighDamping,
    ReductionTarget,
    System,
    driven_system,
    reduce_structure,
)
from femupdate.dynamics.reduction import CHOOSE
from femupdate.dynamics.snapshots import TOP
from femupdate.errors import StructureError
from femupdate.fe import static_displacement
from femupdate.progress import SILENT
from femupdate.seeds import spawn

GRID = 0.2 * np.arange(1, 151)
UNSEEN = np.array([[0.41, 2.3], [2.7, 0.9], [1.0, 1.0]])


def target(tolerance=0.02, zeta=0.01, samples=16, seed=0, stories=2):
    return ReductionTarget(
        np.full(stories, 1 / 3), np.full(stories, 3.0), GRID, zeta, tolerance, samples, seed
    )


def reduce(frame, aim, progress=SILENT):
    return reduce_structure(frame.structure, aim, progress=progress)


@pytest.fixture(scope="module")
def frame(small_frame):
    return small_frame(2.0)


@pytest.fixture(scope="module")
def reduced(frame):
    return reduce(frame, target())


def mean_rows(frame):
    """(f, n_free) mean displacement of each floor's sensors along x, written out."""
    rows = np.zeros((2, frame.operators.dof))
    for row, nodes in zip(rows, frame.mesh.floor_nodes.values(), strict=True):
        assert len(nodes) == 2
        row[6 * nodes[0]] = row[6 * nodes[1]] = 0.5
    return rows[:, frame.operators.free]


def dense(frame, theta):
    operators = frame.operators
    return operators.stiffness(theta).toarray(), operators.mass.toarray()


def full_log_frf(frame, theta, zeta):
    """ln|H| (f, k) from all modes of the full model, by a dense solver."""
    K, M = dense(frame, theta)
    squared, modes = eigh(K, M)
    omega, w = np.sqrt(squared)[:, None], 2.0 * np.pi * GRID
    participation = modes.T @ frame.operators.inertia(0)
    response = participation[:, None] / (omega**2 - w**2 + 2j * zeta * omega * w)
    return np.log(np.abs(1.0 + w**2 * (mean_rows(frame) @ modes @ response)))


def reduced_log_frf(model, theta, zeta):
    data = System(model).modal_data(torch.as_tensor(theta)[None])
    zetas = torch.full((1,), zeta, dtype=torch.float64)
    return log_frf(data, torch.from_numpy(GRID), ConstantDamping(), zetas)[0].numpy()


@pytest.mark.parametrize("zeta", [0.01, 0.02, 0.05])
@pytest.mark.parametrize("theta", UNSEEN, ids=str)
def test_reduced_responses_follow_the_full_model(frame, reduced, theta, zeta):
    error = reduced_log_frf(reduced.model, theta, zeta) - full_log_frf(frame, theta, zeta)
    assert np.sqrt((error**2).mean()) <= 0.02


def test_the_error_reported_is_that_of_the_checks(frame, reduced):
    """The reference of the reduction itself, modes below a frequency and a static correction."""
    rng = np.random.default_rng(spawn(0, 1)[0])  # the checks have a stream of their own
    # Others, drawn first, choose the number of shapes.
    unseen = 1 / 3 + (3.0 - 1 / 3) * rng.random((CHOOSE + reduced.checks, 2))
    unseen = unseen[CHOOSE:]
    errors = [
        reduced_log_frf(reduced.model, theta, 0.01) - full_log_frf(frame, theta, 0.01)
        for theta in unseen
    ]
    assert reduced.checks == 29
    each = np.sqrt(np.mean(np.square(errors), axis=(1, 2)))
    assert reduced.worst_error == pytest.approx(each.max(), rel=0.25)
    # The reference has no damping in the modes above 1.8 times the top: .0002 against .0003.
    assert reduced.rms_error == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=0.35)
    assert reduced.rms_error <= 0.02


@pytest.mark.parametrize("theta", UNSEEN[:2], ids=str)
def test_direct_solution_with_rayleigh_damping(harmonic, frame, reduced, theta):
    law = RayleighDamping(0.03, (3.0, 25.0))
    K, M = dense(frame, theta)
    low, high = 6.0 * np.pi, 50.0 * np.pi
    C = csc_matrix(0.06 * low * high / (low + high) * M + 0.06 / (low + high) * K)
    compare_with_direct(harmonic, frame, reduced.model, theta, C, law, 0.0)


def compare_with_direct(harmonic, frame, model, theta, C, law, zeta):
    frequency = np.array([0.7, 4.3, 9.1, 17.7])
    load = frame.operators.expand(frame.operators.inertia(0))
    u = np.array(harmonic(frame.operators, theta, frequency, load, C))[:, frame.operators.free]
    expected = 1.0 + (2.0 * np.pi * frequency) ** 2 * (mean_rows(frame) @ u.T)
    data = System(model).modal_data(torch.from_numpy(theta)[None])
    zetas = torch.full((1,), zeta, dtype=torch.float64)
    found = complex_frf(data, torch.from_numpy(frequency), law, zetas)[0].numpy()
    # The tolerance of the reduction, at single frequencies up to a few times its rms.
    np.testing.assert_allclose(found, expected, rtol=0.05)


def test_reduced_frequencies_bound_the_full_ones_from_above(frame, reduced):
    """Rayleigh and Ritz: true of any subspace and any theta, if K is projected as M is."""
    for theta in [np.array([40.0, 0.02]), *UNSEEN]:
        full = eigh(*dense(frame, theta), eigvals_only=True)[: reduced.model.size]
        small = np.linalg.eigvalsh(reduced.model.stiffness(theta))
        assert (small >= full * (1.0 - 1e-9)).all()
    np.testing.assert_allclose(small[:3], full[:3], rtol=2e-3)  # inside the prior they are close


def test_the_stiffness_is_affine_in_theta(frame, reduced):
    """V^T K(theta) V for any theta, inside the prior or not; V^T M V = I as parts' modes are."""
    V, model = reduced.reduced.basis, reduced.model
    np.testing.assert_allclose(V.T @ (frame.operators.mass @ V), np.eye(V.shape[1]), atol=1e-9)
    for theta in ([0.4, 2.0], [7.0, 0.0], [0.0, 0.0]):
        expected = V.T @ (frame.operators.stiffness(np.array(theta)) @ V)
        found = model.stiffness(np.array(theta))
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max() + 1e-9)
        np.testing.assert_array_equal(found, found.T)
    np.testing.assert_allclose(model.excitation, V.T @ frame.operators.inertia(0), atol=1e-9)
    full = frame.operators.expand(V).reshape(-1, 6, V.shape[1])
    np.testing.assert_allclose(model.node_shapes, full[:, :3], rtol=1e-5, atol=1e-7)


def theta_errors(frame, model, count, seed):
    """rms over floors and grid of the difference in ln|H|, at theta that nothing else has seen."""
    thetas = 1 / 3 + (3.0 - 1 / 3) * np.random.default_rng(seed).random((count, 2))
    return np.array(
        [
            np.sqrt(np.mean((reduced_log_frf(model, t, 0.01) - full_log_frf(frame, t, 0.01)) ** 2))
            for t in thetas
        ]
    )


@pytest.mark.parametrize("tolerance", [0.1, 0.02, 0.002])
def test_the_estimate_holds_at_theta_nobody_has_seen(frame, tolerance):
    """rms within a factor of two and 0.002; the worst check is exceeded as rarely as is said."""
    result = reduce(frame, target(tolerance=tolerance))
    assert result.share == pytest.approx(0.902, abs=5e-4)
    errors = theta_errors(frame, result.model, 60, seed=77)
    true = np.sqrt(np.mean(errors**2))
    # The reference of the checks itself is good to a few thousandths in soft corners of the box.
    assert 0.5 * true < result.rms_error < 2.0 * true + 2e-3
    assert np.mean(errors <= result.worst_error) >= result.share - 0.06  # 1.5 binomial errors
    assert result.rms_error <= result.worst_error


def test_a_tolerance_that_cannot_be_met(frame):
    with pytest.raises(StructureError, match=r"still differs .* raise reduction\.tolerance"):
        reduce(frame, target(tolerance=1e-9, samples=1))


@pytest.mark.parametrize("zeta", [0.0066, 0.03])
def test_the_full_model_at_one_theta_is_that_of_all_its_modes(frame, zeta):
    """What a reduced model is judged by, up to the top of the grid."""
    theta = np.array([0.4, 2.0])
    found = driven_system(
        frame.structure, (), theta, np.zeros(0), TOP * GRID[-1], ConstantDamping()
    )
    ratio, none = torch.tensor([zeta], dtype=torch.float64), torch.zeros((1, 0)).double()
    frf = found.system.frf(none, ratio, none, torch.from_numpy(GRID))[0]
    error = frf.abs().log().numpy() - full_log_frf(frame, theta, zeta)
    assert np.sqrt((error**2).mean()) < 1e-3
    model = found.system.model
    assert model.parameters == 0
    # The static response is that of the full structure.
    load = frame.operators.expand(frame.operators.inertia(0))
    u = static_displacement(frame.operators, theta, load)
    q = np.linalg.solve(model.stiffness_constant, model.excitation)
    expected = mean_rows(frame) @ u[frame.operators.free]
    np.testing.assert_allclose(model.floor_shapes @ q, expected, rtol=1e-9)
    np.testing.assert_allclose(model.story_mass, frame.structure.story_rigid[:, 0])
