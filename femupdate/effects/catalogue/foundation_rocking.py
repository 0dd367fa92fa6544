"""A foundation that rotates on the ground."""

import numpy as np

from femupdate.effects.drawn_building import DrawnBuilding, Glyph
from femupdate.effects.effect import Effect, EffectParameter, Sway, Terms
from femupdate.effects.structure import ROTATION, TRANSLATION, Structure


class FoundationRocking(Effect):
    """A rotational spring between ground and base."""

    name = "foundation_rocking"
    title = "Foundation rocking"
    sentence = (
        "The foundation rotates as a rigid body on flexible soil or anchorage: the floors move "
        "in proportion to their height on top of their own deformation."
    )
    clause = "The foundation rocks by {size} of the roof's static displacement"
    sits = "the base"
    settled_by = "two vertical sensors at opposite edges of the foundation"
    turns_base = True
    parameters = (
        EffectParameter(
            "size", "1", 0.1, lower=0.0, upper=2.0, text="rocking over static roof displacement"
        ),
    )

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """Upright springs under two opposite edges of the base."""
        down = np.array([0.0, 0.0, -0.13 * drawn.size])
        return tuple(Glyph.of("spring", edge + down, edge) for edge in drawn.edges(0))

    def unit(self, sway: Sway, place: int) -> float:
        """Of the roof, s2."""
        return sway.roof

    def terms(self, structure: Structure, place: str) -> Terms:
        """The spring under which rocking equals the roof's own static displacement."""
        roof = float(structure.floor_rows[-1] @ structure.static)
        moment = float(structure.rigid_mass[TRANSLATION, ROTATION])
        return Terms(flexibility=(0.0, roof / (structure.levels[-1] * moment)))
