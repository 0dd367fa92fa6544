"""A floor sensor that reads too much or too little."""

from torch import Tensor

from femupdate.effects.channel import ChannelEffect
from femupdate.effects.effect import Parameter, more_or_less


class ChannelGain(ChannelEffect):
    """A factor on the FRF of one floor."""

    name = "channel_gain"
    title = "Gain of a channel"
    sentence = (
        "The sensor of one floor is off by a constant factor; where the building moves as a rigid "
        "body it does not read what the base does."
    )
    confused_with = ("base_gain",)
    settled_by = "all sensors side by side on the base in one run: their readings must agree"
    parameters = (
        Parameter("size", "1", 0.05, lower=-0.5, upper=1.0, text="relative error of the gain"),
    )

    def said(self, place: str, size: float) -> str:
        """As `Effect.said`."""
        return f"The sensor of {place} reads {more_or_less(size, 'too much', 'too little')}"

    def observe(self, frf: Tensor, omega: Tensor, sizes: Tensor, rows: tuple[int, ...]) -> Tensor:
        """H (1 + s) on the floor."""
        factor = frf.real.new_ones(len(sizes), frf.shape[1], 1)
        factor[:, list(rows)] += sizes[:, :1, None]
        return frf * factor
