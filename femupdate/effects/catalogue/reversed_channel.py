"""A sensor mounted the wrong way round."""

import torch
from torch import Tensor

from femupdate.effects.drawn_building import DrawnBuilding, Glyph
from femupdate.effects.effect import Effect
from femupdate.effects.structure import Structure


class ReversedChannel(Effect):
    """The sign of one floor."""

    name = "reversed_channel"
    title = "Reversed channel"
    sentence = "The sensor of one floor points the other way: its phase is off by half a turn."
    settled_by = "the arrow on the sensor, or its sign when it is tilted by hand"
    parameters = ()
    instrument = True
    needs_phase = True

    def places(self, structure: Structure) -> tuple[str, ...]:
        """Every floor."""
        return structure.floors

    def said(self, place: str, size: float) -> str:
        """As `Effect.said`."""
        return f"The sensor of {place} points the other way"

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """The floor's sensors."""
        return drawn.sensors(place)

    def observe(self, frf: Tensor, omega: Tensor, sizes: Tensor, rows: tuple[int, ...]) -> Tensor:
        """-H on the floor."""
        sign = torch.ones(frf.shape[1], 1, dtype=frf.real.dtype)
        sign[list(rows)] = -1.0
        return frf * sign
