"""Stiffness of the walls, separate from the rest of the story."""

from femupdate.effects.effect import EffectParameter
from femupdate.effects.families import MemberStiffness


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
    parameters = (
        EffectParameter(
            "size", "1", 0.25, lower=-0.9, upper=3.0, text="change of the walls' stiffness"
        ),
    )
    kinds = ("wall",)
