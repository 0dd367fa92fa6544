"""What a model still misses once its parameters are found: how much, and where."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch

from femupdate.discrepancy.fit import Fit
from femupdate.discrepancy.problem import Problem
from femupdate.measurement.bands import band_edges


@dataclass(frozen=True)
class Remains:
    """The error of a model beside noise, as its likeliest values have it.

    Attributes:
        size: rms over all points, in ln|H|; zero where none is likely.
        turn: the same of the phase, rad; zero where none was compared.
        floor, band_hz: where it is largest.
        there: rms in ln|H| there.
        noise: of the data, over the stated one.
    """

    size: float
    turn: float
    floor: str
    band_hz: tuple[float, float]
    there: float
    noise: float

    def as_dict(self) -> dict[str, float | str | list[float]]:
        """For files: the share of the response, and where most of it is."""
        return {
            "share": float(np.expm1(self.size)),
            "phase_rad": self.turn,
            "floor": self.floor,
            "band_hz": list(self.band_hz),
            "share_there": float(np.expm1(self.there)),
            "noise_over_stated": self.noise,
        }

    @property
    def sentence(self) -> str:
        """How much and where, for an engineer."""
        noise = f"The noise is {self.noise:.1f} times the stated one." if self.noise > 1.0 else ""
        if self.size == 0.0:
            return noise
        turn = f" and {np.degrees(self.turn):.1f} degrees in phase" if self.turn else ""
        low, high = self.band_hz
        text = (
            f"The model is still off by {np.expm1(self.size):.0%} in amplitude{turn} (rms), most "
            f"at {self.floor} between {low:.3g} and {high:.3g} Hz ({np.expm1(self.there):.0%})."
        )
        return f"{text} {noise}".rstrip()


def remains(problem: Problem, fitted: Fit) -> Remains:
    """What a fit leaves beside noise, by the row of the table of errors that it took for true."""
    level = fitted.problem.level
    if level.common == level.own == 0.0:
        return Remains(0.0, 0.0, "", (0.0, 0.0), 0.0, level.noise)
    error, row = fitted.problem.error, fitted.problem.row
    found = error.likeliest(error.tame(fitted.raw[None], row), row)[0]  # (p f, j)
    values = found @ error.harmonics.at(problem.frequency_hz).T
    parts = values.unflatten(0, (-1, len(problem.rows))).numpy()  # (p, f, k)
    valid = torch.isfinite(problem.sd).numpy()
    frequency = problem.frequency_hz.numpy()
    worst = (0.0, 0, (float(frequency.min()), float(frequency.max())))
    for low, high in pairwise(band_edges(frequency)):
        inside = (frequency >= low) & (frequency < high)
        for row_number in range(len(problem.rows)):
            own = parts[0, row_number, inside & valid[row_number]]
            if own.size:
                worst = max(worst, (_rms(own), row_number, (float(low), float(high))))
    floor = problem.reduced.model.floors[problem.rows[worst[1]]]
    turn = _rms(parts[1, valid]) if len(parts) > 1 else 0.0
    return Remains(_rms(parts[0, valid]), turn, floor, worst[2], worst[0], level.noise)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).mean()))
