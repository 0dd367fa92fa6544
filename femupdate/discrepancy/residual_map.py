"""Where model and measurement disagree: floors and bands in which residuals exceed the noise."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.stats import chi2

from femupdate.arrays import Flags, Floats
from femupdate.discrepancy.fit import Fit
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.thresholds import SCREEN
from femupdate.measurement.bands import band_edges


@dataclass(frozen=True)
class Cell:
    """One floor in one band.

    Attributes:
        floor: its name.
        band_hz: the band.
        excess: mean squared whitened residual less one; zero when only noise is left, and where
            there are too few points to tell.
        p_value: of noise alone leaving as much.
    """

    floor: str
    band_hz: tuple[float, float]
    excess: float
    p_value: float


def residual_cells(problem: Problem, fitted: Fit) -> tuple[Cell, ...]:
    """Mean squared residual of every observed floor in bands of equal width in log frequency."""
    squared, valid = _squared(problem, fitted)
    frequency = problem.frequency_hz.numpy()
    edges, weight = band_edges(frequency), problem.independent.numpy()
    cells: list[Cell] = []
    for row, seen, number in zip(squared, valid, problem.rows, strict=True):
        for low, high in pairwise(edges):
            inside = seen & (frequency >= low) & (frequency < high)
            count = int(inside.sum()) * (2 if problem.phase is not None else 1)
            total = float(row[inside].sum())
            freedom = count * float(weight[inside].mean()) if count else 0.0
            # The last points before coherence is lost were chosen by chance: too few say nothing.
            enough = freedom >= SCREEN.cell_points
            tail = float(chi2.sf(total, freedom)) if enough else 1.0
            mean = total / freedom if enough else 1.0
            floor = problem.reduced.model.floors[number]
            cells.append(Cell(floor, (float(low), float(high)), mean - 1.0, tail))
    return tuple(cells)


def p_value(problem: Problem, fitted: Fit) -> float:
    """Probability that noise alone leaves residuals as large as these."""
    freedom = max(problem.effective - fitted.coordinates.size, 1.0)
    return float(chi2.sf(fitted.chi2, freedom))


def _squared(problem: Problem, fitted: Fit) -> tuple[Floats, Flags]:
    """Squared residuals (f, k), amplitude and phase together, and which points are valid."""
    floors, points = problem.log_frf.shape
    parts = 1 if problem.phase is None else 2
    residual = fitted.left[: parts * floors * points].reshape(-1, floors, points).numpy()
    return (residual**2).sum(axis=0), np.isfinite(problem.sd.numpy())
