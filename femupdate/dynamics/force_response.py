"""The flexibility that a reduced model lacks under forces at its floors.

The basis of a reduced model is made for a base that moves. It follows a force at a floor as well,
but for the static displacement near the force, of up to a fifth where the force acts. That rest is
learned from static solutions of the full model. A structure whose stiffness is a sum of theta_i
times matrices has a flexibility of degree -1 in theta, and the rest, which is local, is close to
a sum of C_i / theta_i.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from femupdate.arrays import Floats
from femupdate.dynamics.reduced import ReducedModel
from femupdate.effects.structure import Structure
from femupdate.fe.factorization import factorize
from femupdate.progress import SILENT, Progress
from femupdate.seeds import even_points
from femupdate.workers import in_threads


@dataclass(frozen=True, eq=False)
class RestFlexibility:
    """What a reduced model lacks of the static displacement of f floors under forces at them."""

    terms: Floats  # (p, f, f) m/N, each over its stiffness factor
    error: float  # rms error that is left of the displacement where the force acts, relative
    lacked: float  # rms share of that displacement that the reduced model lacks


def rest_flexibility(
    structure: Structure,
    reduced: ReducedModel,
    lower: Floats,
    upper: Floats,
    progress: Progress = SILENT,
) -> RestFlexibility:
    """Learn what a reduced model lacks, from the full model at factors spread over their prior.

    Args:
        lower, upper: (p,) prior box.
    """
    count = 2 * len(lower)
    unit = even_points(count, len(lower), 0)
    theta = np.exp(np.log(lower) + (np.log(upper) - np.log(lower)) * unit)
    progress.start("Solving the full model under forces at the floors", count)
    whole = np.stack(in_threads(partial(_static, structure), list(theta), progress))
    lacked = whole - np.stack([_reduced_static(reduced, sample) for sample in theta])
    # Every sample counts alike, whatever its stiffness.
    scale = whole.reshape(count, -1).max(axis=1)[:, None]
    terms = np.linalg.lstsq(1.0 / theta / scale, lacked.reshape(count, -1) / scale)[0]
    left = lacked - (1.0 / theta @ terms).reshape(whole.shape)
    shares = [np.diagonal(part / whole, axis1=1, axis2=2) for part in (left, lacked)]
    error, share = (float(np.sqrt((part**2).mean())) for part in shares)
    return RestFlexibility(terms.reshape(-1, *whole.shape[1:]), error, share)


def rest_about(structure: Structure, reduced: ReducedModel, theta: Floats) -> RestFlexibility:
    """What a reduced model lacks about one theta (p,), each factor taken for an even share."""
    full = _static(structure, theta)
    lacked = full - _reduced_static(reduced, theta)
    share = float(np.sqrt(((lacked / full).diagonal() ** 2).mean()))
    return RestFlexibility(theta[:, None, None] * lacked / len(theta), 0.0, share)


def _static(structure: Structure, theta: Floats) -> Floats:
    """Displacements (f, f) of the floors under unit forces at them, m/N."""
    rows = np.ascontiguousarray(structure.floor_rows.T)
    return np.asarray(structure.floor_rows @ factorize(structure.stiffness(theta)).apply(rows))


def _reduced_static(model: ReducedModel, theta: Floats) -> Floats:
    shapes = model.floor_shapes
    return np.asarray(shapes @ np.linalg.solve(model.stiffness(theta), shapes.T))
