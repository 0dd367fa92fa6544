"""What looks wrong in one recorded history, before it is used for anything."""

from collections.abc import Iterator

import numpy as np

from femupdate.arrays import Flags, Floats
from femupdate.measurement.channel import RecordedChannel
from femupdate.measurement.histories import LARGEST_PEAK, SMALLEST_PEAK
from femupdate.measurement.thresholds import CHANNEL
from femupdate.units import STANDARD_GRAVITY


def channel_findings(channel: RecordedChannel, si: float | None) -> tuple[str, ...]:
    """Return sentences on what looks wrong in a channel.

    Args:
        si: SI factor of its unit, or None where the unit is not known.
    """
    if np.ptp(channel.values) == 0.0:
        return (f"it is dead: every value is {channel.values[0]:g}.",)
    # Over the peak, so that no square overflows.
    peak = float(np.abs(channel.values).max())
    values = channel.values / peak
    mean = float(values.mean())
    return (
        *_of_scale(channel, (peak, peak * float(np.abs(values - mean).max())), si),
        *_of_offset(channel, values - mean, mean, peak),
        *_of_sampling(channel),
        *(_of_force(values) if channel.quantity == "force" else _of_shape(values, channel)),
    )


def _of_scale(
    channel: RecordedChannel, peaks: tuple[float, float], si: float | None
) -> Iterator[str]:
    """Sentences on the unit and the peak, given as it is and about the mean."""
    peak, swing = peaks
    if channel.quantity == "acceleration" and si is None:
        given = f"its unit {channel.unit!r} is not one of acceleration"
        yield f"{given if channel.unit else 'the file does not say its unit'}; give it with --unit."
    if channel.quantity == "acceleration" and si is not None:
        if peak * si > LARGEST_PEAK:
            yield (
                f"it peaks at {peak * si / STANDARD_GRAVITY:.3g} g, more than any earthquake (5 g):"
                " is the unit wrong?"
            )
        elif swing * si < SMALLEST_PEAK:
            yield (
                f"it peaks at {swing * si:.2g} m/s2, below what an accelerometer resolves: is the"
                " unit wrong, or the channel dead?"
            )
    stated = channel.stated_peak
    # Some headers state the peak about the mean.
    if stated and min(abs(peak - stated), abs(swing - stated)) > CHANNEL.peak * stated + 5e-4:
        yield f"it peaks at {peak:.4g} {channel.unit}, but its header says {stated:.4g}."


def _of_offset(channel: RecordedChannel, moving: Floats, mean: float, peak: float) -> Iterator[str]:
    if abs(mean) > CHANNEL.offset * float(np.abs(moving).max()):
        unit = f" {channel.unit}" if channel.unit else ""
        yield f"its mean is {mean * peak:.3g}{unit}, an offset to remove."


def _of_sampling(channel: RecordedChannel) -> Iterator[str]:
    rate = 1.0 / channel.time_step
    if not CHANNEL.slowest_hz <= rate <= CHANNEL.fastest_hz:
        yield (
            f"its sampling rate is {rate:.3g} Hz; buildings are measured at"
            f" {CHANNEL.slowest_hz:g} to {CHANNEL.fastest_hz:g} Hz: is the time's unit wrong?"
        )


def _of_force(values: Floats) -> Iterator[str]:
    """A hammer hits in some samples and rests between them: its force may only be clipped."""
    run = _longest_run(np.abs(values) == np.abs(values).max())
    if run >= CHANNEL.clipped:
        yield f"it is clipped: {run} samples in a row stand at its largest value."


def _of_shape(values: Floats, channel: RecordedChannel) -> Iterator[str]:
    time_step = channel.time_step
    moving = values - values.mean()
    peak, step = float(np.abs(moving).max()), _quantum(values)
    if peak < CHANNEL.steps * step:
        yield (
            f"it moves by {2.0 * peak / step:.0f} steps of its digits only: too weak to show more."
        )
        return
    ends = [_longest_run(values == extreme) for extreme in (values.max(), values.min())]
    if max(ends) >= CHANNEL.clipped:
        yield f"it is clipped: {max(ends)} samples in a row stand at its largest value."
    spikes = np.flatnonzero(_spikes(moving, peak))
    if spikes.size:
        at = ", ".join(f"{k * time_step:.4g} s" for k in spikes[:3])
        more = " ..." if spikes.size > 3 else ""
        plural = "s" if spikes.size > 1 else ""
        yield f"it has {spikes.size} spike{plural} of one sample: {at}{more}."
    start, count = _stuck(values)
    if count * time_step >= CHANNEL.stuck_s:
        first, last = start * time_step, (start + count) * time_step
        yield f"it stands still from {first:.4g} to {last:.4g} s: a gap that was filled?"


def _quantum(values: Floats) -> float:
    """Smallest difference between two values: the step of their digits."""
    steps = np.diff(np.unique(values))
    return float(steps.min()) if steps.size else 0.0


def _longest_run(flags: Flags) -> int:
    """Length of the longest run of true ones."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _spikes(moving: Floats, peak: float) -> Flags:
    """Samples (n,) that stand alone far from their neighbours."""
    from scipy.ndimage import median_filter, uniform_filter1d

    away = np.abs(moving - median_filter(moving, 5, mode="nearest"))
    width = 2 * CHANNEL.neighbours + 1
    # The mean square around a sample, without itself and the one to either side.
    wide, close = (uniform_filter1d(moving**2, n, mode="nearest") * n for n in (width, 3))
    around = np.sqrt(np.maximum(wide - close, 0.0) / (width - 3))
    return np.asarray((away > CHANNEL.spike * around) & (away > CHANNEL.spike_share * peak))


def _stuck(values: Floats) -> tuple[int, int]:
    """First sample and length of the longest stretch without change, between parts that move."""
    still = np.concatenate([[False], np.diff(values) == 0.0, [False]])
    edges = np.flatnonzero(np.diff(still.astype(np.int8)))
    starts, ends = edges[::2], edges[1::2]
    inside = (starts > 0) & (ends < values.size - 1)
    if not inside.any():
        return 0, 0
    lengths = np.where(inside, ends - starts, 0)
    longest = int(np.argmax(lengths))
    return int(starts[longest]), int(lengths[longest])
