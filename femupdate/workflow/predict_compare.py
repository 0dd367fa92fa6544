"""A prediction against floors that were measured in the same motion."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.dynamics.summary import HistorySummary
from femupdate.errors import MeasurementError
from femupdate.measurement.observation_file import Histories as MeasuredHistories
from femupdate.measurement.observation_file import read_observation_file
from femupdate.measurement.record import GroundMotion
from femupdate.tables import table
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import observed_direction
from femupdate.workflow.predict_settings import RecordSource


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


def measured_floors(
    model: StudyModel,
    path: Path,
    columns: Mapping[str, str] | None,
    record: RecordSource,
    motion: GroundMotion,
) -> Floats:
    """Measured floor accelerations (f, n), sensors averaged, NaN for floors without any.

    Raises:
        MeasurementError: the file cannot be used, or is not of the record's motion.
    """
    data = read_observation_file(path, record.unit, columns)
    if not isinstance(data, MeasuredHistories):
        raise MeasurementError(f"{path}: a comparison needs histories (a column time_s)")
    count = motion.acceleration.size
    same = abs(data.time_step - motion.time_step) < 1e-6 * motion.time_step
    if not same or data.acceleration.shape[1] != count:
        raise MeasurementError(
            f"{path}: {data.acceleration.shape[1]} samples every {data.time_step:g} s do not match "
            f"the record's {count} every {motion.time_step:g} s; take both from one recording"
        )
    direction = observed_direction(model)
    rows = np.full((len(model.reduced.floors), count), np.nan)
    for place, floor in enumerate(model.reduced.floors):
        own = [
            row
            for row, channel in enumerate(data.channels)
            if channel.floor == floor and channel.direction == direction
        ]
        if own:
            rows[place] = data.acceleration[own].mean(axis=0) * record.scale
    if np.isnan(rows).all():
        raise MeasurementError(
            f"{path}: none of its floors ({', '.join(data.floors)}) belongs to the building "
            f"({', '.join(model.reduced.floors)})"
        )
    return rows


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
