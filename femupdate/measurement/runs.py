"""Several runs of the same building made into one observation.

Runs err independently, so that their likelihoods multiply. Each is Gaussian in ln|H|, and so is the
product: with the precision w_r of run r at a point,

    sum_r w_r (y_r - h)^2 = W (y - h)^2 + sum_r w_r (y_r - y)^2, W = sum_r w_r, W y = sum_r w_r y_r.

The last sum is the same for all models; the observation keeps it as `scatter`, for the evidence.

Whether they agree is told without any model, by the chi-square of their differences.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise, product

import numpy as np
from scipy.special import chdtrc

from femupdate.arrays import Floats
from femupdate.measurement.estimated import mean_estimator
from femupdate.measurement.observation import (
    Observation,
    band_edges,
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
    """
    if len(runs) == 1:
        return runs[0]
    names = [name for name in floors if any(name in run.floors for run in runs)]
    wide = [on_all_floors(run, names) for run in runs]
    valid, noise = (
        np.stack([getattr(run, name) for run in wide]) for name in ("valid", "noise_sd")
    )
    values = np.stack([run.log_frf for run in wide])
    there = np.isfinite(values) & np.isfinite(noise) & (noise > 0)
    used = np.where(valid.any(axis=0), valid, there)
    share = np.array([independent_share(run) for run in wide])[:, None, None]
    # Precision (r, f, m) with which every run counts at a point; zero where it does not.
    weight = np.where(used, share / np.where(used, noise, 1.0) ** 2, 0.0)
    grid, estimated = wide[0].frequency_hz, any(run.coherence is not None for run in runs)
    resolution = None
    if any(run.resolution_hz is not None for run in runs):
        spacing, counts = float(np.median(np.diff(grid))), weight.sum(axis=(1, 2))
        widths = [
            0.0 if estimated and run.coherence is None else run.resolution_hz or spacing
            for run in runs
        ]
        resolution = float(np.sqrt(counts @ np.square(widths) / counts.sum()))
    precision = weight / resolved_share(grid, resolution, estimated=estimated)
    total = precision.sum(axis=0)
    mean = _mean(values, precision)
    deviation = np.where(precision > 0.0, values - mean, 0.0)
    scatter = (precision * deviation**2).sum(axis=0)
    # Share (r, m) of every run in all floors together; alike where there is nothing.
    of_run = precision.sum(axis=1)
    of_all = of_run.sum(axis=0)
    shares = np.where(of_all > 0.0, of_run / np.where(of_all > 0.0, of_all, 1.0), 1.0 / len(runs))
    seen = [k for k, run in enumerate(wide) if run.coherence is not None]
    coherence = np.array([wide[k].coherence for k in seen])
    beside = None
    further = max(run.excitation.columns for run in runs) - 1
    if further:
        # Of what a run did not measure its base did not move.
        total_beside = np.zeros((further, grid.size), dtype=np.complex128)
        for share, run in zip(shares, runs, strict=True):
            if run.beside is not None:
                total_beside[: len(run.beside)] += share * np.nan_to_num(run.beside)
        beside = total_beside
    return Observation(
        frequency_hz=wide[0].frequency_hz,
        floors=tuple(names),
        log_frf=mean,
        noise_sd=np.where(total > 0.0, np.maximum(total, _TINY) ** -0.5, np.nan),
        valid=np.asarray(valid.any(axis=0)),
        phase=_phase(wide, precision),
        coherence=_mean(coherence, precision[seen]) if seen else None,
        resolution_hz=resolution,
        source=", ".join(run.source for run in runs),
        scatter=scatter,
        between=_between(precision, scatter),
        leaking_sd=_leaking(wide, precision) if estimated else None,
        estimator=mean_estimator([run.estimator for run in runs], shares, grid),
        beside=beside,
        excitation=max((run.excitation for run in runs), key=lambda driven: driven.columns),
    )


