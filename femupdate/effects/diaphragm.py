"""In-plane stiffness of slabs, apart from their bending."""

import numpy as np
from scipy.sparse import csc_matrix

from femupdate.arrays import Floats, Integers
from femupdate.effects.infill import onto_free
from femupdate.fe.assembly import AffineOperators
from femupdate.fe.element import symmetric
from femupdate.fe.entries import element_entries, summed
from femupdate.fe.membrane import membrane_stiffness
from femupdate.fe.model import FiniteElementModel
from femupdate.fe.shell import IN_PLANE, mean_planes, to_local


def membrane_terms(
    model: FiniteElementModel, operators: AffineOperators, kind: str
) -> tuple[csc_matrix, ...]:
    """Membrane stiffness (n_free, n_free) of the four-node shells of a kind, one a story.

    Args:
        model, operators: of the building.
        kind: such as "slab".
    """
    chosen = [
        np.flatnonzero((model.shells.kind == kind) & (model.shells.group == group))
        for group in range(model.groups)
    ]
    return tuple(_of_shells(model, operators, shells) for shells in chosen)


def _of_shells(
    model: FiniteElementModel, operators: AffineOperators, shells: Integers
) -> csc_matrix:
    nodes = model.shells.nodes[shells]
    entries = element_entries(nodes, _matrices(model, shells))
    return onto_free(summed([entries], operators.dof), operators)


def _matrices(model: FiniteElementModel, shells: Integers) -> Floats:
    """(n, 24, 24) of shells that do not bend."""
    part = model.shells
    frame = mean_planes(model.nodes[part.nodes[shells]])
    elastic = (part.thickness[shells], part.youngs_modulus[shells], part.poisson_ratio[shells])
    local = np.zeros((len(shells), 24, 24))
    local[:, IN_PLANE[:, None], IN_PLANE] = membrane_stiffness(frame.plane, *elastic)
    transform = to_local(frame)
    return symmetric(np.swapaxes(transform, 1, 2) @ local @ transform)
