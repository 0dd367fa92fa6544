"""Bands, peaks and story stiffness of many histories, and how they compare with measured floors."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr

from femupdate.arrays import Floats
from femupdate.dynamics.history import ResponseHistories, join_histories
from femupdate.errors import StructureError
from femupdate.tables import Table
from femupdate.units import percent

_HISTORIES = ("floor_acceleration", "story_shear", "story_drift")


@dataclass(frozen=True)
class Statistics:
    """Mean, standard deviation, 5 % and 95 % quantile over the samples, each of shape (...)."""

    mean: Floats
    sd: Floats
    q05: Floats
    q95: Floats

    def by_name(self, names: Sequence[str]) -> dict[str, dict[str, Any]]:
        """Mean and quantiles along the first axis by names, as JSON holds them."""
        rows = zip(names, self.mean.tolist(), self.q05.tolist(), self.q95.tolist(), strict=True)
        return {name: {"mean": mean, "q05": q05, "q95": q95} for name, mean, q05, q95 in rows}


@dataclass(frozen=True)
class HistorySummary:
    """What is worth keeping of the histories of S samples."""

    floors: tuple[str, ...]  # names of the f floors
    acceleration_mean: Floats  # (f, n) floor acceleration over the samples, m/s2
    acceleration_sd: Floats
    peak_acceleration: Floats  # (S, f) largest absolute floor acceleration, m/s2
    peak_shear: Floats  # (S, s) N
    peak_drift: Floats  # (S, s) m
    story_stiffness: Floats  # (S, s) least-squares slope of shear against drift, N/m
    examples: ResponseHistories  # whole histories of the first samples, for drawing

    def __len__(self) -> int:
        return len(self.peak_acceleration)

    @property
    def time(self) -> Floats:
        """The n instants, s."""
        return self.examples.time


def statistics(values: ArrayLike) -> Statistics:
    """Statistics over the first axis of values (S, ...); the sd of a single sample is 0."""
    array = np.asarray(values, dtype=float)
    q05, q95 = np.quantile(array, [0.05, 0.95], axis=0)
    sd = np.sqrt(array.var(axis=0) * len(array) / max(len(array) - 1, 1))
    return Statistics(array.mean(axis=0), sd, q05, q95)


def summarise(
    histories: ResponseHistories | Iterable[ResponseHistories], examples: int = 100
) -> HistorySummary:
    """Summarise histories batch by batch, such as those of `history_batches`.

    Args:
        histories: one or many batches of the same model and record.
        examples: how many samples to keep whole, one at least.

    Raises:
        StructureError: a story does not drift (a base at rest).
    """
    count, mean, squares = 0, np.zeros(()), np.zeros(())
    rows: list[tuple[Floats, ...]] = []
    kept: list[ResponseHistories] = []
    for batch in [histories] if isinstance(histories, ResponseHistories) else histories:
        moved, before = batch.floor_acceleration, count
        # Moments of both together, without cancellation (Chan, Golub and LeVeque 1979).
        count += len(moved)
        shift = moved.mean(axis=0) - mean
        mean = mean + shift * (len(moved) / count)
        squares = (
            squares + moved.var(axis=0) * len(moved) + shift**2 * (before * len(moved) / count)
        )
        of_story = story_stiffness(batch.story_shear, batch.story_drift)
        peaks = (batch.floor_acceleration, batch.story_shear, batch.story_drift)
        of_peaks = (np.maximum(part.max(axis=-1), -part.min(axis=-1)) for part in peaks)
        rows.append((*of_peaks, of_story))
        room = max(examples, 1) - sum(len(k) for k in kept)
        if room > 0:
            # Views would keep the whole batch in memory.
            parts = {name: getattr(batch, name)[:room].copy() for name in _HISTORIES}
            kept.append(replace(batch, **parts))
    floors, shear, drift, stiffness = (np.concatenate(part) for part in zip(*rows, strict=True))
    whole = join_histories(kept)
    sd = np.sqrt(squares / max(count - 1, 1))
    return HistorySummary(whole.floors, mean, sd, floors, shear, drift, stiffness, whole)


def story_stiffness(shear: Floats, drift: Floats) -> Floats:
    """Return the stiffness of every story, N/m: the least-squares slope of shear against drift.

    Both are taken about their mean, so that an offset of a measured drift does no harm.

    Raises:
        StructureError: a story does not move.
    """
    shear, drift = np.asarray(shear, dtype=float), np.asarray(drift, dtype=float)
    centred = drift - drift.mean(axis=-1, keepdims=True)
    power = np.einsum("...n,...n->...", centred, centred)
    if not np.all(power > 0.0):
        story = int(np.argwhere(np.atleast_1d(~(power > 0.0)))[0][-1]) + 1
        raise StructureError(
            f"story {story} does not drift, so shear against drift has no slope; "
            "is the base acceleration zero?"
        )
    return np.einsum("...n,...n->...", shear, centred) / power


def score_table(kept: Mapping[str, Mapping[str, float]]) -> Table:
    """What `compare` gives."""
    rows = [
        (
            floor,
            *(f"{scores[name]:.3f}" for name in ("relative_error", "correlation", "peak_ratio")),
            percent(scores["within_band"], 1),
            f"{scores['score']:.3f}",
            "yes" if scores["peak_within"] else "no",
        )
        for floor, scores in kept.items()
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


def compare(
    summary: HistorySummary, estimate: Floats, measured: Floats
) -> dict[str, dict[str, float]]:
    """Predictions against measured floor accelerations (f, n), NaN for floors without any.

    Args:
        summary: of the next measurement.
        estimate: (f, n) the best one, of what is known of building and model.

    Returns:
        Scores of every floor that was measured. `relative_error` is the rms of estimate less
        measurement over that of the measurement, and `correlation` that of the two histories;
        `peak_ratio` is of their peaks, `within_band` the share of instants at which the measurement
        lies within 2 sd, and `peak_within` whether its peak lies in the 90 % interval. `score` is
        the continuous ranked probability score over the rms of the measurement, the lower the
        better: what bands cost that are too wide as well as too narrow.
    """
    seen = np.isfinite(measured).all(axis=1)
    mean, sd, truth = summary.acceleration_mean[seen], summary.acceleration_sd[seen], measured[seen]
    best = estimate[seen]
    error = np.sqrt(((best - truth) ** 2).mean(axis=1) / (truth**2).mean(axis=1))
    correlation = (best * truth).sum(axis=1) / np.sqrt(
        (best**2).sum(axis=1) * (truth**2).sum(axis=1)
    )
    # Score of normal bands (Gneiting and Raftery 2007, JASA 102, 359, eq. 21).
    wide = np.maximum(sd, 1e-12 * np.abs(truth).max())
    away = (truth - mean) / wide
    density = np.exp(-0.5 * away**2) / np.sqrt(2.0 * np.pi)
    score = wide * (away * (2.0 * ndtr(away) - 1.0) + 2.0 * density - np.pi**-0.5)
    peak = np.abs(truth).max(axis=1)
    low, high = np.quantile(summary.peak_acceleration[:, seen], [0.05, 0.95], axis=0)
    columns = {
        "relative_error": error,
        "correlation": correlation,
        "peak_ratio": np.abs(best).max(axis=1) / peak,
        "within_band": (np.abs(mean - truth) <= 2.0 * sd).mean(axis=1),
        "score": np.asarray(score.mean(axis=1) / np.sqrt((truth**2).mean(axis=1))),
        "peak_within": (low <= peak) & (peak <= high),
    }
    return {
        summary.floors[row]: {name: values[k].item() for name, values in columns.items()}
        for k, row in enumerate(np.flatnonzero(seen))
    }
