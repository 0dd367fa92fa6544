"""A base sensor that reads too much or too little."""

from torch import Tensor

from femupdate.effects.drawn_building import DrawnBuilding, Glyph
from femupdate.effects.effect import Effect, EffectParameter


class BaseGain(Effect):
    """A factor on the FRFs of all floors."""

    name = "base_gain"
    title = "Gain of the base channel"
    sentence = "The base sensor is off by a constant factor, which shifts all floors alike."
    clause = "The base sensor reads {change}"
    words = ("too much", "too little")
    sits = "the base"
    settled_by = "two sensors side by side on the base in one run: their readings must agree"
    parameters = (
        EffectParameter(
            "size", "1", 0.05, lower=-0.5, upper=1.0, text="relative error of the gain"
        ),
    )
    instrument = True

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """A ball at the sensor of the base."""
        return (Glyph.of("ball", drawn.centre(0), drawn.radius),)

    def observe(self, frf: Tensor, omega: Tensor, sizes: Tensor, rows: tuple[int, ...]) -> Tensor:
        """H / (1 + s)."""
        return frf / (1.0 + sizes[:, :1, None])
