"""In-plane stiffness of slabs, without their bending."""

import numpy as np
from scipy.sparse import csc_matrix

from femupdate.effects.infill import onto_free
from femupdate.fe.assembly import AffineOperators
from femupdate.fe.elements.shell import Shells
from femupdate.fe.entries import element_entries, summed
from femupdate.fe.model import FiniteElementModel


def membrane_terms(
    model: FiniteElementModel, operators: AffineOperators, kind: str
) -> tuple[csc_matrix, ...]:
    """Membrane stiffness (n_free, n_free) of the four-node shells of a kind, by story.

    Args:
        kind: such as "slab".
    """
    shells = model.elements_of(Shells)
    chosen = [
        shells.taken(np.flatnonzero((shells.kind == kind) & (shells.group == group)))
        for group in range(model.groups)
    ]
    entries = [element_entries(some.nodes, some.membrane(model.nodes)) for some in chosen]
    return tuple(onto_free(summed([one], operators.dof), operators) for one in entries)
