"""Modes of a building from records of its floors alone, the excitation unknown.

A stochastic subspace identification gives poles for every model order. Those of a mode come back
from order to order; poles of noise do not. Poles are grouped by frequency and shape, and a group
that enough orders share is a mode.

The identification is that driven by covariances, of pyOMA2 (Peeters and De Roeck 1999, Mech. Syst.
Signal Process. 13, 855). The covariance of the record's correlations comes from its blocks, and
goes on to the poles to first order, as Döhler and Mevel (2013, Mech. Syst. Signal Process. 38, 346)
have it; the derivatives along the blocks are differences, since each block moves a pole by a small
share of its standard deviation.
"""

import contextlib
import io
import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from femupdate.arrays import Complexes, Floats, Integers
from femupdate.errors import MeasurementError
from femupdate.measurement.modes import alike, in_phase, mac, phase_collinearity
from femupdate.measurement.recording import RecordedMode

# Figures by which files are judged.
ORDER = 40  # poles of the largest model

_MISSING = (
    "modes of ambient records need the package pyOMA2; install it with pip install"
    " 'femupdate[ambient]'"
)


@dataclass(frozen=True, eq=False)
class Pole:
    """A pole of one model order.

    Attributes:
        shape: (c,) complex; its largest component is 1.
    """

    order: int
    frequency_hz: float
    damping: float
    shape: Complexes


class Subspace:
    """Identified models of every order of one record.

    Args:
        record: (c, n) histories about their means.
        rows: block rows: time lags of the correlations.
        blocks: of the record, whose scatter tells the standard deviations.
    """

    def __init__(
        self, record: Floats, time_step: float, rows: int, order: int, blocks: int
    ) -> None:
        self._rows, self._step = rows, time_step
        with _library() as ssi:
            self._hankel, self._blocks = ssi.build_hank(record, record, rows, "cov", True, blocks)
            self._obs, self._a, self._c, _ = ssi.SSI_fast(self._hankel, rows, order)

    def poles(self) -> tuple[Pole, ...]:
        """Poles of every order that could be modes."""
        orders = range(2, len(self._a))
        return tuple(pole for order in orders for pole in self._of_order(order, self._a, self._c))

    def spreads(self, poles: Sequence[Pole]) -> list[Floats]:
        """Standard deviations (2 + c,) of some poles: frequency, Hz, damping ratio, real shape."""
        largest = max(pole.order for pole in poles)
        squares = [np.zeros(2 + pole.shape.size) for pole in poles]
        for block in self._blocks.T:
            moved = self._hankel + block.reshape(self._hankel.shape, order="F")
            with _library() as ssi:
                _, a, c, _ = ssi.SSI_fast(moved, self._rows, largest)
            perturbed = {order: self._of_order(order, a, c) for order in {p.order for p in poles}}
            for k, pole in enumerate(poles):
                squares[k] += _change(pole, perturbed[pole.order]) ** 2
        # A variance from so few blocks is uncertain itself: that of Student's t is larger by this.
        blocks = self._blocks.shape[1]
        wider = (blocks - 1.0) / (blocks - 3.0)
        return [np.sqrt(wider * each) for each in squares]

    def _of_order(self, order: int, a: list[Any], c: list[Any]) -> tuple[Pole, ...]:
        with _library() as ssi:
            pair = [a[0], a[order]], [c[0], c[order]]
            # A pole of more damping than 0.2 is no mode.
            results = ssi.SSI_poles(
                self._obs[:, :order], *pair, order, self._step, order, True, 0.2
            )
        frequency, damping, shape = results[0][:, 1], results[1][:, 1], results[2][:, 1]
        return tuple(
            Pole(order, float(frequency[k]), float(damping[k]), shape[k])
            for k in np.flatnonzero(np.isfinite(frequency) & np.isfinite(shape).all(axis=1))
        )


def _change(pole: Pole, moved: tuple[Pole, ...]) -> Floats:
    """Change of frequency, damping ratio and shape; infinite where the pole is there no longer."""
    if not moved:
        return np.full(2 + pole.shape.size, np.inf)

    def distance(other: Pole) -> float:
        apart = np.log(pole.frequency_hz / other.frequency_hz), pole.damping - other.damping
        return float(np.hypot(*apart)) + 1.0 - mac(pole.shape, other.shape)

    nearest = min(moved, key=distance)
    before, length = pole.shape, np.vdot(pole.shape, pole.shape).real
    shape = nearest.shape * (length / np.vdot(before, nearest.shape))
    turn = np.exp(-0.5j * np.angle((before**2).sum()))
    change = ((shape - before) * turn).real
    figures = nearest.frequency_hz - pole.frequency_hz, nearest.damping - pole.damping
    return np.array([*figures, *change])


@contextlib.contextmanager
def _library() -> Iterator[Any]:
    """pyOMA2's functions, without its log and its bars."""
    with np.errstate(all="ignore"), contextlib.redirect_stderr(io.StringIO()):
        try:
            from pyoma2.functions import ssi
        except ImportError:
            raise MeasurementError(_MISSING) from None
        logging.getLogger("pyoma2").setLevel(logging.ERROR)
        yield ssi


