"""Modes of a building from records of its floors alone, the excitation unknown.

A stochastic subspace identification gives poles for every model order (see `subspace`). Those of a
mode come back from order to order; poles of noise do not. Poles are grouped by frequency and
shape, and a group that enough orders share is a mode.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.errors import MeasurementError
from femupdate.measurement.modes import alike, in_phase, phase_collinearity
from femupdate.measurement.recording import RecordedMode
from femupdate.measurement.subspace import Pole, Spread, Subspace
from femupdate.measurement.thresholds import AMBIENT


@dataclass(frozen=True, eq=False, kw_only=True)
class AmbientModes:
    """Modes of a record, and what they were chosen from.

    Attributes:
        modes: from the lowest on.
        poles: of all orders, in the band.
        group: (p,) number of each pole's mode from 0, or -1.
        band_hz: in which modes were looked for.
        frequency_hz: (b,) of the spectra.
        spectra: (c, b) power of each channel, over its variance.
        channels: names.
        notes: sentences on what was done and what was left out.
    """

    modes: tuple[RecordedMode, ...]
    poles: tuple[Pole, ...]
    group: Integers
    band_hz: tuple[float, float]
    frequency_hz: Floats
    spectra: Floats
    channels: tuple[str, ...]
    notes: tuple[str, ...]


def identify_modes(
    values: Floats,
    time_step: float,
    channels: Sequence[str],
    band_hz: tuple[float, float] | None = None,
    order: int = AMBIENT.order,
) -> AmbientModes:
    """Identify the modes of a record.

    Args:
        values: (c, n) motion at the same times, all in one unit.
        time_step: s.
        channels: names (c,) for the components of the shapes.
        band_hz: in which modes are looked for; by default from the first peak of the spectra on.
        order: the largest of the models.

    Raises:
        MeasurementError: pyOMA2 is missing, the record is too short, or no mode is found.
    """
    moving = values - values.mean(axis=1, keepdims=True)
    frequency, spectra = _spectra(moving, time_step)
    first = _first_peak(frequency, spectra, band_hz)
    band = band_hz or (AMBIENT.bottom * first, min(AMBIENT.top * first, 0.4 / time_step))
    if band[1] > 0.5 / time_step:
        raise MeasurementError(
            f"the record shows nothing above {0.5 / time_step:g} Hz; lower the band's end"
        )
    blocks = _blocks(values.shape[1] * time_step, first)
    thinned, step = _thinned(moving, time_step, band[1])
    rows = _block_rows(len(thinned), step, first, order)
    order = min(order, (rows - 1) * len(thinned))
    subspace = Subspace(thinned, step, rows, order, blocks)
    poles = tuple(p for p in subspace.poles() if band[0] <= p.frequency_hz <= band[1])
    group = _groups(poles)
    chosen, doubtful = _chosen(poles, group, order)
    every, unclear = _modes(subspace, poles, group, chosen, tuple(channels))
    modes, twice = _once(every)
    if not modes:
        raise MeasurementError(
            f"no mode comes back from order to order between {band[0]:.3g} and {band[1]:.3g} Hz;"
            " give a longer record, or the band of the modes by the band option"
        )
    numbers = {mode_number: k for k, mode_number in enumerate(modes)}
    return AmbientModes(
        modes=tuple(modes.values()),
        poles=poles,
        group=np.array(
            [numbers.get(int(mode_number), -1) for mode_number in group], dtype=np.int64
        ),
        band_hz=band,
        frequency_hz=frequency,
        spectra=spectra,
        channels=tuple(channels),
        notes=(
            f"Covariance-driven subspace identification (pyOMA2) of {len(values)} channels over"
            f" {values.shape[1] * time_step:.4g} s, models up to order {order}, {band[0]:.3g} to"
            f" {band[1]:.3g} Hz; standard deviations from {blocks} blocks of the record.",
            *doubtful,
            *unclear,
            *twice,
        ),
    )


def _spectra(moving: Floats, time_step: float) -> tuple[Floats, Floats]:
    """Frequencies (b,) and power (c, b) over the variance of each channel."""
    from scipy.signal import welch

    length = min(moving.shape[1], max(256, min(8192, moving.shape[1] // 16)))
    frequency, power = welch(moving, 1.0 / time_step, nperseg=length, axis=1)
    return frequency[1:], power[:, 1:] / moving.var(axis=1, keepdims=True)


def _first_peak(frequency: Floats, spectra: Floats, band_hz: tuple[float, float] | None) -> float:
    """Lowest frequency that stands out of the octave to either side, Hz; else the highest peak."""
    low, high = band_hz or (0.0, np.inf)
    inside = (frequency >= low) & (frequency <= high)
    if not inside.any():
        raise MeasurementError(f"the record is too short to show {low:g} to {high:g} Hz")
    power = spectra.mean(axis=0)
    for k in np.flatnonzero(inside):
        around = power[(frequency >= 0.5 * frequency[k]) & (frequency <= 2.0 * frequency[k])]
        peak = 0 < k < len(power) - 1 and power[k] == power[k - 1 : k + 2].max()
        if peak and power[k] > AMBIENT.peak * np.median(around):
            return float(frequency[k])
    return float(frequency[inside][np.argmax(power[inside])])


def _blocks(seconds: float, first_hz: float) -> int:
    """How many parts of the record are told apart."""
    blocks = int(seconds * first_hz) // AMBIENT.periods
    if blocks < AMBIENT.fewest_blocks:
        raise MeasurementError(
            f"the record lasts {seconds * first_hz:.0f} periods of its first mode, at"
            f" {first_hz:.3g} Hz; modes need"
            f" {AMBIENT.fewest_blocks * AMBIENT.periods} at least, and better a thousand:"
            " give a longer record"
        )
    return min(blocks, AMBIENT.most_blocks)


def _thinned(moving: Floats, time_step: float, top_hz: float) -> tuple[Floats, float]:
    """The record (c, m) at a lower rate, and its time step."""
    from scipy.signal import decimate

    factor = int(1.0 / (AMBIENT.rate * top_hz * time_step))
    if factor < 2:
        return moving, time_step
    return decimate(moving, factor, ftype="fir", axis=1), time_step * factor


def _block_rows(channels: int, time_step: float, first_hz: float, order: int) -> int:
    """Time lags: half a period of the first mode, and enough for the order."""
    wanted = max(0.5 / (first_hz * time_step), 1.5 * order / channels)
    return max(3, min(int(np.ceil(wanted)), AMBIENT.longest // channels))


def _groups(poles: Sequence[Pole]) -> Integers:
    """Number (p,) of each pole's group."""
    from scipy.cluster.hierarchy import fcluster, linkage
    from scipy.spatial.distance import squareform

    if len(poles) < 2:
        return np.zeros(len(poles), dtype=np.int64)
    shapes = np.array([pole.shape / np.linalg.norm(pole.shape) for pole in poles])
    level = np.log([pole.frequency_hz for pole in poles])
    apart = np.abs(level[:, None] - level) / AMBIENT.same_frequency
    apart += (1.0 - np.minimum(np.abs(shapes.conj() @ shapes.T) ** 2, 1.0)) / AMBIENT.same_shape
    tree = linkage(squareform(apart, checks=False), "average")
    return np.asarray(fcluster(tree, 1.0, "distance"), dtype=np.int64)


