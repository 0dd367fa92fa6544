"""Effects of the floors' sensors and channels, which lie in the measurement."""

from femupdate.effects.drawn_building import DrawnBuilding, Glyph
from femupdate.effects.effect import Effect
from femupdate.effects.structure import Structure


class ChannelEffect(Effect):
    """A fault of one floor's channel, where `places` does not say otherwise."""

    instrument = True

    def places(self, structure: Structure) -> tuple[str, ...]:
        """Every floor."""
        return structure.floors

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """The sensors of the place."""
        return drawn.sensors(place)
