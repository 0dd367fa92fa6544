"""A prediction against floors that were measured in the same motion."""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from scipy.special import ndtr

from femupdate.arrays import Flags, Floats
from femupdate.dynamics.summary import HistorySummary
from femupdate.tables import Table
from femupdate.units import percent


@dataclass(frozen=True)
class Comparison:
    """Prediction against floors that were measured in the same motion.

    Attributes:
        floors: that were measured.
        relative_error: (f,) rms of the best estimate less measurement over rms of the measurement.
        correlation: (f,) of the two histories.
        peak_ratio: (f,) peak of the best estimate over the measured peak.
        within_band: (f,) share of the instants at which the measurement lies within 2 sd.
        score: (f,) continuous ranked probability score over the rms of the measurement, the lower
            the better: what bands cost that are too wide as well as too narrow.
        peak_within: (f,) whether the measured peak lies in its 90 % interval.
    """

    floors: tuple[str, ...]
    relative_error: Floats
    correlation: Floats
    peak_ratio: Floats
    within_band: Floats
    score: Floats
    peak_within: Flags

    def as_dict(self) -> dict[str, dict[str, float]]:
        """The figures of every floor."""
        names = [field.name for field in fields(self) if field.name != "floors"]
        return {
            floor: {name: getattr(self, name)[k].item() for name in names}
            for k, floor in enumerate(self.floors)
        }


def score_table(kept: Mapping[str, Mapping[str, float]]) -> Table:
    """What `Comparison.as_dict` holds."""
    rows = [
        (
            floor,
            *(f"{own[name]:.3f}" for name in ("relative_error", "correlation", "peak_ratio")),
            percent(own["within_band"], 1),
            f"{own['score']:.3f}",
            "yes" if own["peak_within"] else "no",
        )
        for floor, own in kept.items()
    ]
    head = ("floor", "error rms", "correlation", "peak ratio", "within 2 sd", "CRPS/rms")
    return Table.of(
        (*head, "peak in 90 %"),
        rows,
        name="scores",
        caption="Against floors measured in the same motion",
        note="Error rms: of the best estimate, over the rms of the measurement. CRPS/rms: score of "
        "the whole band, the lower the better. A good band holds some 95 % of the samples.",
        corner="against measured",
    )


def compare(summary: HistorySummary, alone: HistorySummary, measured: Floats) -> Comparison:
    """Predictions against measured floor accelerations (f, n), NaN for floors without any.

    Args:
        alone: of the parameters alone, whose mean is the best estimate.
    """
    seen = np.isfinite(measured).all(axis=1)
    mean, sd, truth = summary.acceleration_mean[seen], summary.acceleration_sd[seen], measured[seen]
    best = alone.acceleration_mean[seen]
    error = np.sqrt(((best - truth) ** 2).mean(axis=1) / (truth**2).mean(axis=1))
    correlation = (best * truth).sum(axis=1) / np.sqrt(
        (best**2).sum(axis=1) * (truth**2).sum(axis=1)
    )
    return Comparison(
        tuple(summary.floors[row] for row in np.flatnonzero(seen)),
        error,
        correlation,
        np.abs(best).max(axis=1) / np.abs(truth).max(axis=1),
        (np.abs(mean - truth) <= 2.0 * sd).mean(axis=1),
        _score(mean, sd, truth),
        _inside(summary.peak_acceleration[:, seen], np.abs(truth).max(axis=1)),
    )


def _score(mean: Floats, sd: Floats, truth: Floats) -> Floats:
    """Mean score of normal bands (Gneiting and Raftery 2007, JASA 102, 359, eq. 21), over rms."""
    wide = np.maximum(sd, 1e-12 * np.abs(truth).max())
    away = (truth - mean) / wide
    density = np.exp(-0.5 * away**2) / np.sqrt(2.0 * np.pi)
    each = wide * (away * (2.0 * ndtr(away) - 1.0) + 2.0 * density - np.pi**-0.5)
    return np.asarray(each.mean(axis=1) / np.sqrt((truth**2).mean(axis=1)))


def _inside(peaks: Floats, measured: Floats) -> Flags:
    low, high = np.quantile(peaks, [0.05, 0.95], axis=0)
    return np.asarray((low <= measured) & (measured <= high))
