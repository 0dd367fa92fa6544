"""Frequency response functions of measured histories, by Welch's method and the H1 estimator.

Bias: each estimate is the response averaged over the bandwidth of a segment's window, so a
narrower peak comes out too low. For a peak at f0 with damping ratio zeta
and Hann segments of T seconds the estimate at the peak is low by about 1 / (3 (zeta f0 T)^2) of
its value (the second moment of the window's spectrum times the curvature of H): 8 % for 5 Hz,
2 %, 20 s. This averaging lowers the coherence too, so the stated noise is larger there. It
covers the bias as long as zeta f0 T is about 2 or more.

Where vertical sensors measure the base's rotation, H1 is still taken over the translation alone.
What the rotation adds to it is for the model (`femupdate.measurement.estimated`), and the noise is
what neither of both explains (the multiple coherence of Bendat and Piersol 2010, section 7.3).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array

from femupdate.arrays import Complexes, Flags, Floats, Indices
from femupdate.dynamics.level import levels_in_run
from femupdate.errors import MeasurementError
from femupdate.measurement.base_rotation import rotation_of, said_of_rotation
from femupdate.measurement.columns import BASE
from femupdate.measurement.estimated import estimator_of
from femupdate.measurement.frf_table import FrfTable
from femupdate.measurement.observation import (
    HANN_BANDWIDTH,
    Observation,
    require_floors_of_building,
    select_floors,
)
from femupdate.measurement.observation_file import Histories
from femupdate.measurement.thresholds import ROTATION, SPECTRUM
from femupdate.measurement.welch import Segments, Spectra, choose_segments, welch_spectra

_TINY = float(np.finfo(np.float64).tiny)


def estimate_frf(
    histories: Histories, frequency_hz: Floats, direction: str = "x", half: int | None = None
) -> Observation:
    """Estimate the FRFs of all floors in one direction, with their noise from the coherence.

    A segment is as long as the inverse of the grid's step, or shorter where that would leave fewer
    than five independent ones. The sensors of a floor are averaged in time; H1 = S_xy / S_xx with
    Hann windows and half overlap (Welch 1967), complex H interpolated to the grid. The noise is
    sd(ln|H|) = sqrt((1 - g2) / (2 g2 n)) (Bendat and Piersol 2010, section 9.2) with the
    effective number n of overlapping segments, but never below `least_noise` of the thresholds.

    Args:
        frequency_hz: (m,) the building's grid, increasing.
        direction: of the motion: x, y or z.
        half: 0 or 1 for every other segment alone; the noise is that of the whole record, as much
            larger as there are fewer segments.

    Raises:
        MeasurementError: there is no base or floor channel in the direction, the record is too
            short, or no point of the grid can be used.
    """
    grid, step = _checked_grid(frequency_hz), histories.time_step
    base, floors, names = floor_means(histories, direction)
    rotation = rotation_of(histories.channels, histories.acceleration)
    # Long enough to resolve the grid, s.
    wanted = 1.0 / float(np.median(np.diff(grid))) if grid.size > 1 else 8.0 / float(grid[0])
    segments = choose_segments(base.size, step, wanted, histories.source)
    spectra = welch_spectra(base, floors, step, segments)
    coherence = np.abs(spectra.cross) ** 2 / np.maximum(spectra.base * spectra.floors, _TINY)
    turning = _Turning.of(base, rotation, floors, step, segments)
    explained = coherence if turning is None else coherence + turning.more_explained(spectra)
    incoherent = _incoherent(spectra, explained, segments.effective, 1 if turning is None else 2)
    noise = _noise(spectra, coherence, incoherent, segments.effective)
    trusted = _trusted(spectra, incoherent, noise, segments.effective)
    if half is not None:
        whole, segments = segments, _half(segments, half, histories.source)
        noise = noise * (whole.effective / segments.effective) ** 0.5
        spectra = welch_spectra(base, floors, step, segments)
    frf = spectra.cross / np.maximum(spectra.base, _TINY)
    inside = _resolved(grid, segments, step)
    at_grid = _Interpolator(spectra.frequency_hz, grid, inside)
    frf = at_grid(frf.real) + 1j * at_grid(frf.imag)
    valid = (at_grid(trusted.astype(np.float64)) > 0.999) & (np.abs(frf) > 0)
    _require_points(valid, histories.source)
    estimator = estimator_of(base, step, segments, grid, at_grid.matrix(), rotation)
    sensors = _of_sensors(histories, direction, base)
    return Observation(
        frequency_hz=grid,
        floors=names,
        log_frf=np.log(np.maximum(np.abs(frf), _TINY)),
        noise_sd=at_grid(noise),
        valid=valid,
        phase=np.angle(frf),
        coherence=at_grid(explained),
        resolution_hz=HANN_BANDWIDTH / segments.seconds,
        source=histories.source,
        estimator=replace(estimator, run_levels=levels_in_run(base, floors, step).parts),
        rotation=None if turning is None else turning.over_translation(at_grid),
        notes=(segments.note, *sensors, *_gaps(names, valid, inside)),
    )


@dataclass(frozen=True, eq=False)
class _Turning:
    """Spectra of the base's rotation.

    Attributes:
        beside: of translation and rotation, as if the rotation were a floor.
        floors: of rotation and floors, as if the rotation were the base.
    """

    beside: Spectra
    floors: Spectra

    @staticmethod
    def of(
        base: Floats, rotation: Floats | None, floors: Floats, step: float, segments: Segments
    ) -> "_Turning | None":
        """None where no rotation was measured."""
        if rotation is None:
            return None
        beside = welch_spectra(base, rotation[None], step, segments)
        return _Turning(beside, welch_spectra(rotation, floors, step, segments))

    def more_explained(self, spectra: Spectra) -> Floats:
        """Share of each floor's power (f, b) that follows the rotation beside the translation."""
        share = self.beside.cross[0] / np.maximum(spectra.base, _TINY)
        own = self.beside.floors[0] - np.abs(share) ** 2 * spectra.base
        cross = self.floors.cross - share.conj() * spectra.cross
        # What goes with the translation alone leaves rounding.
        there = own > ROTATION.rounding * self.beside.floors[0]
        power = np.abs(cross) ** 2 / np.where(there, own, 1.0)
        return np.asarray(np.where(there, power, 0.0) / np.maximum(spectra.floors, _TINY))

    def over_translation(self, at_grid: "_Interpolator") -> Complexes:
        """Rotation that goes with unit translation (m,), 1/m."""
        share = self.beside.cross[0] / np.maximum(self.beside.base, _TINY)
        return np.asarray(at_grid(share.real) + 1j * at_grid(share.imag))


