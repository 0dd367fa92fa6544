"""A channel that comes late."""

import torch
from torch import Tensor

from femupdate.effects.effect import EffectParameter
from femupdate.effects.families import ChannelEffect


class ChannelDelay(ChannelEffect):
    """A phase slope of one floor."""

    name = "channel_delay"
    title = "Delay of a channel"
    sentence = "One floor's channel is late against the base: a phase that falls with frequency."
    settled_by = "all sensors side by side on the base in one run: their phases must agree"
    parameters = (
        EffectParameter("size", "s", 0.002, lower=-0.05, upper=0.05, text="delay against the base"),
    )
    needs_phase = True

    def said(self, place: str, size: float) -> str:
        """As `Effect.said`."""
        return f"{place} is {1000.0 * abs(size):.3g} ms {'late' if size > 0.0 else 'early'}"

    def factor(self, omega: Tensor, sizes: Tensor) -> Tensor:
        """exp(-i omega tau)."""
        return torch.polar(omega.new_ones(()), -sizes[:, :1] * omega)
