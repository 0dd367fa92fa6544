"""What moves under a building: soil, anchorage, or the table itself."""

import numpy as np

from femupdate.effects.effect import DrawnBuilding, Effect, Glyph, Sway, Terms, change
from femupdate.effects.structure import ROTATION, TRANSLATION, Structure


class BaseSway(Effect):
    """A horizontal spring between ground and base."""

    name = "base_sway"
    title = "Base sway"
    sentence = (
        "The base moves horizontally against the ground or the table: soft soil, slipping "
        "anchorage; all floors are amplified by one common factor that grows with frequency."
    )
    clause = "The base sways by {size} of the roof's static displacement"
    sits = "the base"
    settled_by = "a sensor on the foundation beside the one on the ground or the table"
    parameters = change("sway over static roof displacement", 0.1, 0.0, 2.0)

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """A spring beside the base, along the motion."""
        start, _ = drawn.edges(0)
        return (Glyph.of("spring", start - drawn.along(0.25 * drawn.size), start),)

    def unit(self, sway: Sway, place: int) -> float:
        """Of the roof, s2."""
        return sway.roof

    def terms(self, structure: Structure, place: str) -> Terms:
        """The spring under which sway equals the roof's own static displacement."""
        shear = float(structure.rigid_mass[TRANSLATION, TRANSLATION])
        return Terms(flexibility=(structure.roof / shear, 0.0))


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
    parameters = change("rocking over static roof displacement", 0.1, 0.0, 2.0)

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """Upright springs under two opposite edges of the base."""
        down = np.array([0.0, 0.0, -0.13 * drawn.size])
        return tuple(Glyph.of("spring", edge + down, edge) for edge in drawn.edges(0))

    def unit(self, sway: Sway, place: int) -> float:
        """Of the roof, s2."""
        return sway.roof

    def terms(self, structure: Structure, place: str) -> Terms:
        """The spring under which rocking equals the roof's own static displacement."""
        moment = float(structure.rigid_mass[TRANSLATION, ROTATION])
        return Terms(flexibility=(0.0, structure.roof / (structure.levels[-1] * moment)))


class TablePitch(Effect):
    """A rotation of the base in proportion to its translation: the table pitches as it moves."""

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
    parameters = change("rotation per translation", 0.02, -0.2, 0.2, unit="rad/m")

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
