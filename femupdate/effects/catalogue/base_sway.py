"""A base that slides on the ground."""

from femupdate.effects.drawn_building import DrawnBuilding, Glyph
from femupdate.effects.effect import Effect, EffectParameter, Sway, Terms
from femupdate.effects.structure import TRANSLATION, Structure


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
    parameters = (
        EffectParameter(
            "size", "1", 0.1, lower=0.0, upper=2.0, text="sway over static roof displacement"
        ),
    )

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """A spring beside the base, along the motion."""
        start, _ = drawn.edges(0)
        return (Glyph.of("spring", start - drawn.along(0.25 * drawn.size), start),)

    def unit(self, sway: Sway, place: int) -> float:
        """Of the roof, s2."""
        return sway.roof

    def terms(self, structure: Structure, place: str) -> Terms:
        """The spring under which sway equals the roof's own static displacement."""
        roof = float(structure.floor_rows[-1] @ structure.static)
        shear = float(structure.rigid_mass[TRANSLATION, TRANSLATION])
        return Terms(flexibility=(roof / shear, 0.0))
