"""Stiffness of the infills, separate from the rest of the story."""

from femupdate.effects.effect import EffectParameter
from femupdate.effects.families import MemberStiffness


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
    parameters = (
        EffectParameter(
            "size", "1", 0.5, lower=-0.95, upper=5.0, text="change of the infills' stiffness"
        ),
    )
    kinds = ("infill",)
