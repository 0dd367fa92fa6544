"""Participation of the slabs, separate from the rest of the story."""

from femupdate.effects.effect import EffectParameter
from femupdate.effects.families import MemberStiffness


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
    parameters = (
        EffectParameter(
            "size", "1", 0.3, lower=-0.9, upper=3.0, text="change of the slabs' stiffness"
        ),
    )
    kinds = ("slab",)
