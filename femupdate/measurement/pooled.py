"""Several runs of the same building made into one observation.

Runs err independently, so that their likelihoods multiply. Each is Gaussian in ln|H|, and so is the
product: with the precision w_r of run r at a point,

    sum_r w_r (y_r - h)^2 = W (y - h)^2 + sum_r w_r (y_r - y)^2, W = sum_r w_r, W y = sum_r w_r y_r.

The last sum is the same for all models; the observation keeps it as `scatter`, for the evidence.
"""

from collections.abc import Sequence

import numpy as np

from femupdate.arrays import Complexes, Floats
from femupdate.errors import MeasurementError
from femupdate.measurement.estimated import mean_estimator
from femupdate.measurement.observation import (
    Observation,
    independent_share,
    on_all_floors,
    resolved_share,
)

_TINY = float(np.finfo(np.float64).tiny)


def pooled(runs: Sequence[Observation], floors: Sequence[str]) -> Observation:
    """One observation whose likelihood is the product of those of several runs.

    It has the floors of any run. A point is the mean of the runs in which it is valid (where it is
    in none, of all estimates that there are), weighted by their precision: the share of points that
    err independently over the squared noise. Its noise is such that its precision is the sum of
    theirs. The phase is the circular mean, where every run has one.

    Runs of unequal resolution get one between them, which keeps the second moment of their windows,
    to which the blunting of a peak is proportional; the noise makes up for what that changes in the
    share of independent points. Tables blunt nothing.

    Args:
        runs: on one frequency grid; one alone is returned as it is.
        floors: of the building, bottom to top.

    Raises:
        MeasurementError: there is no run, or their grids differ.
    """
    _require_one_grid(runs)
    if len(runs) == 1:
        return runs[0]
    names = [name for name in floors if any(name in run.floors for run in runs)]
    wide = [on_all_floors(run, names) for run in runs]
    weight = _weights(wide)
    resolution = _resolution(wide, weight.sum(axis=(1, 2)))
    grid, estimated = wide[0].frequency_hz, any(run.coherence is not None for run in runs)
    precision = weight / resolved_share(grid, resolution, estimated=estimated)
    total, values = precision.sum(axis=0), np.stack([run.log_frf for run in wide])
    mean = _mean(values, precision)
    deviation = np.where(precision > 0.0, values - mean, 0.0)
    return Observation(
        frequency_hz=wide[0].frequency_hz,
        floors=tuple(names),
        log_frf=mean,
        noise_sd=np.where(total > 0.0, np.maximum(total, _TINY) ** -0.5, np.nan),
        valid=np.asarray(np.stack([run.valid for run in wide]).any(axis=0)),
        phase=_phase(wide, precision),
        coherence=_coherence(wide, precision),
        resolution_hz=resolution,
        source=", ".join(run.source for run in runs),
        scatter=(precision * deviation**2).sum(axis=0),
        estimator=mean_estimator([run.estimator for run in runs], _shares(precision), grid),
        rotation=_rotation(runs, _shares(precision)),
        excitation=max((run.excitation for run in runs), key=lambda one: one.turns),
    )


def _rotation(runs: Sequence[Observation], shares: Floats) -> Complexes | None:
    """Mean (m,) by the runs' shares (r, m); a run that measured none did not turn."""
    if all(run.rotation is None for run in runs):
        return None
    none = np.zeros(shares.shape[1], dtype=np.complex128)
    own = np.stack([none if run.rotation is None else run.rotation for run in runs])
    return np.asarray((shares * np.nan_to_num(own)).sum(axis=0))


def _require_one_grid(runs: Sequence[Observation]) -> None:
    if not runs:
        raise MeasurementError("there is no run to pool; give one at least")
    for run in runs[1:]:
        if not np.array_equal(run.frequency_hz, runs[0].frequency_hz):
            raise MeasurementError(
                f"{run.source} is on another frequency grid than {runs[0].source}; bring both to "
                "the building's"
            )


def _weights(runs: Sequence[Observation]) -> Floats:
    """Precision (r, f, m) with which every run counts at a point; zero where it does not."""
    valid = np.stack([run.valid for run in runs])
    noise = np.stack([run.noise_sd for run in runs])
    there = np.isfinite(np.stack([run.log_frf for run in runs])) & np.isfinite(noise) & (noise > 0)
    used = np.where(valid.any(axis=0), valid, there)
    share = np.array([independent_share(run) for run in runs])[:, None, None]
    return np.where(used, share / np.where(used, noise, 1.0) ** 2, 0.0)


def _resolution(runs: Sequence[Observation], weight: Floats) -> float | None:
    """Resolution between those of the runs, which count by their weight (r,)."""
    if all(run.resolution_hz is None for run in runs):
        return None
    spacing = float(np.median(np.diff(runs[0].frequency_hz)))
    estimated = any(run.coherence is not None for run in runs)
    widths = [
        0.0 if estimated and run.coherence is None else run.resolution_hz or spacing for run in runs
    ]
    return float(np.sqrt(weight @ np.square(widths) / weight.sum()))


def _shares(precision: Floats) -> Floats:
    """Share (r, m) of every run in all floors together; alike where there is nothing."""
    of_run = precision.sum(axis=1)
    total = of_run.sum(axis=0)
    return np.where(total > 0.0, of_run / np.where(total > 0.0, total, 1.0), 1.0 / len(of_run))


def _mean(values: Floats, precision: Floats) -> Floats:
    """Weighted mean (f, m) of values (r, f, m), NaN where nothing has a weight."""
    total = precision.sum(axis=0)
    weighted = np.where(precision > 0.0, precision * values, 0.0).sum(axis=0)
    return np.where(total > 0.0, weighted / np.where(total > 0.0, total, 1.0), np.nan)


def _phase(runs: Sequence[Observation], precision: Floats) -> Floats | None:
    """Circular mean (f, m), in (-pi, pi]; None where a run has no phase."""
    known = [run.phase for run in runs if run.phase is not None]
    if len(known) < len(runs):
        return None
    turned = np.exp(1j * np.nan_to_num(np.stack(known)))
    middle = np.angle((precision * turned).sum(axis=0))
    # About the circular mean angles are as numbers: their mean keeps the product of likelihoods.
    away = np.angle(turned * np.exp(-1j * middle))
    return np.angle(np.exp(1j * (middle + _mean(away, precision))))


def _coherence(runs: Sequence[Observation], precision: Floats) -> Floats | None:
    """Mean (f, m) over the runs that were estimated from histories; None where none was."""
    known = [(k, run.coherence) for k, run in enumerate(runs) if run.coherence is not None]
    if not known:
        return None
    rows, values = zip(*known, strict=True)
    return _mean(np.stack(values), precision[list(rows)])
