"""Modes of a building: numbered on the full model, and followed through parameter samples.

Every other part of the program takes the number of a mode from here: a reduced model lacks the
modes that the base motion does not excite, so its own count would give other numbers.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.dynamics.reduced import ReducedModel
from femupdate.effects.structure import Structure
from femupdate.fe.solve import lowest_modes


@dataclass(frozen=True)
class ReducedModes:
    """All modes of S parameter samples."""

    frequency_hz: Floats  # (S, r)
    vectors: Floats  # (S, r, r) mass-orthonormal columns, one a mode


@dataclass(frozen=True)
class TrackedMode:
    """One mode followed through the samples."""

    frequency_hz: Floats  # (S,) NaN where no mode of a sample resembles the reference
    vectors: Floats  # (S, r) signed like the reference
    found: float  # share of the samples in which the mode was found

    @property
    def recognised(self) -> Floats:
        """Vectors (n, r) of the samples in which the mode was found."""
        return self.vectors[np.isfinite(self.frequency_hz)]

    @property
    def frequency_mean(self) -> float:
        """Mean frequency, Hz."""
        return float(np.nanmean(self.frequency_hz))

    @property
    def frequency_sd(self) -> float:
        """Standard deviation of the frequency, Hz."""
        return float(np.nanstd(self.frequency_hz))


def reduced_modes(model: ReducedModel, theta: Floats) -> ReducedModes:
    """Modes at theta (S, p)."""
    squared, vectors = np.linalg.eigh(model.stiffness(theta))
    return ReducedModes(np.sqrt(squared.clip(0.0)) / (2.0 * np.pi), vectors)


def driven_modes(model: ReducedModel, modes: ReducedModes, count: int) -> list[int]:
    """The lowest modes of the first sample that the base motion drives at some floor."""
    vectors = modes.vectors[0]
    effect = (model.floor_shapes @ vectors) * (model.excitation @ vectors)
    # A mode counts as driven when some floor sees at least this share of the base motion in it.
    return [int(k) for k in np.flatnonzero(np.abs(effect).max(axis=0) >= 0.05)[:count]]


def track_mode(modes: ReducedModes, reference: Floats) -> TrackedMode:
    """Follow the mode that resembles a reference vector (r,) through all samples.

    Modes are mass-orthonormal, so the modal assurance criterion is the squared product of two
    vectors (Allemang & Brown 1982); below one half no mode is the reference's own.
    """
    products = np.einsum("srj,r->sj", modes.vectors, reference)
    best = np.abs(products).argmax(axis=1)
    rows = np.arange(len(best))
    signs = np.sign(products[rows, best])
    followed = products[rows, best] ** 2 >= 0.5
    frequency = np.where(followed, modes.frequency_hz[rows, best], np.nan)
    vectors = modes.vectors[rows, :, best] * signs[:, None]
    return TrackedMode(
        frequency, np.where(followed[:, None], vectors, np.nan), float(followed.mean())
    )


def node_displacements(model: ReducedModel, vector: Floats) -> Floats:
    """Displacement of every node (..., N, 3) of reduced coordinates (..., r)."""
    assert model.node_shapes is not None
    return np.einsum("ndr,...r->...nd", model.node_shapes, vector)


def modes_at_one(model: ReducedModel, theta: Floats) -> Integers:
    """For every mode at theta (p,) the mode at factors 1 that it comes from, (r,).

    The factors go from 1 to theta in 40 even steps of their logarithms; at each the modes are
    paired, one to one, with those that they resemble most.
    """
    from scipy.optimize import linear_sum_assignment

    path = np.exp(np.linspace(0.0, 1.0, 41)[:, None] * np.log(theta))
    vectors = reduced_modes(model, path).vectors
    origin = np.arange(vectors.shape[-1])
    for before, after in pairwise(vectors):
        _, partner = linear_sum_assignment(-((before.T @ after) ** 2))
        renumbered = np.empty_like(origin)
        renumbered[partner] = origin
        origin = renumbered
    return origin


def mean_shape(shapes: Floats) -> tuple[Floats, Floats]:
    """Mean (N, 3) of shapes (S, N, 3) and how much they differ (N,), over its largest."""
    mean = shapes.mean(axis=0)
    largest = np.linalg.norm(mean, axis=-1).max() or 1.0
    spread = np.sqrt(((shapes - mean) ** 2).sum(axis=-1).mean(axis=0))
    return mean / largest, spread / largest


X, Y, TORSION, FLOORS, DIAGONAL = "X", "Y", "torsion", "floors", "X+Y"
_LEAST, _KEPT = 12, 80  # modes of a mesh; 80 of the six-story example fill its frequency grid


@dataclass(frozen=True, eq=False)
class FullModes:
    """The k lowest modes; mode number n is entry n - 1."""

    frequency_hz: Floats  # (k,)
    shapes: Floats  # (k, d) displacements of the nodes, three a node; of a stick its coordinates
    effective_mass: Floats  # (k, 2) share of the mass that a motion along x and along y moves
    direction: tuple[str, ...]  # (k,) what moves most: "X", "Y", "X+Y", "torsion" or "floors"

    def direction_of(self, number: int | None) -> str:
        """What moves most in a mode; empty where it has no number."""
        return "" if number is None else self.direction[number - 1]

    def numbers_of(self, model: ReducedModel, modes: ReducedModes) -> list[int | None]:
        """Numbers of the first sample's modes, None of one that resembles none of the full ones."""
        shapes = modes.vectors[0].T
        if model.node_shapes is not None:
            shapes = node_displacements(model, shapes).reshape(len(shapes), -1)
        first, second = (
            rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-300)
            for rows in (shapes, self.shapes)
        )
        # Of a mode across the base motion a remnant is left, far above its frequency.
        near = modes.frequency_hz[0][:, None] < 1.1 * self.frequency_hz
        product = np.abs(first @ second.T) ** 2 * near
        best = product.argmax(axis=1)
        # Two shapes are of one mode above this modal assurance criterion.
        return [
            int(k) + 1 if value[k] >= 0.5 else None for k, value in zip(best, product, strict=True)
        ]


