"""Responses of a model that differs little from one whose modes are known."""

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csc_matrix

from femupdate.arrays import Floats
from femupdate.dynamics.full_response import FloorModes, FloorSensors
from femupdate.dynamics.reduction import STATIC_WEIGHT, ReductionTarget, combinations
from femupdate.fe.assembly import AffineOperators
from femupdate.fe.factorization import factorize

_NOTHING = 1e-10  # of the largest energy among shapes: it adds nothing new
# Of the largest energy among responses: some twenty questions are asked, and their answers are
# compressed again.
_LEAST = 1e-6


def nearby_shapes(
    operators: AffineOperators, sensors: FloorSensors, known: Floats, target: ReductionTarget
) -> Floats:
    """Weighted shapes (n_free, c) that span the responses of a changed model over the grid.

    The response among the known modes, and one step of inverse iteration from it (Bathe 2014,
    section 11.6): u = K^-1 (f + w^2 M u) with the K and M of the changed model. It takes one
    factorisation and a third as many solutions as there are modes, for of the modes of a building
    with slabs the floors feel a few.

    Args:
        operators: of the changed model, without stiffness factors.
        sensors: where its floors are observed, and what drives it.
        known: (n_free, m) modes of the model that it differs little from.
        target: grid and damping.
    """
    factorization = factorize(operators.stiffness(np.zeros(0)))
    static = factorization.apply(sensors.excitation)
    image = _times(operators.mass, known)
    stiffness = known.T @ _times(factorization.matrix, known)
    first = _responses(stiffness, known.T @ image, known, static, sensors, target)
    # What the stiffness makes of the new shapes are the right-hand sides that they solve.
    right = np.column_stack([image @ first, sensors.excitation])
    fresh = np.column_stack([factorization.apply(right[:, :-1]), static])
    moved = _times(operators.mass, fresh)
    stiffness = _symmetric(stiffness, known.T @ right, fresh.T @ right)
    mass = _symmetric(known.T @ image, known.T @ moved, fresh.T @ moved)
    both = np.column_stack([known, fresh])
    combined = _responses(stiffness, mass, both, static, sensors, target)
    return np.column_stack([both @ combined, STATIC_WEIGHT * static])


def _responses(
    stiffness: Floats,
    mass: Floats,
    basis: Floats,
    static: Floats,
    sensors: FloorSensors,
    target: ReductionTarget,
) -> Floats:
    """Combinations (b, c) of a basis (n_free, b) that span the responses of the model on it.

    Args:
        stiffness, mass: (b, b) of the model on the basis.
        basis: the shapes.
        static: (n_free,) displacement under unit base acceleration.
        sensors: where the floors are observed, and what drives it.
        target: grid and damping.
    """
    scale = np.sqrt(mass.diagonal())
    # Not NumPy's: the method of divide and conquer has failed on such matrices.
    energy, directions = eigh(mass / np.outer(scale, scale))
    kept = energy > _NOTHING * energy[-1]
    onto = (directions[:, kept] / np.sqrt(energy[kept])) / scale[:, None]
    squared, vectors = eigh(onto.T @ stiffness @ onto)
    modes = onto @ vectors
    participation = modes.T @ (basis.T @ sensors.excitation)
    floors = (sensors.rows @ basis) @ modes
    effect = floors * participation
    missed = sensors.rows @ static - effect @ (1.0 / squared)
    felt = FloorModes(np.sqrt(squared), effect, missed[:, None])
    return modes @ combinations(felt, participation, floors, target, _LEAST)


def _times(matrix: csc_matrix, shapes: Floats) -> Floats:
    """Symmetric matrix times shapes, by its rows: three times as fast as by its columns."""
    return np.asarray(matrix.T @ np.ascontiguousarray(shapes))


def _symmetric(first: Floats, between: Floats, second: Floats) -> Floats:
    """Symmetric matrix of its blocks."""
    whole = np.block([[first, between], [between.T, second]])
    return 0.5 * (whole + whole.T)
