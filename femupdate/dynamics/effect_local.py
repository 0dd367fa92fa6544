"""A smaller basis for the neighbourhood of one theta, taken from a large one.

A basis that serves stiffness factors over a range of nine, members apart, with torsion, needs many
hundred shapes, too many to be evaluated thousands of times. Near the most probable theta a third
of them does: the large basis, once made, plays the full model, and its responses in a small box
are compressed as those of the full model were.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csc_matrix

from femupdate.dynamics.effect_reduction import structure_on
from femupdate.dynamics.effect_response import ReducedStructure
from femupdate.dynamics.effect_samples import Variation, variation_of
from femupdate.dynamics.full_response import FloorModes, FullModes
from femupdate.dynamics.reduction import ReductionTarget, snapshots
from femupdate.effects.structure import TRANSLATION

Floats = NDArray[np.float64]
SPREAD = 0.25  # of ln theta to both sides
_SIZE = 220
_SAMPLES = 16
_TOP = 1.3  # modes up to this many times the grid's top


@dataclass(frozen=True, eq=False)
class LargeModel:
    """A large reduced structure with all that varies in it, r coordinates.

    Attributes:
        reduced: the structure.
        varied: what varies.
        terms: (t, r, r) of the variation.
        mass: (r, r) of unit eccentricity, and force (r,).
    """

    reduced: ReducedStructure
    varied: Variation
    terms: Floats
    mass: tuple[Floats, Floats]


def large_model(reduced: ReducedStructure) -> LargeModel:
    """Project what varies onto a large basis; made once, it serves any theta."""
    varied, basis = variation_of(reduced.structure), reduced.basis
    size = basis.shape[1]
    mass = (np.zeros((size, size)), np.zeros(size))
    if varied.mass is not None:
        mass = (projected(basis, varied.mass.matrix), basis.T @ varied.mass.force[:, TRANSLATION])
    terms = np.stack([projected(basis, term) for term in varied.terms])
    return LargeModel(reduced, varied, terms, mass)


def near(
    large: LargeModel,
    theta: Floats,
    target: ReductionTarget,
    *,
    spread: float = SPREAD,
    size: int = _SIZE,
    samples: int = _SAMPLES,
) -> ReducedStructure:
    """The structure on a basis for the neighbourhood of theta.

    Args:
        large: the structure on a large basis.
        theta: (p,) story factors.
        target: grid and damping.
        spread: half width of the neighbourhood in ln theta.
        size: number of shapes.
        samples: responses that they are taken from.
    """
    low, high = theta * np.exp(-spread), theta * np.exp(spread)
    draws = large.varied.draw(low, high, samples, target.seed)
    shapes = np.concatenate([_shapes(large, draw, target) for draw in draws], axis=1)
    _, directions = np.linalg.eigh(shapes @ shapes.T)
    return structure_on(
        large.reduced.structure, large.reduced.basis @ directions[:, ::-1][:, :size]
    )


def projected(basis: Floats, matrix: csc_matrix) -> Floats:
    """basis^T matrix basis, through the rows that the matrix has."""
    rows = np.flatnonzero(np.diff(matrix.tocsr().indptr))
    own = basis[rows]
    result = own.T @ (matrix.tocsr()[rows][:, rows] @ own)
    return 0.5 * (result + result.T)


def _shapes(large: LargeModel, draw: Floats, target: ReductionTarget) -> Floats:
    model, shift = large.reduced.model, float(draw[-1])
    stiffness = model.stiffness_constant + np.tensordot(draw[:-1], large.terms, 1)
    squared, shapes = eigh(stiffness, np.eye(model.size) + shift * large.mass[0])
    omega = np.sqrt(squared)
    participation = shapes.T @ (model.excitation + shift * large.mass[1])
    floors = model.floor_shapes @ shapes
    static = shapes @ (participation / squared)
    inside = omega < 2.0 * np.pi * _TOP * float(target.frequency_hz[-1])
    beyond = (floors[:, ~inside] @ (participation / squared)[~inside])[:, None]
    felt = FloorModes(omega[inside], (floors * participation)[:, inside], beyond)
    modes = FullModes(shapes[:, inside], participation[inside], floors[:, inside], static, felt)
    return snapshots(modes, target)
