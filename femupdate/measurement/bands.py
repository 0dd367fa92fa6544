"""Frequency bands in which floors are compared."""

import numpy as np

from femupdate.arrays import Floats
from femupdate.measurement.thresholds import SPECTRUM


def band_edges(frequency_hz: Floats) -> Floats:
    """Edges (bands + 1,) Hz, a third of an octave or wider, over the upper part of the grid."""
    bottom, top = float(frequency_hz.min()), float(frequency_hz.max())
    edges = np.geomspace(max(bottom, top / 64.0), top * 1.0001, SPECTRUM.bands + 1)
    edges[0] = bottom
    return edges