def stick_modes(model: ReducedModel, direction: int = 0) -> FullModes:
    """All modes of a stick, which is its own reduced model."""
    found = reduced_modes(model, np.ones((1, model.parameters)))
    vectors = found.vectors[0]
    share = (model.excitation @ vectors) ** 2 / float(model.excitation @ model.excitation)
    mass = np.zeros((len(share), 2))
    mass[:, direction] = share
    names = ((X, Y)[direction],) * len(share)
    return FullModes(found.frequency_hz[0], vectors.T, mass, names)


def mesh_modes(structure: Structure) -> FullModes:
    """The lowest modes of a structure that has a mesh."""
    _, operators = structure.meshed
    massive = int((operators.mass.diagonal() > 0.0).sum())  # a single cantilever has few
    count = min(max(_LEAST, min(_KEPT, len(operators.free) // 8)), max(1, massive))
    modes = lowest_modes(operators, np.ones(operators.parameters), count)
    full = operators.expand(modes.shapes).reshape(len(operators.model.nodes), 6, -1)
    shapes = np.moveaxis(full, 2, 0)
    mass = np.zeros((len(shapes), 2))
    for axis in (0, 1):  # shares of the whole mass, that of the supports included
        rigid = operators.rigid_translation(axis)
        total = float(rigid @ (operators.mass_full @ rigid)) or 1.0  # no mass moves along it
        mass[:, axis] = (modes.shapes.T @ operators.inertia(axis)) ** 2 / total
    levels = operators.model.nodes[:, 2].min() + np.asarray(structure.levels)
    # Mass of the nodes, and their own inertia about z.
    nodal = (operators.mass_full @ operators.rigid_translation(0)).reshape(-1, 6)[:, 0]
    nodal = np.stack([nodal, operators.mass_full.diagonal()[5::6]])
    return FullModes(
        modes.frequency_hz,
        shapes[:, :, :3].reshape(len(shapes), -1),
        mass,
        tuple(_direction(shape, operators.model.nodes, nodal, levels) for shape in shapes),
    )


def _direction(shape: Floats, nodes: Floats, mass: Floats, levels: Floats) -> str:
    """What most of the floors' kinetic energy is of: floors as rigid plates, or their bending."""
    # Nodes this near to a floor's level, of the height, belong to it.
    near = 1e-3 * max(float(np.ptp(nodes[:, 2])), 1e-9)
    energy = np.zeros(4)
    for level in levels:
        on = (np.abs(nodes[:, 2] - level) < near) & (mass[0] > 0.0)
        if on.any():
            energy += _plate(shape[on, :3], nodes[on, :2], mass[0, on])
            energy[2] += mass[1, on] @ shape[on, 5] ** 2
    most = (X, Y, TORSION, FLOORS)[int(energy.argmax())]
    return DIAGONAL if most in (X, Y) and energy[:2].min() > 0.5 * energy[:2].max() else most


def _plate(moved: Floats, plan: Floats, mass: Floats) -> Floats:
    """Twice the kinetic energy along x, along y, about z, and of the rest, at unit frequency."""
    total = mass.sum()
    arm = plan - mass @ plan / total
    mean = mass @ moved[:, :2] / total
    inertia = float(mass @ (arm**2).sum(axis=1))
    moment = float(mass @ (arm[:, 0] * moved[:, 1] - arm[:, 1] * moved[:, 0]))
    turned = moment**2 / inertia if inertia > 0.0 else 0.0
    rigid = np.array([total * mean[0] ** 2, total * mean[1] ** 2, turned])
    everything = float(mass @ (moved**2).sum(axis=1))
    return np.append(rigid, max(everything - rigid.sum(), 0.0))