def _half(segments: Segments, number: int, source: str) -> Segments:
    half = segments.half(number)
    if half.effective < SPECTRUM.fewest_averages:
        raise MeasurementError(
            f"{source}: {segments.count} segments are too few to be parted in two halves"
        )
    return half


def observation_from_table(
    table: FrfTable,
    frequency_hz: Floats,
    default_noise: float = SPECTRUM.default_noise,
    half: int | None = None,
) -> Observation:
    """Bring a table of FRFs to a frequency grid, interpolating ln|H| within the table's range.

    Args:
        frequency_hz: (m,) the building's grid, increasing.
        default_noise: sd of ln|H| where the table gives none.
        half: 0 or 1 for every other independent point alone.

    Raises:
        MeasurementError: no point of the grid lies in the table's range.
    """
    grid = _checked_grid(frequency_hz)
    inside = (grid >= table.frequency_hz[0]) & (grid <= table.frequency_hz[-1])
    at_grid = _Interpolator(table.frequency_hz, grid, inside)
    stated = np.full_like(table.magnitude, np.nan) if table.log_sd is None else table.log_sd
    noise = at_grid(np.where(np.isnan(stated), default_noise, stated))
    phase = None
    if table.complex_frf is not None:
        phase = np.angle(at_grid(table.complex_frf.real) + 1j * at_grid(table.complex_frf.imag))
    valid = np.broadcast_to(inside, noise.shape).copy()
    _require_points(valid, table.source)
    resolution = _table_spacing(table, grid)
    if half is not None:
        valid &= _alternate(grid, resolution) == half
    without = [f for f, row in zip(table.floors, stated, strict=True) if np.isnan(row).any()]
    notes = (f"Noise on ln|H| taken as {default_noise:g} for {', '.join(without)}.",)
    return Observation(
        frequency_hz=grid,
        floors=table.floors,
        log_frf=at_grid(np.log(table.magnitude)),
        noise_sd=noise,
        valid=valid,
        phase=phase,
        resolution_hz=resolution,
        source=table.source,
        notes=(*(notes if without else ()), *_gaps(table.floors, valid, inside)),
    )