def _chosen(
    poles: Sequence[Pole], group: Integers, order: int
) -> tuple[dict[int, tuple[Pole, ...]], tuple[str, ...]]:
    """Poles of each group that is a mode, by the group, and sentences on doubtful groups."""
    chosen: dict[int, tuple[Pole, ...]] = {}
    doubtful: list[float] = []
    for number in np.unique(group):
        members = [poles[k] for k in np.flatnonzero(group == number).tolist()]
        orders = {pole.order for pole in members}
        enough = len(orders) >= AMBIENT.share_of_all * order
        steady = len(orders) >= AMBIENT.share * (order + 1 - min(orders))
        aligned = (
            np.median([phase_collinearity(pole.shape) for pole in members]) >= AMBIENT.in_phase
        )
        if enough and steady and aligned:
            chosen[int(number)] = _middle(members)
        elif len(orders) >= AMBIENT.told * order:
            doubtful.append(float(np.median([pole.frequency_hz for pole in members])))
    listed = ", ".join(f"{value:.4g}" for value in sorted(doubtful))
    note = (
        f"Doubtful and left out, for they do not come back in every order or move out of phase:"
        f" {listed} Hz."
    )
    return chosen, (note,) if doubtful else ()


def _middle(poles: Sequence[Pole]) -> tuple[Pole, ...]:
    """Some poles of the half nearest to the group's middle, over their orders."""
    places = np.array([[np.log(pole.frequency_hz), pole.damping] for pole in poles])
    away = np.hypot(*(places - np.median(places, axis=0)).T)
    near = [pole for pole, distance in zip(poles, away, strict=True) if distance <= np.median(away)]
    near.sort(key=lambda pole: pole.order)
    spaced = np.linspace(0, len(near) - 1, min(AMBIENT.tried, len(near)))
    return tuple(near[round(k)] for k in spaced)


