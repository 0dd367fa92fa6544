"""Floor sensors that lose high frequencies."""

from torch import Tensor, pi

from femupdate.effects.effect import EffectParameter, as_complex
from femupdate.effects.families import ChannelEffect

_REFERENCE_HZ = 10.0


class RollOff(ChannelEffect):
    """A first-order low-pass filter on every floor sensor but not on the base's."""

    name = "roll_off"
    title = "Roll-off of the floor sensors"
    sentence = (
        "The floor sensors (not the base's) lose high frequencies like a first-order low-pass "
        "filter: a smooth droop, with a phase lag."
    )
    sits = "all floors together"
    settled_by = "the sensors' data sheets, or floor and base sensors side by side in one run"
    parameters = (
        EffectParameter(
            "size", "1", 0.03, lower=0.0, upper=4.0, text="(10 Hz over the corner frequency)^2"
        ),
    )

    def said(self, place: str, size: float) -> str:
        """As `Effect.said`."""
        corner = _REFERENCE_HZ / max(size, 1e-12) ** 0.5
        return f"The floor sensors lose what lies above {corner:.3g} Hz"

    def factor(self, omega: Tensor, sizes: Tensor) -> Tensor:
        """1 / (1 + i omega / omega_c)."""
        ratio = sizes[:, :1].clamp_min(0.0).sqrt() * omega / (2.0 * pi * _REFERENCE_HZ)
        return as_complex(ratio.new_ones(()), ratio).reciprocal()