def _between(precision: Floats, scatter: Floats) -> Floats:
    """Variance (f, m) from run to run (DerSimonian and Laird 1986, Control. Clin. Trials 7, 177).

    The least noisy run rules the mean, and is near it whatever the others are.
    """
    free = np.maximum((precision > 0.0).sum(axis=0) - 1.0, 0.0)
    total = np.maximum(precision.sum(axis=0), _TINY)
    apart = np.maximum(total - (precision**2).sum(axis=0) / total, _TINY)
    return np.asarray(np.where(free > 0.0, (scatter - free) / apart, 0.0))


def _leaking(runs: Sequence[Observation], precision: Floats) -> Floats:
    """Standard deviation (f, m) with what leaks; of a table as much as its noise."""
    leaks = [run.noise_sd if run.leaking_sd is None else run.leaking_sd for run in runs]
    ratio = np.stack(leaks) / np.stack([run.noise_sd for run in runs])
    counted = np.where(precision > 0.0, precision * ratio**2, 0.0).sum(axis=0)
    return np.asarray(np.sqrt(counted) / np.maximum(precision.sum(axis=0), _TINY))


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


def differences(
    runs: Sequence[Observation], floors: Sequence[str]
) -> Iterator[tuple[float, float, float, float, str]]:
    """Every run against the others, pooled, floor by floor and band by band.

    Of two runs, the second is compared with the first.

    Yields:
        Probability that noise alone makes the difference as large; its rms over the noise of both;
        points that err independently; its mean in ln|H|, run less others, weighted by precision;
        and which runs differ where, in words.
    """
    compared = range(1, 2) if len(runs) == 2 else range(len(runs))
    for number in compared:
        others = [run for k, run in enumerate(runs) if k != number]
        run, rest = runs[number], pooled(others, floors)
        share = min(independent_share(run), independent_share(rest))
        ours, theirs = (on_all_floors(each, floors) for each in (run, rest))
        both = ours.valid & theirs.valid
        difference = np.where(both, ours.log_frf - theirs.log_frf, 0.0)
        variance = np.where(both, ours.noise_sd**2 + theirs.noise_sd**2, np.inf)
        for (low, high), (row, floor) in product(
            pairwise(band_edges(run.frequency_hz)), enumerate(floors)
        ):
            seen = both[row] & (run.frequency_hz >= low) & (run.frequency_hz < high)
            independent = share * float(np.count_nonzero(seen))
            if independent < 3.0:  # points: fewer tell nothing
                continue
            weight = 1.0 / variance[row, seen]
            square = float((weight * difference[row, seen] ** 2).mean())
            mean = float((weight * difference[row, seen]).sum() / weight.sum())
            words = f"{run.source} differs from {rest.source} at {floor}, {low:.3g} to {high:.3g}"
            chance = float(chdtrc(independent, independent * square))
            yield chance, square**0.5, independent, mean, f"{words} Hz"


def agreement(runs: Sequence[Observation], floors: Sequence[str]) -> str:
    """Whether runs agree, by the chi-square of their differences, in a sentence for the user."""
    found = list(differences(runs, floors))
    if not found:
        return (
            "No floor was measured in more than one of them: whether they agree cannot be told "
            "without a model."
        )
    # Runs that agree are said to differ once in a thousand times. The noise is an estimate itself:
    # nothing is said below 1.3 times it.
    large = [each for each in found if each[0] < 1e-3 / len(found) and each[1] > 1.3]
    if not large:
        _, ratios, points, _, _ = (np.array(column) for column in zip(*found, strict=True))
        ratio = np.sqrt((points @ ratios**2) / points.sum())
        return f"They agree: their differences are {ratio:.2f} times the noise (rms)."
    _, ratio, _, mean, words = min(large, key=lambda each: (each[0], -each[1]))
    others = "" if len(large) == 1 else f", and so in {len(large) - 1} more places"
    return (
        f"They do not agree: {words}, by {ratio:.1f} times the noise of both (rms; "
        f"{100.0 * np.expm1(mean):+.0f} % on average){others}. The posterior is that of their "
        "mean; calibrate each alone to see how they differ. Was the motion stronger in one "
        "(`femupdate diagnose` of both takes each at its level), a sensor moved, the building "
        "changed?"
    )
