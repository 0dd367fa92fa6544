"""A channel whose clock runs fast or slow."""

import torch
from torch import Tensor

from femupdate.effects.effect import EffectParameter
from femupdate.effects.families import ChannelEffect


class DriftingClock(ChannelEffect):
    """A delay of one floor that grows evenly from one end of the record to the other.

    The FRF over the whole record is the mean over the delays: that of the middle, and a loss of
    amplitude that a plain delay does not have.
    """

    name = "drifting_clock"
    title = "Drifting clock"
    sentence = (
        "The recorder of one floor runs fast or slow against the base's: its delay grows during "
        "the record, which turns phases and wipes out amplitude at high frequencies."
    )
    clause = "The delay of {place} grows by {size} during the run"
    contains = ("channel_delay",)
    settled_by = "the delay found in either half of the record alone, or a common trigger"
    parameters = (
        EffectParameter(
            "size",
            "s",
            0.02,
            lower=-0.2,
            upper=0.2,
            text="growth of the delay in the run",
            # Phases turn by several radians, and a fit ends where it begins.
            trials=(-5.0, -2.0, 0.5, 2.0, 5.0),
        ),
        EffectParameter(
            "start", "s", 0.002, lower=-0.05, upper=0.05, text="delay at its beginning"
        ),
    )
    needs_phase = True

    def factor(self, omega: Tensor, sizes: Tensor) -> Tensor:
        """exp(-i omega (start + size / 2)) sin(omega size / 2) / (omega size / 2).

        The mean of exp(-i omega tau) over delays tau that are even from start to start + size.
        """
        half = 0.5 * sizes[:, :1] * omega
        lost = torch.sinc(half / torch.pi)
        return lost.sign() * torch.polar(lost.abs(), -half - sizes[:, 1:2] * omega)
