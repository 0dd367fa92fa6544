"""A sensor mounted the wrong way round."""

from torch import Tensor

from femupdate.effects.families import ChannelEffect


class ReversedChannel(ChannelEffect):
    """The sign of one floor."""

    name = "reversed_channel"
    title = "Reversed channel"
    sentence = "The sensor of one floor points the other way: its phase is off by half a turn."
    clause = "The sensor of {place} points the other way"
    settled_by = "the arrow on the sensor, or its sign when it is tilted by hand"
    parameters = ()
    needs_phase = True

    def factor(self, omega: Tensor, sizes: Tensor) -> Tensor:
        """-1."""
        return -omega.new_ones(1, 1)
