"""A rival that knows nothing of structures: impulse responses from the base to each floor.

Ridge regression of measured floors on the base; every event counts alike, and the penalty grows
along the taps. Its band is the part of the local strength that it misses in its own events.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import convolution_matrix, solve
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter
from scipy.special import ndtr

from femupdate.arrays import Floats
from femupdate.measurement import Histories

from .free_fit import channels

_LENGTH_S = 2.0
_PENALTY = 0.01  # of the base's power at the middle of the taps; .003 to .1 make no difference
_LOCAL_S = 2.0  # over which the strength of a motion is measured


@dataclass(frozen=True)
class ImpulseFilter:
    """Impulse responses (f, taps) of the floors against the base, and their band (f,)."""

    taps: Floats
    missed: Floats

    def scores(self, measured: Histories, direction: str) -> tuple[Floats, Floats]:
        """Error rms and continuous ranked probability score (f,), both over the rms measured."""
        base, floors = channels(measured, direction)
        answer = self.answer(base)
        rms = np.sqrt(np.square(floors).mean(axis=1))
        sd = self.missed[:, None] * _strength(answer, measured.time_step) + 1e-12
        away = (floors - answer) / sd
        density = np.exp(-0.5 * away**2) / np.sqrt(2.0 * np.pi)
        # Gneiting and Raftery 2007, JASA 102, 359, eq. 21.
        score = sd * (away * (2.0 * ndtr(away) - 1.0) + 2.0 * density - 1.0 / np.sqrt(np.pi))
        error = np.sqrt(np.square(answer - floors).mean(axis=1))
        return error / rms, score.mean(axis=1) / rms

    def answer(self, base: Floats) -> Floats:
        """Floors (f, n) under a motion (1, n) of the base."""
        return np.array([base[0] + lfilter(row, [1.0], base[0]) for row in self.taps])


def fit_filter(events: Sequence[Histories], direction: str) -> ImpulseFilter:
    """Fit impulse responses to events with the same floors and time step."""
    step = events[0].time_step
    count = round(_LENGTH_S / step)
    growing = 3.0 * np.linspace(0.0, 1.0, count) ** 2 + 1e-6
    gram, seen = _PENALTY * np.diag(growing), np.zeros(())
    pairs = [channels(event, direction) for event in events]
    for base, floors in pairs:
        delayed = convolution_matrix(base[0], count)[: base.shape[1]]
        power = np.square(base).sum() * len(pairs)
        gram = gram + delayed.T @ delayed / power
        seen = seen + delayed.T @ (floors - base).T / power
    taps = solve(gram, seen, assume_a="pos").T
    plain = ImpulseFilter(taps, np.zeros(len(taps)))
    squares = []
    for base, floors in pairs:
        answer = plain.answer(base)
        squares.append(np.square((floors - answer) / _strength(answer, step)).mean(axis=1))
    return ImpulseFilter(taps, np.sqrt(np.mean(squares, axis=0)))


def _strength(values: Floats, step: float) -> Floats:
    """Rms over the neighbourhood (f, n), at least a hundredth of the largest."""
    power = uniform_filter1d(np.square(values), round(_LOCAL_S / step), axis=1, mode="nearest")
    local = np.sqrt(power)
    return np.asarray(np.maximum(local, 0.01 * local.max(axis=1, keepdims=True)))
