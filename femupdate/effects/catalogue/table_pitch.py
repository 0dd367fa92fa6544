"""A shaking table that pitches as it translates."""

import numpy as np

from femupdate.effects.drawn_building import DrawnBuilding, Glyph
from femupdate.effects.effect import Effect, EffectParameter, Terms
from femupdate.effects.structure import Structure


class TablePitch(Effect):
    """A rotation of the base in proportion to its translation."""

    name = "table_pitch"
    title = "Table pitch"
    sentence = (
        "The table (or the ground) rotates along with its translation, which adds a motion in "
        "proportion to height; natural frequencies stay, anti-resonances move."
    )
    clause = "The table turns by {number} mrad for every metre that it moves"
    sits = "the base"
    settled_by = "two vertical sensors at opposite ends of the table"
    turns_base = True
    parameters = (
        EffectParameter(
            "size", "rad/m", 0.02, lower=-0.2, upper=0.2, text="rotation per translation"
        ),
    )

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """A tilted line under the base with arrows down and up at its ends."""
        below = np.array([0.0, 0.0, 0.05 * drawn.size])
        left, right = (edge - below for edge in drawn.edges(0))
        rise = np.array([0.0, 0.0, 0.09 * drawn.size])
        return (
            Glyph.of("lines", [np.stack([left - 0.4 * rise, right + 0.4 * rise])]),
            Glyph.of("arrow", left, left - rise),
            Glyph.of("arrow", right - rise, right + 0.8 * rise),
        )

    def terms(self, structure: Structure, place: str) -> Terms:
        """One radian a metre."""
        return Terms(pitch=1.0)
