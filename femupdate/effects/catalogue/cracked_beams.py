"""Cracked beams, separate from the rest of the story."""

from femupdate.effects.effect import EffectParameter
from femupdate.effects.families import MemberStiffness


class CrackedBeams(MemberStiffness):
    """A factor on the second moments of area of the beams of one story or of all.

    Shear areas stay as they are.
    """

    name = "cracked_beams"
    title = "Cracked beams"
    sentence = (
        "The beams have lost bending stiffness along their length by cracking, while walls "
        "and columns have not."
    )
    clause = "The beams have lost {lost} of their second moments of area {where}"
    settled_by = "the beams' cracks, or the rotation of their ends"
    parameters = (
        EffectParameter(
            "size",
            "1",
            0.4,
            lower=-0.9,
            upper=0.0,
            text="change of the beams' second moments of area",
        ),
    )
    kinds = ("beam",)
    bending_only = True
