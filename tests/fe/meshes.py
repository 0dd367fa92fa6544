"""Meshes, models and loads shared by the tests of the finite-element room."""

from dataclasses import replace

import numpy as np

from femupdate.fe.assembly import assemble
from femupdate.fe.model import Beams, FiniteElementModel, Shells
from femupdate.fe.solve import static_displacement

UX, UY, UZ, RX, RY, RZ = range(6)


def grid(columns, rows):
    """Points of the unit square (s, t) and the quadrilaterals between them."""
    s, t = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1), indexing="ij")
    number = np.arange(s.size).reshape(s.shape)
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1)
    return s.ravel(), t.ravel(), quads.reshape(-1, 4)


def shells(quads, thickness, youngs_modulus, poisson_ratio, density=0.0, group=0):
    ones = np.ones(len(quads))
    return Shells(
        np.asarray(quads, dtype=np.int64),
        thickness * ones,
        youngs_modulus * ones,
        poisson_ratio * ones,
        density * ones,
        (group * ones).astype(np.int64),
        np.full(len(quads), "wall"),
    )


def beams(nodes, up=(0.0, 0.0, 1.0), group=0, **section):
    """Beams of one section; without shear areas they are Euler-Bernoulli beams."""
    values = {
        "shear_area_y": np.inf,
        "shear_area_z": np.inf,
        "poisson_ratio": 0.3,
        "density": 0.0,
        **section,
    }
    ones = np.ones(len(nodes))
    return Beams(
        nodes=np.asarray(nodes, dtype=np.int64),
        up=np.tile(np.asarray(up, dtype=float), (len(nodes), 1)),
        group=(group * ones).astype(np.int64),
        kind=np.full(len(nodes), "beam"),
        **{name: value * ones for name, value in values.items()},
    )


def chain(count):
    """Node pairs of a row of `count` elements."""
    return np.stack([np.arange(count), np.arange(1, count + 1)], axis=1)


def model(points, fixed=None, groups=1, **parts):
    points = np.asarray(points, dtype=float)
    if fixed is None:
        fixed = np.zeros((len(points), 6), dtype=bool)
    return FiniteElementModel(points, fixed, groups, **parts)


def hold(count, *rules):
    """Support flags from pairs of a node mask and directions."""
    fixed = np.zeros((count, 6), dtype=bool)
    for where, directions in rules:
        fixed[np.ix_(np.flatnonzero(where), directions)] = True
    return fixed


def line_weights(where, position):
    """Shares of a uniform line load on the nodes of a line, which add up to one."""
    nodes = np.flatnonzero(where)
    nodes = nodes[np.argsort(position[nodes])]
    lengths = np.diff(position[nodes])
    shares = np.zeros(len(where))
    shares[nodes[:-1]] += 0.5 * lengths
    shares[nodes[1:]] += 0.5 * lengths
    return shares / shares.sum()


def area_shares(points, quads):
    """Area of the surface that belongs to each node, by the shape functions."""
    shares = np.zeros(len(points))
    corners = points[quads]
    for xi, eta in np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / np.sqrt(3):
        signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        shape = 0.25 * (1 + xi * signs[:, 0]) * (1 + eta * signs[:, 1])
        along_xi = np.einsum("i,nid->nd", 0.25 * signs[:, 0] * (1 + eta * signs[:, 1]), corners)
        along_eta = np.einsum("i,nid->nd", 0.25 * signs[:, 1] * (1 + xi * signs[:, 0]), corners)
        area = np.linalg.norm(np.cross(along_xi, along_eta), axis=1)
        np.add.at(shares, quads, area[:, None] * shape)
    return shares


def displacement(finite_element_model, load):
    """Static displacement (N, 6) at theta = 1 under a load (N, 6)."""
    operators = assemble(finite_element_model)
    theta = np.ones(finite_element_model.groups)
    return static_displacement(operators, theta, load.ravel()).reshape(-1, 6)


def random_rotation(seed):
    matrix, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    return matrix * np.linalg.det(matrix)


def stack(*coordinates):
    return np.stack(coordinates, axis=1)


def zeros(count):
    """No load and no motion, (N, 6)."""
    return np.zeros((count, 6))


def frame_with_wall(fine=1):
    """A wall, a slab and a column that touch, nowhere symmetric: (model parts, points).

    The wall stands in the plane y = 0, the slab lies on it at z = 3, the column carries the slab's
    far corner. The wall belongs to parameter 0, the column to parameter 1, the slab to none.
    """
    s, t, quads = grid(3 * fine, 4 * fine)
    wall = stack(4.5 * s, 0 * s, 3.0 * t)
    u, v, floor = grid(3 * fine, 2 * fine)
    slab = stack(4.5 * u, 2.5 * v, 3.0 + 0 * u)
    column = stack(np.full(2, 4.5), np.full(2, 2.5), np.array([0.0, 1.5]))
    points = np.concatenate([wall, slab, column])
    points, index = np.unique(points.round(9), axis=0, return_inverse=True)
    quads = index[: len(wall)][quads], index[len(wall) : len(wall) + len(slab)][floor]
    top = index[len(wall) + np.flatnonzero((u == 1) & (v == 1))[0]]
    low, middle = index[-2:]
    both = shells(np.concatenate(quads), 0.2, 30e9, 0.2, 2500.0)
    group = np.repeat([0, -1], [len(quads[0]), len(quads[1])])
    section = {
        "area": 0.12,
        "shear_area_y": 0.1,
        "shear_area_z": 0.1,
        "inertia_y": 1.6e-3,
        "inertia_z": 0.9e-3,
        "torsion_constant": 1.9e-3,
        "youngs_modulus": 25e9,
        "density": 2400.0,
    }
    parts = {
        "shells": replace(both, group=group, thickness=np.where(group == 0, 0.2, 0.15)),
        "beams": beams([[low, middle], [middle, top]], up=(1.0, 0.4, 0.0), group=1, **section),
    }
    return points, parts
