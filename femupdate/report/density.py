"""Smooth densities of posterior samples for drawing."""

from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats

CELLS = 80
_QUARTER = 2.0 * 0.31864  # of a normal's sd: the shortest interval with a quarter of its mass


@dataclass(frozen=True)
class Density:
    """A smoothed histogram on a grid; `x` (and `y`) are the centres of its cells."""

    x: Floats
    y: Floats
    value: Floats


def bandwidth(samples: Floats, dimensions: int) -> float:
    """Width of the smoothing kernel by Scott's rule (1992), from the spread of the narrowest mode.

    Separate modes have a standard deviation that says how far apart they lie, not how wide they
    are: the shortest interval with a quarter of the samples (0.637 sd of a normal) does.
    """
    ordered = np.sort(samples)
    quarter = max(1, len(ordered) // 4)
    shortest = float((ordered[quarter:] - ordered[:-quarter]).min()) / _QUARTER
    spread = min(ordered.std(), shortest) or ordered.std()
    return float(spread * len(samples) ** (-1.0 / (dimensions + 4)))


def density_1d(samples: Floats, limits: tuple[float, float]) -> Density:
    """Density of samples (S,), mirrored at the limits so that it does not sink at a bound."""
    from scipy.ndimage import gaussian_filter1d

    cells = 4 * CELLS
    counts, edges = np.histogram(samples, cells, range=limits)
    width = bandwidth(samples, 1) * cells / (limits[1] - limits[0])
    smooth = gaussian_filter1d(counts.astype(float), max(width, 1.0), mode="reflect")
    return Density(_centres(edges), np.zeros(0), smooth / max(smooth.sum(), 1e-300))


def density_2d(
    x: Floats, y: Floats, across: tuple[float, float], up: tuple[float, float]
) -> Density:
    """Density of pairs (S,); `value` is (CELLS, CELLS) with y along its first axis."""
    from scipy.ndimage import gaussian_filter

    counts, y_edges, x_edges = np.histogram2d(y, x, CELLS, range=(up, across))
    widths = [
        max(bandwidth(values, 2) * CELLS / (limits[1] - limits[0]), 1.0)
        for values, limits in ((y, up), (x, across))
    ]
    smooth = gaussian_filter(counts, widths, mode="reflect")
    return Density(_centres(x_edges), _centres(y_edges), smooth / max(smooth.sum(), 1e-300))


def mass_level(value: Floats, share: float) -> float:
    """Level above which the smallest region lies that holds this share of the density."""
    ordered = np.sort(value, axis=None)[::-1]
    held = np.cumsum(ordered) / ordered.sum()
    return float(ordered[min(int(np.searchsorted(held, share)), len(ordered) - 1)])


def _centres(edges: Floats) -> Floats:
    return 0.5 * (edges[1:] + edges[:-1])
