"""Faults of sensors and recorders: what a channel makes of the motion."""

from itertools import combinations

import torch
from torch import Tensor

from femupdate.effects.effect import (
    DrawnBuilding,
    Effect,
    EffectParameter,
    Glyph,
    as_complex,
    change,
)
from femupdate.effects.families import ChannelEffect
from femupdate.effects.structure import Structure


class BaseGain(Effect):
    """A factor on the FRFs of all floors: the base sensor reads too much or too little."""

    name = "base_gain"
    title = "Gain of the base channel"
    sentence = "The base sensor is off by a constant factor, which shifts all floors alike."
    clause = "The base sensor reads {change}"
    words = ("too much", "too little")
    sits = "the base"
    settled_by = "two sensors side by side on the base in one run: their readings must agree"
    parameters = change("relative error of the gain", 0.05, -0.5, 1.0)
    instrument = True

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """A ball at the sensor of the base."""
        return (Glyph.of("ball", drawn.centre(0), drawn.radius),)

    def observe(self, frf: Tensor, omega: Tensor, sizes: Tensor, rows: tuple[int, ...]) -> Tensor:
        """H / (1 + s)."""
        return frf / (1.0 + sizes[:, :1, None])


class ChannelGain(ChannelEffect):
    """A factor on the FRF of one floor: its sensor reads too much or too little."""

    name = "channel_gain"
    title = "Gain of a channel"
    sentence = (
        "The sensor of one floor is off by a constant factor; where the building moves as a rigid "
        "body it does not read what the base does."
    )
    clause = "The sensor of {place} reads {change}"
    words = ("too much", "too little")
    settled_by = "all sensors side by side on the base in one run: their readings must agree"
    parameters = change("relative error of the gain", 0.05, -0.5, 1.0)

    def factor(self, omega: Tensor, sizes: Tensor) -> Tensor:
        """1 + s."""
        return 1.0 + sizes[:, :1]


class ChannelDelay(ChannelEffect):
    """A phase slope of one floor, whose channel comes late."""

    name = "channel_delay"
    title = "Delay of a channel"
    sentence = "One floor's channel is late against the base: a phase that falls with frequency."
    settled_by = "all sensors side by side on the base in one run: their phases must agree"
    parameters = change("delay against the base", 0.002, -0.05, 0.05, unit="s")
    needs_phase = True

    def said(self, place: str, size: float) -> str:
        return f"{place} is {1000.0 * abs(size):.3g} ms {'late' if size > 0.0 else 'early'}"

    def factor(self, omega: Tensor, sizes: Tensor) -> Tensor:
        """exp(-i omega tau)."""
        return torch.polar(omega.new_ones(()), -sizes[:, :1] * omega)


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
        # Phases turn by several radians, and a fit ends where it begins: hence the trials.
        *change(
            "growth of the delay in the run", 0.02, -0.2, 0.2, "s", (-5.0, -2.0, 0.5, 2.0, 5.0)
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


class ReversedChannel(ChannelEffect):
    """The sign of one floor, whose sensor is mounted the wrong way round."""

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


class SwappedChannels(ChannelEffect):
    """The FRFs of two floors exchanged."""

    name = "swapped_channels"
    title = "Swapped channels"
    sentence = "The channels of two floors are exchanged: cables or column names were mixed up."
    clause = "The channels of {place} are exchanged"
    settled_by = "the labels of the cables, or a tap beside each sensor"
    parameters = ()

    def places(self, structure: Structure) -> tuple[str, ...]:
        """Every pair of floors."""
        return tuple(",".join(pair) for pair in combinations(structure.floors, 2))

    def observe(self, frf: Tensor, omega: Tensor, sizes: Tensor, rows: tuple[int, ...]) -> Tensor:
        """The two rows exchanged."""
        order = list(range(frf.shape[1]))
        half = len(rows) // 2
        for first, second in zip(rows[:half], rows[half:], strict=True):
            order[first], order[second] = second, first
        return frf[:, order]


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
    parameters = change("(10 Hz over the corner frequency)^2", 0.03, 0.0, 4.0)

    def said(self, place: str, size: float) -> str:
        corner = 10.0 / max(size, 1e-12) ** 0.5
        return f"The floor sensors lose what lies above {corner:.3g} Hz"

    def factor(self, omega: Tensor, sizes: Tensor) -> Tensor:
        """1 / (1 + i omega / omega_c)."""
        ratio = sizes[:, :1].clamp_min(0.0).sqrt() * omega / (2.0 * torch.pi * 10.0)
        return as_complex(ratio.new_ones(()), ratio).reciprocal()


class NoiseFloor(ChannelEffect):
    """Noise power of the floors over the power of the base, in a table of |H|."""

    name = "noise_floor"
    title = "Noise floor"
    sentence = (
        "|H| was taken as a ratio of amplitudes, in which the noise of the floor sensors fills "
        "the anti-resonances."
    )
    clause = "The floor sensors' noise is {size} of the base motion"
    sits = "all floors together"
    settled_by = "FRFs estimated from the histories instead of a ratio of amplitudes"
    parameters = change("noise over base amplitude", 0.05, 0.0, 1.0)
    # H1 averages noise of the floors away; a ratio of amplitudes does not.
    tables_only = True

    def observe(self, frf: Tensor, omega: Tensor, sizes: Tensor, rows: tuple[int, ...]) -> Tensor:
        """|H|^2 + s^2, the phase kept."""
        size = frf.abs().clamp_min(1e-30)
        return frf * (1.0 + (sizes[:, :1, None] / size) ** 2).sqrt()
