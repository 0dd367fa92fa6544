"""Poles of output-only records by pyOMA2, and how far the record's parts scatter about them.

Covariance-driven stochastic subspace identification (Peeters and De Roeck 1999, Mech. Syst. Signal
Process. 13, 855). The covariance of the record's correlations comes from its blocks, and goes on to
the poles to first order, as Döhler and Mevel (2013, Mech. Syst. Signal Process. 38, 346) have it;
the derivatives along the blocks are differences, since each block moves a pole by a small share of
its standard deviation.
"""

import contextlib
import io
import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from femupdate.arrays import Complexes, Floats
from femupdate.errors import MeasurementError
from femupdate.measurement.thresholds import AMBIENT

_MISSING = (
    "modes of ambient records need the package pyOMA2; install it with pip install"
    " 'femupdate[ambient]'"
)


@dataclass(frozen=True, eq=False)
class Pole:
    """A pole of one model order.

    Attributes:
        order: of the model.
        frequency_hz: natural frequency.
        damping: ratio of critical damping.
        shape: (c,) complex; its largest component is 1.
    """

    order: int
    frequency_hz: float
    damping: float
    shape: Complexes


@dataclass(frozen=True, eq=False)
class Spread:
    """Standard deviations of a pole: frequency, Hz, damping ratio and real shape (c,)."""

    frequency_hz: float
    damping: float
    shape: Floats


class Subspace:
    """Identified models of every order of one record.

    Args:
        record: (c, n) histories about their means.
        time_step: s.
        rows: block rows: time lags of the correlations.
        order: the largest.
        blocks: of the record, whose scatter tells the standard deviations.

    Raises:
        MeasurementError: pyOMA2 is not installed.
    """

    def __init__(
        self, record: Floats, time_step: float, rows: int, order: int, blocks: int
    ) -> None:
        self._rows, self._step = rows, time_step
        with _library() as ssi:
            self._hankel, self._blocks = ssi.build_hank(record, record, rows, "cov", True, blocks)
            self._obs, self._a, self._c, _ = ssi.SSI_fast(self._hankel, rows, order)

    def poles(self) -> tuple[Pole, ...]:
        """Poles of every order that could be modes."""
        orders = range(2, len(self._a))
        return tuple(pole for order in orders for pole in self._of_order(order, self._a, self._c))

    def spreads(self, poles: Sequence[Pole]) -> tuple[Spread, ...]:
        """Standard deviations of some poles."""
        largest = max(pole.order for pole in poles)
        squares = [np.zeros(2 + pole.shape.size) for pole in poles]
        for block in self._blocks.T:
            moved = self._hankel + block.reshape(self._hankel.shape, order="F")
            with _library() as ssi:
                _, a, c, _ = ssi.SSI_fast(moved, self._rows, largest)
            perturbed = {order: self._of_order(order, a, c) for order in {p.order for p in poles}}
            for k, pole in enumerate(poles):
                squares[k] += _change(pole, perturbed[pole.order]) ** 2
        # A variance from so few blocks is uncertain itself: that of Student's t is larger by this.
        blocks = self._blocks.shape[1]
        wider = (blocks - 1.0) / (blocks - 3.0)
        roots = [np.sqrt(wider * each) for each in squares]
        return tuple(Spread(float(sd[0]), float(sd[1]), sd[2:]) for sd in roots)

    def _of_order(self, order: int, a: list[Any], c: list[Any]) -> tuple[Pole, ...]:
        with _library() as ssi:
            pair = [a[0], a[order]], [c[0], c[order]]
            results = ssi.SSI_poles(
                self._obs[:, :order], *pair, order, self._step, order, True, AMBIENT.largest_damping
            )
        frequency, damping, shape = results[0][:, 1], results[1][:, 1], results[2][:, 1]
        return tuple(
            Pole(order, float(frequency[k]), float(damping[k]), shape[k])
            for k in np.flatnonzero(np.isfinite(frequency) & np.isfinite(shape).all(axis=1))
        )


def _change(pole: Pole, moved: tuple[Pole, ...]) -> Floats:
    """Change of frequency, damping ratio and shape; infinite where the pole is there no longer.

    The shape is brought to the scale in which it changes least.
    """
    if not moved:
        return np.full(2 + pole.shape.size, np.inf)
    nearest = min(moved, key=lambda other: _distance(pole, other))
    before, length = pole.shape, np.vdot(pole.shape, pole.shape).real
    shape = nearest.shape * (length / np.vdot(before, nearest.shape))
    turn = np.exp(-0.5j * np.angle((before**2).sum()))
    change = ((shape - before) * turn).real
    figures = nearest.frequency_hz - pole.frequency_hz, nearest.damping - pole.damping
    return np.array([*figures, *change])


def _distance(first: Pole, second: Pole) -> float:
    away = np.hypot(
        np.log(first.frequency_hz / second.frequency_hz), first.damping - second.damping
    )
    return float(away) + 1.0 - mac(first.shape, second.shape)


def mac(first: Complexes, second: Complexes) -> float:
    """Modal assurance criterion of two shapes (c,)."""
    length = float(np.vdot(first, first).real * np.vdot(second, second).real)
    return float(np.abs(np.vdot(first, second)) ** 2 / length) if length > 0.0 else 0.0


@contextlib.contextmanager
def _library() -> Iterator[Any]:
    """pyOMA2's functions, without its log and its bars."""
    with np.errstate(all="ignore"), contextlib.redirect_stderr(io.StringIO()):
        try:
            from pyoma2.functions import ssi
        except ImportError:
            raise MeasurementError(_MISSING) from None
        logging.getLogger("pyoma2").setLevel(logging.ERROR)
        yield ssi
