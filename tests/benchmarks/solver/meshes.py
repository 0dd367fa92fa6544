"""Meshes, supports and loads of benchmark models."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from femupdate.arrays import Flags, Floats, Integers
from femupdate.fe import Beams, Elements, FiniteElementModel, Shells, assemble, static_displacement
from femupdate.fe.membrane import GAUSS_POINTS, parent_derivatives, shape_functions

UX, UY, UZ, RX, RY, RZ = range(6)
ALL = (UX, UY, UZ, RX, RY, RZ)
IN_PLANE = (UX, UY, RZ)  # of a plate in the plane z = 0
OUT_OF_PLANE = (UZ, RX, RY)


def grid(columns: int, rows: int) -> tuple[Floats, Floats, Integers]:
    """Points of the unit square, s (n,) and t (n,), and the quadrilaterals between them (m, 4)."""
    s, t = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1), indexing="ij")
    number = np.arange(s.size).reshape(s.shape)
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1)
    return s.ravel(), t.ravel(), quads.reshape(-1, 4)


def shells(
    quads: ArrayLike,
    thickness: float | Floats,
    youngs_modulus: float,
    poisson_ratio: float,
    density: float = 0.0,
    group: int = 0,
) -> Shells:
    """Shells of one thickness, or one each (m), and one material (Pa, -, kg/m3)."""
    nodes = np.asarray(quads, dtype=np.int64)
    ones = np.ones(len(nodes))
    return Shells(
        nodes=nodes,
        thickness=thickness * ones,
        youngs_modulus=youngs_modulus * ones,
        poisson_ratio=poisson_ratio * ones,
        density=density * ones,
        group=np.full(len(nodes), group, dtype=np.int64),
        kind=np.full(len(nodes), "wall"),
    )


def beams(
    nodes: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0), group: int = 0, **section: Any
) -> Beams:
    """Beams of one section; without shear areas they are Euler-Bernoulli beams."""
    pairs = np.asarray(nodes, dtype=np.int64)
    values: dict[str, Any] = {
        "shear_area_y": np.inf,
        "shear_area_z": np.inf,
        "poisson_ratio": 0.3,
        "density": 0.0,
        **section,
    }
    ones = np.ones(len(pairs))
    return Beams(
        nodes=pairs,
        up=np.broadcast_to(np.asarray(up, dtype=float), (len(pairs), 3)),
        group=np.full(len(pairs), group, dtype=np.int64),
        kind=np.full(len(pairs), "beam"),
        **{name: value * ones for name, value in values.items()},
    )


def chain(count: int, first: int = 0) -> Integers:
    """Node pairs (count, 2) of a row of elements that starts at node `first`."""
    return first + np.stack([np.arange(count), np.arange(1, count + 1)], axis=1)


def model(
    points: ArrayLike, fixed: Flags | None = None, groups: int = 1, **parts: Any
) -> FiniteElementModel:
    """A model without supports unless they are given; parts are blocks of elements or fields."""
    nodes = np.asarray(points, dtype=float)
    if fixed is None:
        fixed = np.zeros((len(nodes), 6), dtype=bool)
    blocks = tuple(part for part in parts.values() if isinstance(part, Elements))
    others = {name: part for name, part in parts.items() if not isinstance(part, Elements)}
    return FiniteElementModel(nodes, fixed, groups, blocks, **others)


def hold(count: int, *rules: tuple[Flags, Sequence[int]]) -> Flags:
    """Support flags (count, 6) from pairs of a node mask and directions."""
    fixed = np.zeros((count, 6), dtype=bool)
    for nodes, directions in rules:
        fixed[np.ix_(np.flatnonzero(nodes), np.array(directions, dtype=np.int64))] = True
    return fixed


def line_weights(on_line: Flags, position: Floats) -> Floats:
    """Shares (n,) of a uniform line load on the nodes of a line, which add up to one."""
    nodes = np.flatnonzero(on_line)
    nodes = nodes[np.argsort(position[nodes])]
    lengths = np.diff(position[nodes])
    shares = np.zeros(len(on_line))
    shares[nodes[:-1]] += 0.5 * lengths
    shares[nodes[1:]] += 0.5 * lengths
    return shares / shares.sum()


def area_shares(points: Floats, quads: Integers) -> Floats:
    """Area (n,) of the surface that belongs to each node, by the shape functions, m2."""
    tangents = np.einsum("gai,nid->ngad", parent_derivatives(GAUSS_POINTS), points[quads])
    area = np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=-1)
    shares = np.zeros(len(points))
    np.add.at(shares, quads, area @ shape_functions(GAUSS_POINTS))
    return shares


def displacement(finite_element_model: FiniteElementModel, load: Floats) -> Floats:
    """Static displacement (N, 6) at theta = 1 under a load (N, 6)."""
    operators = assemble(finite_element_model)
    theta = np.ones(finite_element_model.groups)
    return static_displacement(operators, theta, load.ravel()).reshape(-1, 6)


def stack(*coordinates: Floats) -> Floats:
    """Coordinates (n,) each as columns of points."""
    return np.stack(coordinates, axis=1)


def zeros(count: int) -> Floats:
    """No load and no motion, (N, 6)."""
    return np.zeros((count, 6))
