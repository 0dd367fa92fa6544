"""Stiffness of one kind of member, separate from the rest of its story."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csc_matrix

from femupdate.effects.effect import change
from femupdate.effects.families import MemberStiffness
from femupdate.effects.infill import onto_free
from femupdate.effects.structure import Structure
from femupdate.fe.assembly import element_entries, summed
from femupdate.fe.elements.shell import Shells


class WallStiffness(MemberStiffness):
    """A factor on the walls' stiffness of one story or of all."""

    name = "wall_stiffness"
    title = "Stiffness of the walls"
    sentence = (
        "The shear walls are stiffer or softer than the story factor says, apart from the "
        "frame: cracking, openings, another thickness or effective width."
    )
    clause = "The walls are {change} than modelled {where}"
    settled_by = "the walls' cracks, or strains at their feet"
    parameters = change("change of the walls' stiffness", 0.25, -0.9, 3.0)
    kinds = ("wall",)


class SlabParticipation(MemberStiffness):
    """A factor on the slabs' stiffness of one story or of all."""

    name = "slab_participation"
    title = "Participation of the slabs"
    sentence = (
        "The slabs take part in the frame action more or less than modelled: cracking, or another "
        "effective width."
    )
    clause = "The slabs are {change} than modelled {where}"
    settled_by = "the slab's cracks, or strains of the slab beside a beam"
    parameters = change("change of the slabs' stiffness", 0.3, -0.9, 3.0)
    kinds = ("slab",)


class BraceStiffness(MemberStiffness):
    """A factor on the modelled braces' stiffness of one story or of all."""

    name = "brace_stiffness"
    title = "Stiffness of the braces"
    sentence = (
        "The braces are stiffer or softer than the story factor says, apart from the frame: "
        "another section, slack or slipping connections, braces that have buckled."
    )
    clause = "The braces are {change} than modelled {where}"
    settled_by = "the braces' ends, their straightness, or strains along them"
    parameters = change("change of the braces' stiffness", 0.3, -0.95, 3.0)
    kinds = ("brace",)


class InfillStiffness(MemberStiffness):
    """A factor on the struts of infills of one story or of all."""

    name = "infill_stiffness"
    title = "Stiffness of the infills"
    sentence = (
        "The infill walls are stiffer or softer than their struts, apart from the frame: openings, "
        "gaps to the frame, cracks, better or poorer masonry."
    )
    clause = "The infills are {change} than modelled {where}"
    settled_by = "gaps and cracks along the frame, or tests of the masonry"
    parameters = change("change of the infills' stiffness", 0.5, -0.95, 5.0)
    kinds = ("infill",)


class CrackedColumns(MemberStiffness):
    """A factor on the second moments of area of columns; shear areas stay as they are."""

    name = "cracked_columns"
    title = "Cracked columns"
    sentence = (
        "The columns have lost bending stiffness by cracking, while walls and beams have not."
    )
    clause = "The columns have lost {lost} of their second moments of area {where}"
    settled_by = "the columns' cracks, or the rotation of their ends"
    parameters = change("change of the columns' second moments of area", 0.4, -0.9, 0.0)
    kinds = ("column",)
    bending_only = True


class CrackedBeams(MemberStiffness):
    """A factor on the second moments of area of beams; shear areas stay as they are."""

    name = "cracked_beams"
    title = "Cracked beams"
    sentence = (
        "The beams have lost bending stiffness along their length by cracking, while walls "
        "and columns have not."
    )
    clause = "The beams have lost {lost} of their second moments of area {where}"
    settled_by = "the beams' cracks, or the rotation of their ends"
    parameters = change("change of the beams' second moments of area", 0.4, -0.9, 0.0)
    kinds = ("beam",)
    bending_only = True


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
    parameters = change("change of in-plane stiffness", 0.3, -0.95, 0.0)
    kinds = ("slab",)
    elements = Shells

    def stiffness(self, structure: Structure) -> Sequence[csc_matrix]:
        """That of the slabs as membranes, without their bending."""
        mesh, operators = structure.meshed
        shells = mesh.model.elements_of(Shells)

        def membranes(group: int) -> csc_matrix:
            chosen = (shells.kind == "slab") & (shells.group == group)
            slabs = shells.taken(np.flatnonzero(chosen))
            entries = element_entries(slabs.nodes, slabs.membrane(mesh.model.nodes))
            return onto_free(summed([entries], operators.dof), operators)

        return structure.once(
            ("membrane",), lambda: tuple(membranes(group) for group in range(mesh.model.groups))
        )
