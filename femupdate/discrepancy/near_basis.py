"""The basis of a frame near a fit, in which effects may act."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.document import Building
from femupdate.discrepancy.thresholds import FIT
from femupdate.dynamics.local_basis import Sized, local_structure
from femupdate.dynamics.reduced import ReducedStructure, reduced_on
from femupdate.effects.structure import Structure
from femupdate.inference.parameters import reduction_target
from femupdate.progress import Progress, Silent

Bases = Callable[[Structure, Floats, float, Callable[[], Floats]], Floats]
"""Gives the basis (n, r) kept of a structure for theta (p,) and zeta, else makes and keeps it."""


def structure_near(
    structure: Structure,
    building: Building,
    theta: Floats,
    zeta: float,
    progress: Progress | None = None,
    present: Sequence[Sized] | None = None,
    bases: Bases | None = None,
) -> ReducedStructure:
    """The structure on a basis for the neighbourhood of theta, in which effects may act.

    A basis for the whole prior, members and torsion apart, needs some nine hundred shapes; near one
    theta two hundred do, from some thirty solutions of the full model, or from ten where only the
    effects that are present need act.

    Args:
        structure: the full model; one of a stick comes back as it is.
        building: whose grid and damping the basis serves.
        theta: (p,) story factors; zeta: the damping ratio.
        progress: told about the steps.
        present: see `local_structure`.
        bases: keeps the last basis in which every effect may act; None keeps nothing.
    """
    whole, show = reduction_target(building), progress or Silent()
    target = replace(whole, zeta=max(float(_rounded(zeta, FIT.zeta_spacing)), whole.zeta))
    if present is not None or structure.operators is None:
        return local_structure(structure, theta, target, show, present=present)
    middle = _rounded(theta, FIT.theta_spacing)

    def make() -> Floats:
        # As it is kept, in single precision: the next run gives the same to the last digit.
        return local_structure(structure, middle, target, show).basis.astype(np.float32)

    basis = make() if bases is None else bases(structure, middle, target.zeta, make)
    return reduced_on(structure, basis.astype(np.float64))


def _rounded(value: Floats | float, spacing: float) -> Floats:
    """The nearest value whose logarithm is a multiple of a spacing."""
    return np.asarray(np.exp(spacing * np.round(np.log(value) / spacing)), dtype=np.float64)