def _alternate(grid: Floats, resolution_hz: float | None) -> Indices:
    """0 or 1 (m,) by turns, from one point that errs independently to the next."""
    spacing = float(np.median(np.diff(grid))) if grid.size > 1 else 1.0
    return np.floor((grid - grid[0]) / (resolution_hz or spacing) + 1e-6).astype(np.int32) % 2


def _table_spacing(table: FrfTable, grid: Floats) -> float | None:
    """Spacing of a table that is coarser than the grid, whose points it then repeats."""
    if table.frequency_hz.size < 2 or grid.size < 2:
        return None
    spacing = float(np.median(np.diff(table.frequency_hz)))
    return spacing if spacing > 1.001 * float(np.median(np.diff(grid))) else None


def observation_for(
    building_floors: Sequence[str],
    data: Histories | FrfTable,
    frequency_hz: Floats,
    *,
    direction: str = "x",
    default_noise: float = SPECTRUM.default_noise,
    half: int | None = None,
) -> Observation:
    """Return the observation in a file, on the building's floors and frequency grid.

    Args:
        building_floors: names of the building's floors, bottom to top, without the base.
        data: the file's histories or FRF table.
        frequency_hz: (m,) the building's grid, increasing.
        direction: of the motion, for histories.
        default_noise: see `observation_from_table`.
        half: 0 or 1 for one half of the data alone.

    Raises:
        MeasurementError: the file has a floor that the building has not, or see `estimate_frf`
            and `observation_from_table`.
    """
    require_floors_of_building(data.source, data.floors, building_floors)
    if isinstance(data, FrfTable):
        observation = observation_from_table(data, frequency_hz, default_noise, half)
    else:
        observation = estimate_frf(data, frequency_hz, direction, half=half)
    return select_floors(observation, [f for f in building_floors if f in observation.floors])


class _Interpolator:
    """Straight lines between bins, row by row; NaN where the grid lies outside."""

    def __init__(self, bins: Floats, grid: Floats, inside: Flags) -> None:
        upper = np.clip(np.searchsorted(bins, grid), 1, bins.size - 1)
        self._bins, self._upper, self._inside = bins.size, upper, inside
        self._share = (grid - bins[upper - 1]) / (bins[upper] - bins[upper - 1])

    def matrix(self) -> csr_array:
        """(m, b) that does the same to values at the bins; zero where the grid lies outside."""
        share = np.where(self._inside, self._share, 0.0)
        weights = np.concatenate([np.where(self._inside, 1.0 - share, 0.0), share])
        rows = np.tile(np.arange(share.size), 2)
        columns = np.concatenate([self._upper - 1, self._upper])
        return csr_array((weights, (rows, columns)), shape=(share.size, self._bins))

    def __call__(self, values: Floats) -> Floats:
        """(f, b) at the bins to (f, m) at the grid."""
        low, high = values[..., self._upper - 1], values[..., self._upper]
        between = low + np.where(self._inside, self._share, 0.0) * (high - low)
        return np.asarray(np.where(self._inside, between, np.nan), dtype=np.float64)


def _checked_grid(frequency_hz: Floats) -> Floats:
    grid = np.asarray(frequency_hz, dtype=np.float64)
    increasing = grid.ndim == 1 and grid.size > 0 and bool((np.diff(grid) > 0).all())
    if not (increasing and np.isfinite(grid).all() and grid[0] > 0):
        raise MeasurementError("the frequency grid must increase, with values above 0 Hz")
    return grid


def floor_means(histories: Histories, direction: str) -> tuple[Floats, Floats, tuple[str, ...]]:
    """Mean over the sensors of the base (n,) and of each floor (f, n), and the floors' names."""
    rows = {floor: histories.rows(floor, direction) for floor in (BASE, *histories.floors)}
    floors = tuple(floor for floor in histories.floors if rows[floor])
    if not rows[BASE] or not floors:
        missing = "floor" if rows[BASE] else "base"
        there = ", ".join(channel.name for channel in histories.channels)
        raise MeasurementError(
            f"{histories.source}: there is no {missing} channel in direction {direction}; the file"
            f" has {there}"
        )
    base, *means = (histories.acceleration[rows[one]].mean(axis=0) for one in (BASE, *floors))
    return base, np.array(means), floors


