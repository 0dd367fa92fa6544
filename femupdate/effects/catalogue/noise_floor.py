"""Noise of the floor sensors in a table of |H|."""

from torch import Tensor

from femupdate.effects.effect import EffectParameter
from femupdate.effects.families import ChannelEffect


class NoiseFloor(ChannelEffect):
    """Noise power of the floors over the power of the base."""

    name = "noise_floor"
    title = "Noise floor"
    sentence = (
        "|H| was taken as a ratio of amplitudes, in which the noise of the floor sensors fills "
        "the anti-resonances."
    )
    clause = "The floor sensors' noise is {size} of the base motion"
    sits = "all floors together"
    settled_by = "FRFs estimated from the histories instead of a ratio of amplitudes"
    parameters = (
        EffectParameter("size", "1", 0.05, lower=0.0, upper=1.0, text="noise over base amplitude"),
    )
    # H1 averages noise of the floors away; a ratio of amplitudes does not.
    tables_only = True

    def observe(self, frf: Tensor, omega: Tensor, sizes: Tensor, rows: tuple[int, ...]) -> Tensor:
        """|H|^2 + s^2, the phase kept."""
        size = frf.abs().clamp_min(1e-30)
        return frf * (1.0 + (sizes[:, :1, None] / size) ** 2).sqrt()
