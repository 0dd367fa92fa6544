"""Our own Lanczos method against dense solutions, on easy and on awkward spectra."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csc_matrix, diags

import femupdate.fe.lanczos as lanczos
from femupdate.fe import PointMasses, Springs, assemble, factorize, lowest_modes
from femupdate.fe.lanczos import block_size, largest_of_inverse

ONE = np.ones(1)


def random_pencil(size, seed, massless=0):
    """A banded K, positive definite, with a full spread of stiffnesses, and a banded M."""
    rng = np.random.default_rng(seed)
    band = [rng.uniform(-1.0, 1.0, size - offset) for offset in (1, 7)]
    off = diags([band[0], band[1], band[0], band[1]], [1, 7, -1, -7])
    stiffness = off + diags(4.0 + 10.0 ** rng.uniform(0.0, 5.0, size))
    mass = diags(
        [0.1 * np.ones(size - 1), 1.0 + rng.random(size), 0.1 * np.ones(size - 1)], [-1, 0, 1]
    )
    bare = rng.choice(size, massless, replace=False)
    keep = np.ones(size)
    keep[bare] = 0.0
    return csc_matrix(stiffness), csc_matrix(diags(keep) @ mass @ diags(keep))


def inverse_values(stiffness, mass, count):
    """Largest eigenvalues of K^-1 M by a dense solver."""
    return eigh(mass.toarray(), stiffness.toarray(), eigvals_only=True)[::-1][:count]


@pytest.mark.parametrize(
    ("seed", "count", "massless"), [(0, 1, 0), (1, 12, 0), (2, 40, 150), (3, 6, 350)]
)
def test_values_and_vectors_of_random_problems(seed, count, massless):
    stiffness, mass = random_pencil(600, seed, massless)
    start = np.random.default_rng(seed).standard_normal((600, block_size(count)))
    values, vectors = largest_of_inverse(factorize(stiffness).apply, mass, start, count, 1e-9)
    np.testing.assert_allclose(values, inverse_values(stiffness, mass, count), rtol=1e-12)
    np.testing.assert_allclose(vectors.T @ mass @ vectors, np.eye(count), atol=1e-7)
    left = mass @ vectors - (stiffness @ vectors) * values
    assert np.linalg.norm(left, axis=0) == pytest.approx(
        0.0, abs=1e-7 * np.linalg.norm(mass @ vectors, axis=0).max()
    )


@pytest.mark.parametrize("width", [1, 4])
def test_many_vectors_stay_orthogonal(width):
    """Without reorthogonalisation copies of the first values would appear among the others."""
    stiffness, mass = random_pencil(1500, 5)
    start = np.random.default_rng(5).standard_normal((1500, width))
    values, _ = largest_of_inverse(factorize(stiffness).apply, mass, start, 200, 1e-9)
    np.testing.assert_allclose(values, inverse_values(stiffness, mass, 200), rtol=1e-11)


def test_a_start_that_reaches_too_few_modes_is_given_up():
    """A start within three eigenvectors spans no more than three."""
    stiffness = csc_matrix(diags(np.arange(1.0, 701.0)))
    start = np.zeros((700, 1))
    start[:3] = 1.0
    mass = csc_matrix(diags(np.ones(700)))
    solver = factorize(stiffness).apply
    assert largest_of_inverse(solver, mass, start, 4, 1e-9) is None


def equal_masts(meshes, count):
    """Masts that stand apart and are all alike, each a chain of springs: all modes are repeated."""
    each = 60
    number = np.arange(count * each).reshape(count, each)
    below = np.where(np.arange(each) == 0, -1, number - 1)
    directions = np.repeat([0, 1, 2], number.size)
    springs = Springs(
        nodes=np.tile(np.stack([number.ravel(), below.ravel()], axis=1), (3, 1)),
        direction=directions,
        stiffness=np.full(3 * number.size, 2e6),
        group=np.zeros(3 * number.size, dtype=np.int64),
    )
    inertia = np.zeros((number.size, 3))
    masses = PointMasses(number.ravel(), np.full(number.size, 50.0), inertia)
    fixed = np.tile([False] * 3 + [True] * 3, (number.size, 1))
    points = meshes.stack(*np.divmod(np.arange(number.size), each), np.zeros(number.size))
    return assemble(meshes.model(points, fixed, springs=springs, masses=masses))


@pytest.mark.parametrize("count", [1, 9, 20, 40])
def test_repeated_modes_are_all_found(meshes, count):
    """Four masts swing alike in three directions: every frequency occurs twelve times."""
    operators = equal_masts(meshes, 4)
    assert len(operators.free) == 720  # beyond what is solved densely
    modes = lowest_modes(operators, ONE, count)
    chain = 2.0 * np.sqrt(2e6 / 50.0) / (2.0 * np.pi)
    each = chain * np.sin((2 * np.arange(4) + 1) * np.pi / (2 * (2 * 60 + 1)))
    np.testing.assert_allclose(modes.frequency_hz, np.repeat(each, 12)[:count], rtol=1e-9)
    overlap = modes.shapes.T @ operators.mass @ modes.shapes
    np.testing.assert_allclose(overlap, np.eye(count), atol=1e-6)


def test_a_vector_that_is_not_orthogonal_to_others_is_seen():
    """A millionth of any one of a hundred old vectors shows; rounding does not."""
    rng = np.random.default_rng(2)
    vectors, _ = np.linalg.qr(rng.standard_normal((400, 101)))
    watch = lanczos._Watch(400)
    for block in np.split(vectors[:, :100], 25, axis=1):
        watch.add(np.asfortranarray(block))
    new = vectors[:, 100:]
    assert not watch.overlaps(new)
    for old in range(100):
        assert watch.overlaps(new + 1e-6 * vectors[:, [old]])
