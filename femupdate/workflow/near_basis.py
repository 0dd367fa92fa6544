"""The basis of a frame near a fit, in which effects may act."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from femupdate.array_archive import write_arrays
from femupdate.arrays import Floats
from femupdate.building.schema import Building
from femupdate.dynamics.local_basis import Sized, local_structure
from femupdate.dynamics.projection import reduced_on
from femupdate.dynamics.reduced_terms import ReducedStructure
from femupdate.effects.structure import Structure
from femupdate.progress import Progress, Silent
from femupdate.study import Study
from femupdate.workflow.effects import finder_origin, read_basis
from femupdate.workflow.model import reduction_target

NEAR_BASIS = "finder's basis"
_FILE = "finder_basis.npz"
# Spacings of ln theta and ln zeta at which bases are made: a basis serves .2 to both sides, so that
# one serves the fits to most files of a building, and which one does not depend on earlier files.
_THETA, _ZETA = 0.1, 0.3


def structure_near(
    structure: Structure,
    building: Building,
    theta: Floats,
    zeta: float,
    progress: Progress | None = None,
    present: Sequence[Sized] | None = None,
    study: Study | None = None,
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
        study: keeps the last basis in which every effect may act; None keeps nothing.
    """
    whole, show = reduction_target(building), progress or Silent()
    target = replace(whole, zeta=max(float(_rounded(zeta, _ZETA)), whole.zeta))
    if present is not None or structure.operators is None:
        return local_structure(structure, theta, target, show, present=present)
    middle = _rounded(theta, _THETA)
    origin = {
        **finder_origin(building),
        "theta": " ".join(f"{factor:.4g}" for factor in middle),
        "zeta": f"{target.zeta:.4g}",
    }
    kept = None if study is None else study.find(NEAR_BASIS, origin)
    if kept is not None:
        return reduced_on(structure, read_basis(kept, structure).astype(np.float64))
    found = local_structure(structure, middle, target, show)
    # As it is kept, in single precision, so that the next run gives the same to the last digit.
    basis = found.basis.astype(np.float32)
    if study is not None:
        write_arrays(study.path(_FILE), basis=basis)
        study.record(NEAR_BASIS, _FILE, "diagnose", origin, {"size": basis.shape[1]})
    return reduced_on(structure, basis.astype(np.float64))


def _rounded(value: Floats | float, spacing: float) -> Floats:
    """The nearest value whose logarithm is a multiple of a spacing."""
    return np.asarray(np.exp(spacing * np.round(np.log(value) / spacing)), dtype=np.float64)
