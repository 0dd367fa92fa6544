"""A prediction against floors that were measured in the same motion."""

from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats
from femupdate.dynamics.summary import HistorySummary
from femupdate.tables import table


@dataclass(frozen=True)
class Comparison:
    """Prediction against floors that were measured in the same motion.

    Attributes:
        floors: that were measured.
        relative_error: (f,) rms of mean prediction less measurement over rms of the measurement.
        correlation: (f,) of the two histories.
        peak_ratio: (f,) peak of the mean prediction over the measured peak.
        within_band: (f,) share of the instants at which the measurement lies within 2 sd.
    """

    floors: tuple[str, ...]
    relative_error: Floats
    correlation: Floats
    peak_ratio: Floats
    within_band: Floats

    def as_dict(self) -> dict[str, dict[str, float]]:
        """The figures of every floor."""
        return {
            floor: {
                "relative_error": float(self.relative_error[k]),
                "correlation": float(self.correlation[k]),
                "peak_ratio": float(self.peak_ratio[k]),
                "within_band": float(self.within_band[k]),
            }
            for k, floor in enumerate(self.floors)
        }

    def table(self) -> str:
        """The figures of every floor, a line each."""
        rows = [
            (floor, *(f"{v:.3f}" for v in values), f"{share:.1%}")
            for floor, (*values, share) in (
                (floor, own.values()) for floor, own in self.as_dict().items()
            )
        ]
        return table(
            ("against measured", "error rms", "correlation", "peak ratio", "within 2 sd"), rows
        )


def compare(summary: HistorySummary, measured: Floats) -> Comparison:
    """Mean prediction against measured floor accelerations (f, n), NaN for floors without any."""
    seen = np.isfinite(measured).all(axis=1)
    mean, sd, truth = summary.acceleration_mean[seen], summary.acceleration_sd[seen], measured[seen]
    error = np.sqrt(((mean - truth) ** 2).mean(axis=1) / (truth**2).mean(axis=1))
    correlation = (mean * truth).sum(axis=1) / np.sqrt(
        (mean**2).sum(axis=1) * (truth**2).sum(axis=1)
    )
    return Comparison(
        tuple(summary.floors[row] for row in np.flatnonzero(seen)),
        error,
        correlation,
        np.abs(mean).max(axis=1) / np.abs(truth).max(axis=1),
        (np.abs(mean - truth) <= 2.0 * sd).mean(axis=1),
    )
