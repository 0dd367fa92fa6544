"""Floors that deform in their plane."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csc_matrix

from femupdate.effects.effect import EffectParameter
from femupdate.effects.families import MemberStiffness
from femupdate.effects.infill import onto_free
from femupdate.effects.structure import Structure
from femupdate.fe.assembly import AffineOperators, element_entries, summed
from femupdate.fe.elements.shell import Shells
from femupdate.fe.model import FiniteElementModel


class FlexibleDiaphragm(MemberStiffness):
    """A factor on the in-plane stiffness of the slabs of one floor or of all."""

    name = "flexible_diaphragm"
    title = "Flexible diaphragm"
    sentence = (
        "The slabs are softer in their plane than modelled (openings, precast joints, cracks), so "
        "that the frames of one floor move apart; best seen with several sensors on a floor."
    )
    clause = "The slabs are {lost} softer in their plane {where}"
    settled_by = "sensors at the ends and in the middle of one floor, kept apart"
    parameters = (
        EffectParameter(
            "size", "1", 0.3, lower=-0.95, upper=0.0, text="change of in-plane stiffness"
        ),
    )
    kinds = ("slab",)
    elements = Shells

    def stiffness(self, structure: Structure) -> Sequence[csc_matrix]:
        """That of the slabs as membranes, without their bending."""
        mesh, operators = structure.mesh, structure.operators
        if mesh is None or operators is None:
            raise ValueError("a shear building has no slabs")
        return structure.once(("membrane",), lambda: _membranes(mesh.model, operators))


def _membranes(model: FiniteElementModel, operators: AffineOperators) -> tuple[csc_matrix, ...]:
    """Membrane stiffness (n_free, n_free) of the slabs by story."""
    shells = model.elements_of(Shells)
    slabs = [
        shells.taken(np.flatnonzero((shells.kind == "slab") & (shells.group == group)))
        for group in range(model.groups)
    ]
    entries = [element_entries(some.nodes, some.membrane(model.nodes)) for some in slabs]
    return tuple(onto_free(summed([entry], operators.dof), operators) for entry in entries)