@dataclass(frozen=True, eq=False, kw_only=True)
class AmbientModes:
    """Modes of a record, and what they were chosen from.

    Attributes:
        modes: from the lowest on.
        group: (p,) number of each pole's mode from 0, or -1.
        frequency_hz: (b,) of the spectra.
        spectra: (c, b) power of each channel, over its variance.
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
    order: int = ORDER,
) -> AmbientModes:
    """Identify the modes of a record.

    Args:
        values: (c, n) motion at the same times, all in one unit.
        channels: names (c,) for the components of the shapes.
        band_hz: in which modes are looked for; by default from the first peak of the spectra on.

    Raises:
        MeasurementError: pyOMA2 is missing, the record is too short, or no mode is found.
    """
    from scipy.signal import decimate, welch

    moving = values - values.mean(axis=1, keepdims=True)
    length = min(moving.shape[1], max(256, min(8192, moving.shape[1] // 16)))
    frequency, power = welch(moving, 1.0 / time_step, nperseg=length, axis=1)
    frequency, spectra = frequency[1:], power[:, 1:] / moving.var(axis=1, keepdims=True)
    first = _first_peak(frequency, spectra, band_hz)
    # Modes are looked for from 0.4 to 12 times that: buildings have some six modes below.
    band = band_hz or (0.4 * first, min(12.0 * first, 0.4 / time_step))
    if band[1] > 0.5 / time_step:
        raise MeasurementError(
            f"the record shows nothing above {0.5 / time_step:g} Hz; lower the band's end"
        )
    # Of the first mode in a block, twice the memory of a mode of 1 % damping, 1 / (2 pi zeta).
    periods, fewest = 32, 5
    seconds = values.shape[1] * time_step
    blocks = int(seconds * first) // periods
    if blocks < fewest:
        raise MeasurementError(
            f"the record lasts {seconds * first:.0f} periods of its first mode, at"
            f" {first:.3g} Hz; modes need {fewest * periods} at least, and better a"
            " thousand: give a longer record"
        )
    blocks = min(blocks, 50)  # more tell nothing more
    # 2.5 samples in a period of the highest frequency.
    factor = max(1, int(1.0 / (2.5 * band[1] * time_step)))
    thinned = decimate(moving, factor, ftype="fir", axis=1) if factor > 1 else moving
    step, channel_count = time_step * factor, len(thinned)
    # Time lags: half a period of the first mode, and enough for the order; at most 240 rows of
    # blocks times channels.
    lags = max(0.5 / (first * step), 1.5 * order / channel_count)
    rows = max(3, min(int(np.ceil(lags)), 240 // channel_count))
    order = min(order, (rows - 1) * channel_count)
    subspace = Subspace(thinned, step, rows, order, blocks)
    poles = tuple(p for p in subspace.poles() if band[0] <= p.frequency_hz <= band[1])
    group, chosen, doubtful = _chosen(poles, order)
    modes, left_out = _modes(subspace, poles, group, chosen, tuple(channels))
    if not modes:
        raise MeasurementError(
            f"no mode comes back from order to order between {band[0]:.3g} and {band[1]:.3g} Hz;"
            " give a longer record, or the band of the modes by the band option"
        )
    numbers = {number: k for k, number in enumerate(modes)}
    return AmbientModes(
        modes=tuple(modes.values()),
        poles=poles,
        group=np.array([numbers.get(number, -1) for number in group.tolist()], dtype=np.int64),
        band_hz=band,
        frequency_hz=frequency,
        spectra=spectra,
        channels=tuple(channels),
        notes=(
            f"Covariance-driven subspace identification (pyOMA2) of {len(values)} channels over"
            f" {seconds:.4g} s, models up to order {order}, {band[0]:.3g} to"
            f" {band[1]:.3g} Hz; standard deviations from {blocks} blocks of the record.",
            *doubtful,
            *left_out,
        ),
    )


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
        # The first mode has eight times the power of the octave around it.
        if peak and power[k] > 8.0 * np.median(around):
            return float(frequency[k])
    return float(frequency[inside][np.argmax(power[inside])])


def _chosen(
    poles: Sequence[Pole], order: int
) -> tuple[Integers, dict[int, tuple[Pole, ...]], tuple[str, ...]]:
    """Group (p,) of each pole, poles of each that is a mode, and sentences on doubtful groups."""
    from scipy.cluster.hierarchy import fcluster, linkage
    from scipy.spatial.distance import squareform

    group = np.zeros(len(poles), dtype=np.int64)
    if len(poles) > 1:
        shapes = np.array([pole.shape / np.linalg.norm(pole.shape) for pole in poles])
        level = np.log([pole.frequency_hz for pole in poles])
        # Poles of one mode differ by a tenth of 2 % and of .1 of 1 - MAC, those of noise by more.
        apart = np.abs(level[:, None] - level) / 0.02
        apart += (1.0 - np.minimum(np.abs(shapes.conj() @ shapes.T) ** 2, 1.0)) / 0.1
        tree = linkage(squareform(apart, checks=False), "average")
        group = np.asarray(fcluster(tree, 1.0, "distance"), dtype=np.int64)
    chosen: dict[int, tuple[Pole, ...]] = {}
    doubtful: list[float] = []
    for number in np.unique(group):
        members = [poles[k] for k in np.flatnonzero(group == number).tolist()]
        orders = {pole.order for pole in members}
        # A mode is there in 0.4 of all orders.
        enough = len(orders) >= 0.4 * order
        # And in half of the orders from its first one on.
        steady = len(orders) >= 0.5 * (order + 1 - min(orders))
        # Its shape moves in one phase by 0.7 at least.
        aligned = np.median([phase_collinearity(pole.shape) for pole in members]) >= 0.7
        if enough and steady and aligned:
            # Some poles of the half nearest to the group's middle, over their orders.
            places = np.array([[np.log(pole.frequency_hz), pole.damping] for pole in members])
            away = np.hypot(*(places - np.median(places, axis=0)).T)
            near = [members[k] for k in np.flatnonzero(away <= np.median(away))]
            near.sort(key=lambda pole: pole.order)
            # Standard deviations are looked at in four orders.
            spaced = np.linspace(0, len(near) - 1, min(4, len(near)))
            chosen[int(number)] = tuple(near[round(k)] for k in spaced)
        # A doubtful group is worth a word from 0.15 of all orders on.
        elif len(orders) >= 0.15 * order:
            doubtful.append(float(np.median([pole.frequency_hz for pole in members])))
    listed = ", ".join(f"{value:.4g}" for value in sorted(doubtful))
    note = (
        f"Doubtful and left out, for they do not come back in every order or move out of phase:"
        f" {listed} Hz."
    )
    return group, chosen, (note,) if doubtful else ()


def _modes(
    subspace: Subspace,
    poles: Sequence[Pole],
    group: Integers,
    chosen: dict[int, tuple[Pole, ...]],
    channels: tuple[str, ...],
) -> tuple[dict[int, RecordedMode], tuple[str, ...]]:
    """Modes by their groups, from the lowest on, and sentences on what is left out."""
    if not chosen:
        return {}, ()
    modes: dict[int, RecordedMode] = {}
    notes = []
    spreads = iter(subspace.spreads([pole for poles in chosen.values() for pole in poles]))
    for number, candidates in chosen.items():
        # That known best is taken: a pole of noise beside it spoils some orders.
        pairs = [(pole, next(spreads)) for pole in candidates]
        pole, spread = min(pairs, key=lambda pair: float(pair[1][0]))
        frequency_sd, damping_sd = float(spread[0]), float(spread[1])
        # A mode's frequency is known to 2 %.
        if not frequency_sd <= 0.02 * pole.frequency_hz:
            notes.append(f"Left out: {pole.frequency_hz:.4g} Hz, which is hardly known.")
        # A machine looks undamped: within two standard deviations of no damping,
        # or below a tenth of the least damping that buildings have.
        elif pole.damping < max(5e-4, 2.0 * damping_sd):
            notes.append(
                f"Left out: {pole.frequency_hz:.4g} Hz, whose damping ratio {pole.damping:.2g} ±"
                f" {damping_sd:.1g} may be none, as of a machine that runs at one frequency."
            )
        else:
            members = [poles[k] for k in np.flatnonzero(group == number).tolist()]
            shape = in_phase(pole.shape)
            largest = shape[np.abs(shape).argmax()]
            # Standard deviations hold the scatter over the orders too, from its median deviation;
            # no component of a shape is known better than to 1e-4 of the largest.
            figures = np.array([[member.frequency_hz, member.damping] for member in members])
            scatter = 1.4826 * np.median(np.abs(figures - np.median(figures, axis=0)), axis=0)
            sd = np.maximum(spread[2:] / abs(largest), 1e-4)
            modes[number] = RecordedMode(
                frequency_hz=pole.frequency_hz,
                sensors=channels,
                frequency_sd_hz=float(np.hypot(frequency_sd, scatter[0])),
                damping=pole.damping,
                damping_sd=float(np.hypot(damping_sd, scatter[1])),
                shape=shape / largest,
                shape_sd=sd if shape.size > 1 else None,
            )
    # Of two alike the one that is better known is taken.
    kept: dict[int, RecordedMode] = {}
    for number, mode in sorted(modes.items(), key=lambda item: item[1].frequency_sd_hz or 0.0):
        if any(alike(mode, other) for other in kept.values()):
            notes.append(
                f"Left out: {mode.frequency_hz:.4g} Hz, which looks like its better known neighbour"
                " found twice."
            )
        else:
            kept[number] = mode
    ordered = sorted(kept, key=lambda number: kept[number].frequency_hz)
    named = {key: replace(kept[key], name=str(k)) for k, key in enumerate(ordered, start=1)}
    return named, tuple(notes)
