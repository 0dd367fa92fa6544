"""Cracked columns, separate from the rest of the story."""

from femupdate.effects.effect import EffectParameter
from femupdate.effects.families import MemberStiffness


class CrackedColumns(MemberStiffness):
    """A factor on the second moments of area of the columns of one story or of all.

    Shear areas stay as they are.
    """

    name = "cracked_columns"
    title = "Cracked columns"
    sentence = (
        "The columns have lost bending stiffness by cracking, while walls and beams have not."
    )
    clause = "The columns have lost {lost} of their second moments of area {where}"
    settled_by = "the columns' cracks, or the rotation of their ends"
    parameters = (
        EffectParameter(
            "size",
            "1",
            0.4,
            lower=-0.9,
            upper=0.0,
            text="change of the columns' second moments of area",
        ),
    )
    kinds = ("column",)
    bending_only = True
