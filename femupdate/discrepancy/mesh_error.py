"""What the mesh of a frame leaves out of ln|H|, from a second, coarser mesh.

The error of the shells and beams falls with the square of the mesh size: two meshes tell where
ln|H| goes as the mesh is refined (Richardson 1911). It is one more unknown of the fit, or else the
finder would name effects that only make up for a coarse mesh.
"""

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from femupdate.building.schema import FrameBuilding
from femupdate.discrepancy.fit import Fit, fit
from femupdate.discrepancy.problem import MeshError, Problem
from femupdate.dynamics.damping import ConstantDamping
from femupdate.dynamics.effect_response import EffectSystem
from femupdate.dynamics.full_response import FloorSensors, full_modes
from femupdate.effects.structure import TRANSLATION, Structure, structure_of

Floats = NDArray[np.float64]
_COARSER = 1.5
_LARGEST = 0.3  # beside an anti-resonance the shift is no longer proportional to the mesh error


def with_mesh_error(problem: Problem, base: Fit) -> tuple[Problem, Fit]:
    """The problem with its mesh error as one more unknown, and the fit with it.

    A shear building has no mesh and comes back as it is.
    """
    structure = problem.reduced.structure
    building = structure.building
    if not isinstance(building, FrameBuilding):
        return problem, base
    theta, zeta = base.theta()[0], base.zeta(problem.fixed_zeta)
    grid = problem.frequency_hz.numpy()
    coarse = structure_of(building, _COARSER * building.mesh.size)
    change = _log_frf(problem, base) - log_frf(coarse, theta, zeta, grid)
    share = 1.0 / (_COARSER**2 - 1.0)
    shift = torch.from_numpy(np.clip(share * change, -_LARGEST, _LARGEST))
    wider = (problem.sd**2 + (0.3 * shift[list(problem.rows)]) ** 2).sqrt()
    finer = replace(problem, mesh=MeshError(shift), sd=wider)
    start = torch.cat([base.z, torch.tensor([MeshError(shift).mean], dtype=torch.float64)])
    return finer, fit(finer, base.placed, start)


def _log_frf(problem: Problem, base: Fit) -> Floats:
    """ln|H| (f, k) of all floors at a fit, without its effects, constant damping in all modes."""
    theta, zeta, _, _ = base.coordinates.split(base.z[None], problem.fixed_zeta)
    plain = EffectSystem(problem.reduced, ConstantDamping(), (), ())
    none = theta.new_zeros((1, 0))
    frf = plain.frf(theta, zeta, none, problem.frequency_hz)[0]
    return np.asarray(frf.abs().clamp_min(1e-12).log().numpy())


def log_frf(structure: Structure, theta: Floats, zeta: float, frequency_hz: Floats) -> Floats:
    """ln|H| (f, k) of the full model at one theta, for one damping ratio of all modes."""
    if structure.operators is None:
        raise ValueError("a shear building has no mesh")
    force = structure.rigid_force[:, TRANSLATION]
    sensors = FloorSensors(structure.floor_rows, force, structure.direction)
    top = 1.4 * float(frequency_hz.max())
    modes = full_modes(structure.operators, sensors, theta, top, terms=6)
    return modes.felt.log_frf(frequency_hz, zeta)
