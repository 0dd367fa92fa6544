"""The three-node shell: patch tests, rigid motions, closed forms of plates and in-plane bending."""

import numpy as np
import pytest
from femupdate.benchmarks.solver import membranes

from femupdate.fe import Triangles, assemble, static_displacement
from tests.fe import meshes

ONE = np.ones(1)
YOUNG, POISSON = 1e6, 0.25


def triangles(nodes, thickness, young=YOUNG, poisson=POISSON, density=0.0):
    count = len(nodes)
    return Triangles(
        nodes=np.asarray(nodes),
        thickness=np.full(count, thickness),
        youngs_modulus=np.full(count, young),
        poisson_ratio=np.full(count, poisson),
        density=np.full(count, density),
        group=np.zeros(count, dtype=np.int64),
        kind=np.full(count, "slab", dtype="<U24"),
    )


def split(quads, alternate=False):
    """Two triangles a quadrilateral; one diagonal, or both in turn."""
    a, b, c, d = quads.T
    one = np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1)
    other = np.stack([np.stack([a, b, d], 1), np.stack([b, c, d], 1)], 1)
    pick = (np.arange(len(quads)) % 2 == 1) & alternate
    return np.where(pick[:, None, None], other, one).reshape(-1, 3)


@pytest.mark.parametrize("thickness", [1e-3, 0.05])
@pytest.mark.parametrize("name", ["membrane", "spin", "bending"])
@pytest.mark.parametrize("seed", [None, 3])
def test_patch(name, thickness, seed):
    block = triangles(split(membranes.PATCH_QUADS), thickness)
    turn = None if seed is None else meshes.random_rotation(seed)
    assert membranes.patch_error(name, turn, block) < 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_six_rigid_motions_and_no_more(seed):
    nodes = np.random.default_rng(seed).standard_normal((3, 3))
    stiffness = triangles([[0, 1, 2]], 0.1).matrices(nodes).stiffness[0]
    values = np.linalg.eigvalsh(stiffness)
    assert (np.abs(values[:6]) < 1e-12 * values[-1]).all()
    assert values[6] > 1e-6 * values[-1]


@pytest.mark.parametrize("aspect", [1.0, 4.0, 16.0])
def test_two_triangles_bend_in_their_plane_like_a_beam(aspect):
    """The energy of pure in-plane bending is exact whatever the sides (Felippa 2003)."""
    corners = np.array([[0.0, 0, 0], [aspect, 0, 0], [aspect, 1, 0], [0, 1, 0]])
    x, y, _ = (corners - corners.mean(axis=0)).T
    motion = np.zeros((4, 6))
    motion[:, 0], motion[:, 1], motion[:, 5] = -x * y, (x * x + POISSON * y * y) / 2, x
    matrices = triangles([[0, 1, 2], [0, 2, 3]], 0.1).matrices(corners).stiffness
    both = motion[[[0, 1, 2], [0, 2, 3]]].reshape(2, 18)
    energy = np.einsum("ni,nij,nj->", both, matrices, both)
    assert energy == pytest.approx(YOUNG * 0.1 / 12 * aspect, rel=1e-9)


def plate(n, thickness, alternate):
    s, t, quads = meshes.grid(n, n)
    points = np.column_stack([s, t, 0 * s])
    return points, triangles(split(quads, alternate), thickness, 10.92e6, 0.3)


# Uniform load 1 N/m2 on a unit square plate: w E t^3 / (12 (1 - nu^2)) in the middle is 0.00406235
# simply supported and 0.00126532 clamped (Timoshenko and Woinowsky-Krieger, 1959, articles 30, 44).
@pytest.mark.parametrize("alternate", [False, True])
@pytest.mark.parametrize(("clamped", "factor"), [(False, 0.00406235), (True, 0.00126532)])
@pytest.mark.parametrize("thickness", [1e-4, 1e-2])
def test_square_plate_without_locking(clamped, factor, thickness, alternate):
    n = 16
    points, shells = plate(n, thickness, alternate)
    x, y, _ = points.T
    rim = (x == 0) | (x == 1) | (y == 0) | (y == 1)
    held = range(6) if clamped else [2]
    flat = np.ones(len(points), dtype=bool)
    fixed = meshes.hold(len(points), (rim, held), (flat, [0, 1, 5]))
    load = np.zeros((len(points), 6))
    np.add.at(load[:, 2], shells.nodes, 1.0 / len(shells) / 3.0)
    model = meshes.model(points, fixed, triangles=shells)
    middle = np.flatnonzero((x == 0.5) & (y == 0.5))[0]
    found = static_displacement(assemble(model), ONE, load.ravel())[6 * middle + 2]
    # 2 %: 16 x 16 DKMT are within 1 % in Katili's tables; soft support adds what is left.
    assert found * 1e6 * thickness**3 == pytest.approx(factor, rel=0.02)