def _resolved(grid: Floats, segments: Segments, time_step: float) -> Flags:
    """Whether a frequency lies between one cycle in a segment and the Nyquist frequency."""
    slack = 1e-9  # grids are sums of rounded steps
    lowest, nyquist = 1.0 / segments.seconds, 0.5 / time_step
    return (grid >= lowest * (1.0 - slack)) & (grid < nyquist * (1.0 - slack))


def _smooth(density: Floats, spectra: Spectra) -> Floats:
    """Mean of a density (f, b) over its neighbours, Hann-weighted."""
    from scipy.ndimage import convolve1d

    kernel = np.hanning(2 * SPECTRUM.noise_bins * spectra.padding + 1)
    return np.asarray(convolve1d(density, kernel / kernel.sum(), axis=-1, mode="nearest"))


def _incoherent(spectra: Spectra, coherence: Floats, averages: float, inputs: int) -> Floats:
    """Power of each floor (f, b) that does not follow the base.

    It is freed of its bias by n / (n - 1), and averaged over neighbouring frequencies.
    """
    free = max(averages - inputs, 1.0)
    share = (1.0 - np.minimum(coherence, 1.0)) * averages / free
    return _smooth(share * spectra.floors, spectra)


def _noise(spectra: Spectra, coherence: Floats, incoherent: Floats, averages: float) -> Floats:
    """sd(ln|H|) at the bins (f, b)."""
    # (1 - g2) / g2 is the ratio of incoherent to coherent power.
    ratio = np.minimum(incoherent / np.maximum(coherence * spectra.floors, _TINY), 1e6)
    return np.maximum(np.sqrt(ratio / (2.0 * averages)), SPECTRUM.least_noise)


def _trusted(spectra: Spectra, incoherent: Floats, noise: Floats, averages: float) -> Flags:
    """Whether an estimate at the bins (f, b) may be used."""
    from scipy.ndimage import maximum_filter1d

    around = 1.0 - incoherent / np.maximum(_smooth(spectra.floors, spectra), _TINY)
    # Chance exceeds g2 with probability (1 - g2)^(n - 1) between unrelated signals. The coherence
    # around a frequency rests on about half as many more averages as it has bins (Hann windows
    # make neighbours repeat each other).
    pooled = averages * (2 * SPECTRUM.noise_bins + 1) / 2.0
    chance = 1.0 - SPECTRUM.chance ** (1.0 / (pooled - 1.0))
    nearby = maximum_filter1d(spectra.base, 2 * SPECTRUM.nearby * spectra.padding + 1)
    power = (spectra.base > SPECTRUM.power_nearby * nearby) & (
        spectra.base > SPECTRUM.power_anywhere * spectra.base.max()
    )
    related = around >= max(SPECTRUM.coherence, chance)
    return np.asarray(related & (noise <= SPECTRUM.largest_noise) & power)


def _require_points(valid: Flags, source: str) -> None:
    if not valid.any():
        raise MeasurementError(
            f"{source}: no point of the frequency grid can be used (base without power there, or"
            " floors that do not follow it); check the channels, the sampling and the grid"
        )


def _of_sensors(histories: Histories, direction: str, base: Floats) -> tuple[str, ...]:
    """Sentences on sensors that are averaged, and on those from which a rotation is taken."""
    places = dict.fromkeys(channel.floor for channel in histories.channels)
    counts = {floor: len(histories.rows(floor, direction)) for floor in places}
    several = [f"{floor} ({count})" for floor, count in counts.items() if count > 1]
    averaged = [f"Sensors averaged in time: {', '.join(several)}."] if several else []
    return (*averaged, *said_of_rotation(histories.channels, histories.acceleration, base))


def _gaps(floors: tuple[str, ...], valid: Flags, inside: Flags) -> tuple[str, ...]:
    """Sentences on the points that cannot be used."""
    notes: list[str] = []
    if not inside.all():
        notes.append(
            f"{np.count_nonzero(~inside)} of {inside.size} frequencies lie outside what was"
            " measured."
        )
    weak = [int(np.count_nonzero(inside & ~row)) for row in valid]
    for count in dict.fromkeys(one for one in weak if one):
        alike = [floor for floor, own in zip(floors, weak, strict=True) if own == count]
        each = " each" if len(alike) > 1 else ""
        notes.append(
            f"{', '.join(alike)}: {count} points{each} left out for low coherence or base power."
        )
    return tuple(notes)
