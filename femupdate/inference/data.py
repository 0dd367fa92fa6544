"""What every kind of observation tells of a model, whatever was measured."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from torch import Tensor

from femupdate.dynamics.system import System
from femupdate.effects.effect import Effect, Placed
from femupdate.inference.model_error import LearnedError

WILD = 8.0  # sd of error and noise beyond which a residual counts no more


@dataclass(frozen=True)
class Cell:
    """A part of the data whose residuals are told together.

    Attributes:
        floor: its name, or what else was compared.
        excess: mean squared whitened residual less one; zero when only noise is left, and where
            there are too few points to tell.
        p_value: of noise alone leaving as much.
        data: the kind of observation; empty for FRFs under base motion.
    """

    floor: str
    band_hz: tuple[float, float]
    excess: float
    p_value: float
    data: str = ""


@dataclass(frozen=True)
class Remains:
    """The error of a model beside noise, as its likeliest values have it.

    Attributes:
        size: rms over all points, in ln|H|, or of what else was compared; zero where none is
            likely.
        turn: the same of the phase, rad; zero where none was compared.
        floor, band_hz: where it is largest.
        there: rms there, like the size.
        noise: of the data, over the stated one.
        sentence: how much and where, for an engineer.
    """

    size: float = 0.0
    turn: float = 0.0
    floor: str = ""
    band_hz: tuple[float, float] = (0.0, 0.0)
    there: float = 0.0
    noise: float = 1.0
    sentence: str = ""

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


class Data(Protocol):
    """One kind of observation of a building.

    Predictions are tensors (N, ...) of the kind's own shape; residuals are (N, n), observed less
    predicted, in the unit of the noise, and zero where nothing was observed.
    """

    @property
    def name(self) -> str:
        """What it is; empty for FRFs under base motion, of which nothing need be said."""
        ...

    @property
    def at_once(self) -> int:
        """Points whose predictions and residuals are made at a time."""
        ...

    @property
    def rows(self) -> tuple[int, ...]:
        """Which floors of the model have a sensor."""
        ...

    @property
    def residuals(self) -> int:
        """Number n of residuals, those included that stay zero."""
        ...

    @property
    def points(self) -> int:
        """Number of numbers compared."""
        ...

    @property
    def effective(self) -> float:
        """Number of them that err independently."""
        ...

    @property
    def top_hz(self) -> float:
        """The highest frequency."""
        ...

    @property
    def levels(self) -> tuple[float, ...]:
        """Of motion, one a record, in doublings of the amplitude above the first."""
        ...

    @property
    def halves(self) -> "tuple[Data, ...]":
        """The data in two parts that err independently; none where they cannot be parted."""
        ...

    def checked(self, squares: Tensor, wild: Tensor) -> list[tuple[str, Tensor, Tensor]]:
        """Name, squares (n,), and independent numbers (n,), of each that is checked apart.

        Args:
            squares: (n, f) of `LearnedError.floor_squares`.
            wild: (n, m) residuals that are not in them, likewise.
        """
        ...

    def shows(self, effect: Effect) -> bool:
        """Whether an effect can show in it at all."""
        ...

    def error(self, known: Tensor | None) -> LearnedError:
        """What the model may err by, beside errors (c, n) that are known beforehand."""
        ...

    def predicted(self, system: System, theta: Tensor, zeta: Tensor, sizes: Tensor) -> Tensor:
        """What is expected (N, ...) at theta (N, p), zeta (N,) and sizes (N, q)."""
        ...

    def read_with(self, predicted: Tensor, placed: Placed) -> Tensor:
        """Predictions as they read with channels exchanged or reversed."""
        ...

    def compared(self, predicted: Tensor) -> Tensor:
        """Residuals (N, n) of predictions."""
        ...

    def moved(self, from_: Tensor, to: Tensor) -> Tensor:
        """Change (N, n) from one prediction (1, ...) to others, in the unit of the residuals."""
        ...

    def by_floor(self, moved: Tensor) -> Tensor:
        """A change (n,) of what all floors show of a mode, of each of them alone (f, n)."""
        ...

    def coarse(self, noise: float) -> "Data":
        """The same with so much more noise, in ln|H| or as a share."""
        ...

    def emptied(self) -> "Data":
        """The same as if nothing had been observed."""
        ...

    def cells(self, left: Tensor) -> tuple[Cell, ...]:
        """Where residuals (n,), whitened by the noise alone, are large."""
        ...

    def remains(self, error: LearnedError, row: int, raw: Tensor) -> Remains:
        """What residuals (n,) hold beside noise, by a row of the table of errors."""
        ...

    def changed(self, from_: Tensor, to: Tensor, instrument: bool) -> float:
        """Largest change of a floor's reading from one prediction to another, as a share."""
        ...
