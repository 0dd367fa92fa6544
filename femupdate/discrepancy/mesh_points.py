"""What a coarse mesh leaves of FRFs, point by point, when the unknowns have made up for it."""

import numpy as np
import torch

from femupdate.arrays import Floats
from femupdate.discrepancy.thresholds import FIT, MESH_ERROR
from femupdate.dynamics.reduced import ReducedModel
from femupdate.dynamics.system import System


def error_of_points(
    coarse: ReducedModel,
    fine: ReducedModel,
    theta: Floats,
    frequency_hz: Floats,
    zeta: float = MESH_ERROR.damping,
) -> float:
    """rms of ln|H| and phase (rad) by which the coarse model misses the fine one.

    The stiffness factors and the damping ratio of the coarse one are fitted first, by one step of
    linear least squares.

    Args:
        coarse, fine: the structure on two meshes.
        theta: (p,) stiffness factors of the fine one.
        frequency_hz: (k,).
        zeta: damping ratio of all modes of the fine one.
    """
    size = len(theta) + 1
    steps = np.vstack([np.zeros(size), FIT.difference * np.eye(size)])
    unknowns = np.append(theta, zeta) * np.exp(steps)
    ours = _frf(coarse, unknowns, frequency_hz)
    here = ours[0]
    apart = _ratio(_frf(fine, unknowns[:1], frequency_hz)[0], here)
    jacobian = np.stack([_ratio(one, here) for one in ours[1:]], axis=1) / FIT.difference
    moved = np.linalg.lstsq(jacobian, apart, rcond=None)[0]
    return float(np.sqrt(np.mean((apart - jacobian @ moved) ** 2)))


def _frf(model: ReducedModel, unknowns: Floats, frequency_hz: Floats) -> Floats:
    """Complex FRFs (N, f, k) at stiffness factors and a damping ratio (N, p + 1)."""
    system = System(model)
    values = torch.from_numpy(unknowns)
    none = values.new_zeros((len(values), 0))
    frequency = torch.from_numpy(frequency_hz)
    return system.frf(values[:, :-1], values[:, -1], none, frequency).numpy()


def _ratio(values: Floats, reference: Floats) -> Floats:
    """Changes (2 f k,) of ln|H| and of the phase, rad."""
    ratio = values / reference
    return np.concatenate([np.log(np.abs(ratio)).ravel(), np.angle(ratio).ravel()])
