"""A floor sensor that reads too much or too little."""

from torch import Tensor

from femupdate.effects.effect import EffectParameter
from femupdate.effects.families import ChannelEffect


class ChannelGain(ChannelEffect):
    """A factor on the FRF of one floor."""

    name = "channel_gain"
    title = "Gain of a channel"
    sentence = (
        "The sensor of one floor is off by a constant factor; where the building moves as a rigid "
        "body it does not read what the base does."
    )
    clause = "The sensor of {place} reads {change}"
    words = ("too much", "too little")
    settled_by = "all sensors side by side on the base in one run: their readings must agree"
    parameters = (
        EffectParameter(
            "size", "1", 0.05, lower=-0.5, upper=1.0, text="relative error of the gain"
        ),
    )

    def factor(self, omega: Tensor, sizes: Tensor) -> Tensor:
        """1 + s."""
        return 1.0 + sizes[:, :1]
