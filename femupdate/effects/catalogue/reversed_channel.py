"""A sensor mounted the wrong way round."""

import torch
from torch import Tensor

from femupdate.effects.channel import ChannelEffect


class ReversedChannel(ChannelEffect):
    """The sign of one floor."""

    name = "reversed_channel"
    title = "Reversed channel"
    sentence = "The sensor of one floor points the other way: its phase is off by half a turn."
    settled_by = "the arrow on the sensor, or its sign when it is tilted by hand"
    parameters = ()
    needs_phase = True

    def said(self, place: str, size: float) -> str:
        """As `Effect.said`."""
        return f"The sensor of {place} points the other way"

    def observe(self, frf: Tensor, omega: Tensor, sizes: Tensor, rows: tuple[int, ...]) -> Tensor:
        """-H on the floor."""
        sign = torch.ones(frf.shape[1], 1, dtype=frf.real.dtype)
        sign[list(rows)] = -1.0
        return frf * sign