def _best(subspace: Subspace, candidates: Sequence[Sequence[Pole]]) -> list[tuple[Pole, Spread]]:
    """The pole of each group that is known best: a pole of noise beside it spoils some orders."""
    spreads = iter(subspace.spreads([pole for group in candidates for pole in group]))
    pairs = [[(pole, next(spreads)) for pole in group] for group in candidates]
    return [min(group, key=lambda pair: pair[1].frequency_hz) for group in pairs]


def _modes(
    subspace: Subspace,
    poles: Sequence[Pole],
    group: Integers,
    chosen: dict[int, tuple[Pole, ...]],
    channels: tuple[str, ...],
) -> tuple[dict[int, RecordedMode], tuple[str, ...]]:
    """Modes by their groups, and sentences on what is left out."""
    if not chosen:
        return {}, ()
    modes: dict[int, RecordedMode] = {}
    notes = []
    best = _best(subspace, list(chosen.values()))
    for number, (pole, spread) in zip(chosen, best, strict=True):
        if not spread.frequency_hz <= AMBIENT.vague * pole.frequency_hz:
            notes.append(f"Left out: {pole.frequency_hz:.4g} Hz, which is hardly known.")
        elif pole.damping < max(AMBIENT.undamped, AMBIENT.undamped_sd * spread.damping):
            notes.append(
                f"Left out: {pole.frequency_hz:.4g} Hz, whose damping ratio {pole.damping:.2g} ±"
                f" {spread.damping:.1g} may be none, as of a machine that runs at one frequency."
            )
        else:
            members = [poles[k] for k in np.flatnonzero(group == number).tolist()]
            modes[number] = _mode(pole, spread, members, channels)
    return modes, tuple(notes)


def _once(modes: dict[int, RecordedMode]) -> tuple[dict[int, RecordedMode], tuple[str, ...]]:
    """The modes, of two alike the one that is better known, and sentences on the others."""
    kept: dict[int, RecordedMode] = {}
    notes = []
    for number, mode in sorted(modes.items(), key=lambda item: item[1].frequency_sd_hz or 0.0):
        if any(alike(mode, other) for other in kept.values()):
            notes.append(
                f"Left out: {mode.frequency_hz:.4g} Hz, which looks like its better known neighbour"
                " found twice."
            )
        else:
            kept[number] = mode
    ordered = sorted(kept, key=lambda number: kept[number].frequency_hz)
    named = {
        number_kept: replace(kept[number_kept], name=str(k))
        for k, number_kept in enumerate(ordered, start=1)
    }
    return named, tuple(notes)


def _mode(
    pole: Pole, spread: Spread, members: Sequence[Pole], channels: tuple[str, ...]
) -> RecordedMode:
    """A mode, whose standard deviations hold the scatter over the orders too."""
    shape = in_phase(pole.shape)
    largest = shape[np.abs(shape).argmax()]
    several = shape.size > 1
    return RecordedMode(
        frequency_hz=pole.frequency_hz,
        sensors=channels,
        frequency_sd_hz=float(np.hypot(spread.frequency_hz, _scatter(members, "frequency_hz"))),
        damping=pole.damping,
        damping_sd=float(np.hypot(spread.damping, _scatter(members, "damping"))),
        shape=shape / largest,
        shape_sd=np.maximum(spread.shape / abs(largest), AMBIENT.least_sd) if several else None,
    )


def _scatter(poles: Sequence[Pole], name: str) -> float:
    """Standard deviation of a figure over the orders, from its median deviation."""
    values = np.array([getattr(pole, name) for pole in poles])
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))
