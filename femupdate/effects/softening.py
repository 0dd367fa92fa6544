"""Effects that make stiffness fall, and damping grow, with the amplitude of the motion."""

from femupdate.effects.drawn_building import DrawnBuilding, Glyph
from femupdate.effects.effect import Effect, Parameter


class Softening(Effect):
    """Changes of stiffness and damping by one share with every doubling of the amplitude."""

    parameters = (
        Parameter(
            "size",
            "1",
            0.05,
            lower=-0.5,
            upper=0.0,
            text="change of stiffness with every doubling of the amplitude",
        ),
        Parameter(
            "damping",
            "1",
            0.2,
            lower=-0.5,
            upper=2.0,
            text="change of the damping ratio with every doubling of the amplitude",
        ),
    )

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """The near faces of the story, or of all."""
        sides = [(0, float(drawn.low[0])), (1, float(drawn.low[1]))]
        faces = [drawn.upright(*side, k) for k in drawn.stories(place) for side in sides]
        return (Glyph.of("surfaces", faces),)
