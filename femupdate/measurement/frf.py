"""Frequency response functions of measured histories, by Welch's method and the H1 estimator.

Bias: each estimate is the response averaged over the bandwidth of a segment's window, so a
narrower peak comes out too low. For a peak at f0 with damping ratio zeta
and Hann segments of T seconds the estimate at the peak is low by about 1 / (3 (zeta f0 T)^2) of
its value (the second moment of the window's spectrum times the curvature of H): 8 % for 5 Hz,
2 %, 20 s. A model's FRF goes through the same averages (`femupdate.measurement.estimated`), so the
noise is what does not follow the base, without what leaks (`noise_of_lines`): with n effective
segments sd(ln|H|) = sqrt((1 - g2) / (2 g2 n)), g2 the coherence (Bendat and Piersol 2010, section
9.2). That of each floor alone is at least `least_noise` of the thresholds.

Noise of the base's own sensor is left at every floor, for none of them follows it. H1 is low by its
share of the base's power, and all floors err alike by it.

Where the base's rotation or its motion across was measured, H1 is still taken over the translation
alone. What they add to it is for the model (`femupdate.measurement.estimated`), and the noise is
what none of them explains (the multiple coherence of Bendat and Piersol 2010, section 7.3).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from femupdate.arrays import Complexes, Flags, Floats
from femupdate.dynamics.excitation import Excitation
from femupdate.dynamics.level import strongest_hz
from femupdate.errors import MeasurementError
from femupdate.measurement.estimated import (
    PADDING,
    Segments,
    Spectra,
    choose_segments,
    cut,
    estimator_of,
    noise_of_lines,
    welch_spectra,
    window_of,
)
from femupdate.measurement.names import BASE, channel_name
from femupdate.measurement.observation import (
    HANN_BANDWIDTH,
    Histories,
    Observation,
    other_horizontal,
    require_floors_of_building,
    said_of_rotation,
    select_floors,
)

# Figures by which files are judged.
# independent bins to either side over which the noise is averaged; with seven segments, mean square
# of error over noise falls from 1.2 to 1.05
LEAST_NOISE = 0.003  # of ln|H|, that is stated: less gains no truth, and thins tolerances
_NOISE_BINS = 3

_TINY = float(np.finfo(np.float64).tiny)


def estimate_frf(
    histories: Histories,
    frequency_hz: Floats,
    direction: str = "x",
    half: int | None = None,
    segments: Segments | None = None,
    sensors: Sequence[str] = (),
) -> Observation:
    """Estimate the FRFs of all floors in one direction, with their noise.

    A segment is as long as the inverse of the grid's step, or shorter where that would leave fewer
    than five independent ones. The sensors of a floor are averaged in time; H1 = S_xy / S_xx with
    Hann windows and half overlap (Welch 1967), complex H interpolated to the grid.

    Args:
        frequency_hz: (m,) the building's grid, increasing.
        half: 0 or 1 for every other segment alone.
        segments: how the record is cut, if not as above.
        sensors: floors that notes speak of; none: all.

    Raises:
        MeasurementError: no base or floor in the direction, too short, or no point can be used.
    """
    grid, step = np.asarray(frequency_hz, dtype=np.float64), histories.time_step
    (base, floors, names), inputs = histories.means(direction), histories.inputs(direction)
    # Long enough to resolve the grid, s.
    wanted = 1.0 / float(np.median(np.diff(grid))) if grid.size > 1 else 8.0 / float(grid[0])
    if segments is None:
        segments = choose_segments(base.size, step, wanted, histories.source)
    spectra = welch_spectra(base, floors, step, segments)
    coherence, explained, beside = _explained(spectra, inputs, floors, step, segments)
    driving = int(inputs.any(axis=1).sum())
    incoherent = _incoherent(spectra, explained, segments.effective, driving)
    noise = _noise(spectra, coherence, incoherent, segments.effective)
    trusted = _trusted(spectra, incoherent, noise, segments.effective)
    if half is not None:
        whole, segments = segments, segments.half(half)
        if segments.effective < 2.0:  # the coherence says nothing
            raise MeasurementError(f"{histories.source}: too few segments to be parted in halves")
        noise = noise * (whole.effective / segments.effective) ** 0.5
        spectra = welch_spectra(base, floors, step, segments)
    rounded = 1.0 - 1e-9  # grids are sums of rounded steps
    inside = (grid >= rounded / segments.seconds) & (grid < 0.5 * rounded / step)
    between = _between(spectra.frequency_hz, grid, inside)
    at_grid = partial(_at_grid, between, inside)
    frf = at_grid(spectra.cross / np.maximum(spectra.base, _TINY))
    valid = (at_grid(trusted.astype(np.float64)) > 0.999) & (np.abs(frf) > 0)
    _require_points(valid, histories.source)
    leaking = at_grid(noise)
    across = _left(inputs, floors, step, segments.seconds, grid)
    early = np.mean(floors[:, : segments.length // 4] ** 2) / np.mean(floors**2)
    known = leaking, segments.effective, min(float(early), 1.0)
    alone, shared, share = _parts_of_noise(across, frf, spectra, at_grid, valid, *known)
    frf = frf * at_grid(1.0 / (1.0 - share))
    peaks = _narrow_peaks(spectra, trusted, max(float(grid[0]), 2.0 / segments.seconds))
    estimator, holds = estimator_of(inputs, step, segments, grid, between, share, peaks)
    alone = np.where(holds, alone, np.maximum(alone, leaking**2))
    estimator = replace(estimator, shared=np.sqrt(np.maximum(np.nan_to_num(shared), 0.0)))
    return Observation(
        frequency_hz=grid,
        floors=names,
        log_frf=np.log(np.maximum(np.abs(frf), _TINY)),
        noise_sd=np.sqrt(alone + shared),
        valid=valid,
        phase=np.angle(frf),
        coherence=at_grid(explained),
        leaking_sd=leaking,
        resolution_hz=HANN_BANDWIDTH / segments.seconds,
        source=histories.source,
        estimator=estimator,
        beside=at_grid(beside) if len(beside) else None,
        notes=(
            segments.note,
            *_of_sensors(histories, direction, inputs, sensors),
            *_gaps(names, valid, inside, sensors),
            *histories.notes,
        ),
        excitation=Excitation(histories.force, len(inputs)),
        histories=histories,
    )


def _explained(
    spectra: Spectra, inputs: Floats, floors: Floats, step: float, segments: Segments
) -> tuple[Floats, Floats, Complexes]:
    """Share of each floor's power (f, b) that follows the translation, and all inputs (c, n).

    And what of the further inputs (c - 1, b) goes with a unit translation.
    """
    coherence = np.abs(spectra.cross) ** 2 / np.maximum(spectra.base * spectra.floors, _TINY)
    if len(inputs) == 1:
        return coherence, coherence, np.zeros((0, coherence.shape[1]), dtype=np.complex128)
    parts = [welch_spectra(row, np.vstack([inputs, floors]), step, segments) for row in inputs]
    between, cross = np.split(np.array([part.cross for part in parts]), [len(inputs)], axis=1)
    size = np.sqrt(np.maximum([part.base for part in parts], _TINY))
    # What goes with the others leaves rounding, in double precision 1e-9 of the power.
    unit = (between / (size[:, None] * size)).transpose(2, 0, 1)
    apart = np.linalg.pinv(unit, rcond=1e-9, hermitian=True)
    seen = cross / size[:, None]
    power = np.einsum("ifb,bij,jfb->fb", seen.conj(), apart, seen, optimize=True).real
    explained = np.maximum(coherence, power / np.maximum(spectra.floors, _TINY))
    beside = np.asarray(between[0, 1:] / np.maximum(spectra.base, _TINY), dtype=np.complex128)
    return coherence, np.asarray(explained), beside


def on_grid(table: Observation, frequency_hz: Floats, sensors: Sequence[str] = ()) -> Observation:
    """Bring FRFs of a table to a frequency grid, interpolating ln|H| within the table's range.

    Args:
        table: at its own frequencies.
        sensors: floors that notes speak of; none: all.
    """
    grid, own = np.asarray(frequency_hz, dtype=np.float64), table.frequency_hz
    inside = (grid >= own[0]) & (grid <= own[-1])
    at_grid, phase = partial(_at_grid, _between(own, grid, inside), inside), table.phase
    if phase is not None:
        phase = np.angle(at_grid(np.exp(table.log_frf + 1j * phase)))
    valid = np.broadcast_to(inside, (len(table.floors), grid.size)).copy()
    _require_points(valid, table.source)
    # Where a table is coarser than the grid, the grid repeats its points.
    spacing = float(np.median(np.diff(own))) if own.size > 1 and grid.size > 1 else None
    coarse = spacing is not None and spacing > 1.001 * float(np.median(np.diff(grid)))
    return replace(
        table,
        frequency_hz=grid,
        log_frf=at_grid(table.log_frf),
        noise_sd=at_grid(table.noise_sd),
        valid=valid,
        phase=phase,
        resolution_hz=spacing if coarse else None,
        notes=(*table.notes, *_gaps(table.floors, valid, inside, sensors)),
    )


def with_halves(seen: Observation, direction: str) -> Observation:
    """An observation with two halves of itself that err independently, where it can be parted.

    Of a record every other segment; of a table every other point that errs independently.
    """
    grid = seen.frequency_hz
    if seen.histories is not None:
        try:
            halves = [estimate_frf(seen.histories, grid, direction, half) for half in (0, 1)]
        except MeasurementError:
            return seen
        parts = tuple(select_floors(half, seen.floors) for half in halves)
        return replace(seen, halves=parts)
    spacing = float(np.median(np.diff(grid))) if grid.size > 1 else 1.0
    turn = np.floor((grid - grid[0]) / (seen.resolution_hz or spacing) + 1e-6).astype(int) % 2
    parts = tuple(replace(seen, valid=seen.valid & (turn == half)) for half in (0, 1))
    return replace(seen, halves=parts)


def observation_for(
    building_floors: Sequence[str],
    data: Histories | Observation,
    frequency_hz: Floats,
    direction: str = "x",
    sensors: Sequence[str] = (),
) -> Observation:
    """Return the observation in a file, on the building's floors and frequency grid.

    Args:
        building_floors: names of the building's floors, bottom to top, without the base.
        sensors: floors that notes speak of; none: all.

    Raises:
        MeasurementError: the file has a floor that the building has not, or see `estimate_frf`
            and `on_grid`.
    """
    forced = [data.excitation.force] if data.excitation.force else []
    require_floors_of_building(data.source, (*data.floors, *forced), building_floors)
    if isinstance(data, Observation):
        found = on_grid(data, frequency_hz, sensors)
    else:
        found = estimate_frf(data, frequency_hz, direction, sensors=sensors)
    return select_floors(found, [f for f in building_floors if f in found.floors])


def by_strength(seen: Observation, direction: str) -> tuple[Observation, ...]:
    """FRFs of the weak, the middling and the strong third of a record, each at its level.

    The record is cut in segments of 20 or, where those are too few, 12 periods of its strongest
    mode. Which floors and points are used is as in the whole record; none where it has too few.
    """
    if seen.histories is None:
        return ()
    base, floors, names = seen.histories.means(direction)
    floors, step = floors[[names.index(name) for name in seen.floors]], seen.histories.time_step
    # With 12, 20 and 30 periods of the strongest mode the change of five yielding sticks was told
    # in 5, 5 and 4, that of four linear ones in none. Nine segments are three a third.
    period, fewest = 1.0 / strongest_hz(floors, step) / step, 9
    for periods in (20.0, 12.0):
        length = min(round(periods * period), 2 * base.size // (fewest + 1))
        if length < 16 or periods * period > 2 * length:
            return ()
        segments = cut(base.size, step, length, length * step)
        motion = np.stack([floors[:, start : start + length] for start in segments.starts])
        power = (window_of(length) * motion**2).mean(axis=2)
        strength = np.sqrt((power / power.mean(axis=0)).mean(axis=1))
        # Silence of a fiftieth of the strongest is noise.
        order = [k for k in strength.argsort() if strength[k] > 0.02 * strength.max()]
        if len(order) >= fewest:
            break
    else:
        return ()
    thirds = [part.tolist() for part in np.array_split(order, 3)]
    levels = [np.log2(np.sqrt((strength[third] ** 2).mean())) for third in thirds]
    try:
        parts = [
            estimate_frf(seen.histories, seen.frequency_hz, direction, None, segments.only(third))
            for third in thirds
        ]
    except MeasurementError:
        return ()
    used = seen.valid.any(axis=0)
    return tuple(
        replace(part, valid=part.valid & used, level=float(level - levels[0]))
        for part, level in zip([select_floors(p, seen.floors) for p in parts], levels, strict=True)
    )


def _between(bins: Floats, grid: Floats, inside: Flags) -> csr_array:
    """(m, b) straight lines between values at bins; zero where the grid lies outside."""
    upper = np.clip(np.searchsorted(bins, grid), 1, bins.size - 1)
    share = (grid - bins[upper - 1]) / (bins[upper] - bins[upper - 1])
    rows = np.flatnonzero(inside)
    weights = np.concatenate([1.0 - share[rows], share[rows]])
    places = np.tile(rows, 2), np.concatenate([upper[rows] - 1, upper[rows]])
    return csr_array((weights, places), shape=(grid.size, bins.size))


def _at_grid(between: csr_array, inside: Flags, values: Any) -> Any:
    """Values (..., b) at bins on the grid (..., m), NaN where that lies outside."""
    return np.where(inside, (between @ values.T).T, np.nan)


def _smooth(density: Floats) -> Floats:
    """Mean of a density (f, b) over its neighbours, Hann-weighted."""
    from scipy.ndimage import convolve1d

    kernel = np.hanning(2 * _NOISE_BINS * PADDING + 1)
    return np.asarray(convolve1d(density, kernel / kernel.sum(), axis=-1, mode="nearest"))


def _narrow_peaks(spectra: Spectra, trusted: Flags, above_hz: float) -> Floats:
    """Frequencies (p,) of peaks of all floors together that are about as narrow as the window's.

    What the means that were taken off leak below is higher than any peak.
    """
    from scipy.ndimage import maximum_filter1d

    power = np.square(np.abs(spectra.cross)).sum(axis=0) / np.maximum(spectra.base, _TINY) ** 2
    power = np.where(trusted.any(axis=0) & (spectra.frequency_hz >= above_hz), power, 0.0)
    # A Hann window's own has a half-power width of 1.44 / T.
    half = round(1.25 * PADDING)
    away = np.pad(power, half)
    highest = (power > 0.0) & (power == maximum_filter1d(power, 2 * half + 1))
    narrow = np.maximum(away[: -2 * half], away[2 * half :]) < 0.5 * power
    return np.asarray(spectra.frequency_hz[highest & narrow])


def _incoherent(spectra: Spectra, coherence: Floats, averages: float, inputs: int) -> Floats:
    """Power of each floor (f, b) that does not follow the base."""
    free = max(averages - inputs, 1.0)
    share = (1.0 - np.minimum(coherence, 1.0)) * averages / free
    return _smooth(share * spectra.floors)


def _noise(spectra: Spectra, coherence: Floats, incoherent: Floats, averages: float) -> Floats:
    """sd(ln|H|) at the bins (f, b)."""
    # (1 - g2) / g2 is the ratio of incoherent to coherent power.
    ratio = np.minimum(incoherent / np.maximum(coherence * spectra.floors, _TINY), 1e6)
    return np.maximum(np.sqrt(ratio / (2.0 * averages)), LEAST_NOISE)


def _left(
    inputs: Floats, floors: Floats, time_step: float, seconds: float, grid: Floats
) -> Complexes:
    """Cross densities (f, f, m) of what does not follow the excitation, as segments blunt it."""
    frequency, density = noise_of_lines(inputs, floors, time_step, grid[-1] + 2.0 / seconds)
    if not frequency.size:
        return np.full((len(floors), len(floors), grid.size), np.nan + 0j)
    # The spectrum of a Hann window reaches to 2 / T.
    away = np.abs(grid[:, None] - frequency) * seconds / 2.0
    weight = np.where(away < 1.0, np.cos(0.5 * np.pi * np.minimum(away, 1.0)) ** 4, 0.0)
    lonely = weight.sum(axis=1) == 0.0
    weight[lonely, away[lonely].argmin(axis=1)] = 1.0
    return np.asarray(density @ (weight / weight.sum(axis=1, keepdims=True)).T)


def _parts_of_noise(
    across: Complexes,
    frf: Complexes,
    spectra: Spectra,
    at_grid: Callable[[Any], Any],
    valid: Flags,
    leaking: Floats,
    averages: float,
    early: float,
) -> tuple[Floats, Floats, Floats]:
    """Variance of ln|H| of floors alone (f, m) and of all alike (m,), share (b,) of the base.

    Args:
        across: cross densities (f, f, m) of what does not follow the base.
        leaking: (f, m) standard deviation of ln|H| with what leaks.
        early: power of the floors as the record begins over that of all of it.
    """
    gain, power = np.maximum(np.abs(frf), _TINY) ** 2, at_grid(spectra.base)
    counted = 2.0 * averages * power
    # Over the responses of both floors, as noise of the base would be alike.
    response = np.where(np.abs(frf) > 0.0, frf, 1.0)
    across = across / (response[:, None] * response[None].conj())
    left = np.fmin(np.einsum("iim->im", across).real, counted * leaking**2)
    of_base = _of_base(across, valid)
    # A gain that errs with the estimate would give its points weight by their errors.
    smooth = np.exp(2.0 * _smooth(np.log(np.abs(spectra.cross) / spectra.base + _TINY)))
    # What is left at each floor but not at all is nothing, as a difference, at half of the points
    # where the base's noise rules. That of a sensor, the least, is even over frequency, and found
    # best where little else is left.
    beside, weight = left - of_base, np.nan_to_num(1.0 / np.maximum(left * gain, _TINY) ** 2)
    even = (weight * np.nan_to_num(beside * gain)).sum(axis=1)
    even = np.maximum(even / np.maximum(weight.sum(axis=1), _TINY), 0.0)[:, None]
    alone = np.maximum(beside, even / gain) * gain / at_grid(smooth) / counted
    # What is brought along leaks into the first segment, and is in no means. Tried on towers in
    # motion of 20 to 120 s, damping 1 and 2 %: as much, or a third of it.
    brought = early * np.maximum(leaking**2 - left / counted, 0.0).min(axis=0) / averages**2
    share = np.minimum(of_base / np.maximum(spectra.base, _TINY), 0.5)
    return np.maximum(alone, LEAST_NOISE**2), of_base / counted + brought, share


def _of_base(across: Complexes, valid: Flags) -> float:
    """Density of the noise in the base, from what is left across floors (f, f, m).

    It is left at all of them alike, and found best where little else is left of two.
    """
    count, seen = len(across), valid.all(axis=0) & np.isfinite(across).all(axis=(0, 1))
    first, second = np.triu_indices(count, 1) if count > 1 else np.diag_indices(1)
    power = np.einsum("iim->im", across[..., seen]).real
    weight = 1.0 / np.maximum(power[first] * power[second], _TINY)
    common = (weight * across[first, second][:, seen].real).sum() / max(weight.sum(), _TINY)
    # Of towers with noise of 1 to 20 %, 20 to 600 s long: .7 to .95 of the truth.
    return max(float(common), 0.0)


def _trusted(spectra: Spectra, incoherent: Floats, noise: Floats, averages: float) -> Flags:
    """Whether an estimate at the bins (f, b) may be used."""
    from scipy.ndimage import maximum_filter1d

    around = 1.0 - incoherent / np.maximum(_smooth(spectra.floors), _TINY)
    # Chance exceeds g2 with probability (1 - g2)^(n - 1) between unrelated signals. The coherence
    # around a frequency rests on about half as many more averages as it has bins (Hann windows
    # make neighbours repeat each other).
    pooled = averages * (2 * _NOISE_BINS + 1) / 2.0
    # A coherence that unrelated signals exceed in one of a hundred counts as zero.
    chance = 1.0 - 0.01 ** (1.0 / (pooled - 1.0))
    # Ten independent bins to either side are nearby.
    nearby = maximum_filter1d(spectra.base, 2 * 10 * PADDING + 1)
    # With so little power the base shows leakage: far side lobes of the window fall as k^-6.
    # Likewise of the largest power anywhere.
    power = (spectra.base > 1e-3 * nearby) & (spectra.base > 1e-7 * spectra.base.max())
    # Below a coherence of a half, noise in the base could bias H1 as much as noise in the floor
    # scatters it.
    related = around >= max(0.5, chance)
    # Above a noise of 0.5 the first-order relation with the coherence no longer holds.
    return np.asarray(related & (noise <= 0.5) & power)


def _require_points(valid: Flags, source: str) -> None:
    if not valid.any():
        raise MeasurementError(
            f"{source}: no point of the frequency grid can be used (base without power there, or"
            " floors that do not follow it); check the channels, the sampling and the grid"
        )


def _of_sensors(
    histories: Histories, direction: str, inputs: Floats, sensors: Sequence[str]
) -> tuple[str, ...]:
    """Sentences on sensors that are averaged, and on further motions of the base."""
    told = (BASE, *(sensors or histories.floors))
    places = dict.fromkeys(to.floor for to in histories.channels if to.floor in told)
    counts = {floor: len(histories.rows(floor, direction)) for floor in places}
    several = [f"{floor} ({count})" for floor, count in counts.items() if count > 1]
    averaged = [f"Sensors averaged in time: {', '.join(several)}."] if several else []
    turns = said_of_rotation(histories.channels, histories.acceleration, inputs[0])
    across: tuple[str, ...] = ()
    if histories.crosses and not histories.force:
        name = channel_name(BASE, direction=other_horizontal(direction))
        follow = "Floors follow the base's motion across, too"
        across = (
            f"{follow}: {name} is an input."
            if len(inputs) > 2
            else f"{follow}; without a column {name} it counts as noise.",
        )
    return (*averaged, *turns, *across)


def _gaps(
    floors: tuple[str, ...], valid: Flags, inside: Flags, sensors: Sequence[str]
) -> tuple[str, ...]:
    """Sentences on the points that cannot be used, of some floors or all."""
    notes: list[str] = []
    if not inside.all():
        notes.append(
            f"{np.count_nonzero(~inside)} of {inside.size} frequencies lie outside what was"
            " measured."
        )
    rows = zip(floors, valid, strict=True)
    weak = {f: np.count_nonzero(inside & ~row) for f, row in rows if f in (sensors or floors)}
    for count in dict.fromkeys(filter(None, weak.values())):
        alike = [floor for floor, its in weak.items() if its == count]
        each = " each" if len(alike) > 1 else ""
        notes.append(
            f"{', '.join(alike)}: {count} points{each} left out for low coherence or base power."
        )
    return tuple(notes)
