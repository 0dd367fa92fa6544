"""Cracked beams, separate from the rest of the story."""

from femupdate.effects.effect import Parameter
from femupdate.effects.member import MemberStiffness


class CrackedBeams(MemberStiffness):
    """A factor on the beams' bending stiffness of one story or of all."""

    name = "cracked_beams"
    title = "Cracked beams"
    sentence = (
        "The beams have lost bending stiffness by cracking or slipping joints, while walls "
        "and columns have not."
    )
    confused_with = ("cracked_columns",)
    settled_by = "the beams' cracks and joints, or the rotation of their ends"
    parameters = (
        Parameter(
            "size", "1", 0.4, lower=-0.9, upper=0.0, text="change of the beams' bending stiffness"
        ),
    )
    kinds = ("beam",)
    bending_only = True
