"""Modes of the reduced model at parameter samples, matched to one another."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.dynamics.reduced import ReducedModel

# A mode counts as driven when some floor sees at least this share of the base motion in it.
_DRIVEN = 0.05


@dataclass(frozen=True)
class ReducedModes:
    """All modes of S parameter samples.

    Attributes:
        frequency_hz: (S, r).
        vectors: (S, r, r) mass-orthonormal columns, one a mode.
    """

    frequency_hz: Floats
    vectors: Floats


@dataclass(frozen=True)
class TrackedMode:
    """One mode followed through the samples.

    Attributes:
        frequency_hz: (S,) NaN where no mode of a sample resembles the reference.
        vectors: (S, r) signed like the reference.
        found: share of the samples in which the mode was found.
    """

    frequency_hz: Floats
    vectors: Floats
    found: float

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
    return [int(k) for k in np.flatnonzero(np.abs(effect).max(axis=0) >= _DRIVEN)[:count]]


def track_mode(modes: ReducedModes, reference: Floats) -> TrackedMode:
    """Follow the mode that resembles a reference vector (r,) through all samples.

    Modes are mass-orthonormal, so the modal assurance criterion is the squared product of two
    vectors (Allemang & Brown 1982); below one half no mode is the reference's own.
    """
    products = np.einsum("srj,r->sj", modes.vectors, reference)
    best = np.abs(products).argmax(axis=1)
    rows = np.arange(len(best))
    signs = np.sign(products[rows, best])
    own = products[rows, best] ** 2 >= 0.5
    frequency = np.where(own, modes.frequency_hz[rows, best], np.nan)
    vectors = modes.vectors[rows, :, best] * signs[:, None]
    return TrackedMode(frequency, np.where(own[:, None], vectors, np.nan), float(own.mean()))


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
