"""FRFs as an estimate from histories shows them, by the very base motion that was measured.

Welch's estimate H1 = sum conj(X_s) Y_s / sum |X_s|^2 over segments s is linear in the floors'
motion, and that is linear in the FRF: y = sum over frequencies of H X exp(i omega t). H1 is then a
mean of the FRF over neighbouring frequencies, with weights that the base motion alone fixes. In
stationary white noise these are the squared spectrum of the window (Bendat and Piersol 2010,
section 8.5); in an earthquake, which ends before the building does, they are not, and peaks come
out higher or lower by several percent. A model's FRF goes through the same means before it is
compared. What the base's rotation and its motion across add to the floors' goes through means of
their own, which all of these motions fix together.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import permutations

import numpy as np
import torch
from scipy.fft import next_fast_len
from scipy.sparse import csr_array, diags_array
from torch import Tensor

from femupdate.arrays import Complexes, Flags, Floats, Indices
from femupdate.errors import MeasurementError

# Figures by which files are judged.
PADDING = 4  # bins for each independent one: the FRF is then nearly straight between them
LIGHTEST = 0.003  # damping ratio down to which peaks are resolved, that of bare steel

_DIGITS = 9  # of frequencies in Hz that are the same


@dataclass(frozen=True)
class Segments:
    """How a record is cut.

    Attributes:
        count: number of segments, each overlapping half of the one before.
        effective: number of independent segments that average as well.
        wanted: the length that the frequency grid asks for, s.
        chosen: numbers of these segments among half-overlapping ones; all of them where empty.
    """

    length: int
    count: int
    effective: float
    seconds: float
    wanted: float
    chosen: tuple[int, ...] = ()

    @property
    def starts(self) -> Indices:
        """Samples (s,) at which segments begin."""
        hop = self.length - self.length // 2
        return hop * np.array(self.chosen or range(self.count), dtype=np.int32)

    def half(self, number: int) -> "Segments":
        """Every other segment, from the first or the second.

        Both halves err all but independently: of half-overlapping Hann windows that are neighbours
        the squared correlation is 1/36 (Welch 1967).
        """
        return self.only(range(number, self.count, 2))

    def only(self, chosen: Sequence[int]) -> "Segments":
        """Some of the segments, by their numbers."""
        numbers = np.sort(np.asarray(chosen, dtype=np.intp))
        neighbours = int((np.diff(numbers) == 1).sum())
        effective = len(numbers) / (1.0 + 2.0 * neighbours / len(numbers) / 36.0)
        return replace(
            self, count=len(numbers), effective=effective, chosen=tuple(numbers.tolist())
        )

    @property
    def note(self) -> str:
        """One sentence for the user."""
        text = (
            f"Welch H1 with {self.count} Hann segments of {self.seconds:.4g} s, half overlapping"
            f" ({self.effective:.1f} independent averages)."
        )
        if self.seconds < 0.99 * self.wanted:
            text += (
                f" The frequency step asks for {self.wanted:.4g} s, for which the record is too"
                f" short: peaks narrower than {2.0 / self.seconds:.2g} Hz come out too low."
            )
        return text


@dataclass(frozen=True, eq=False)
class Spectra:
    """One-sided spectral densities.

    Attributes:
        frequency_hz: (b,) the bins.
        base: (b,) of the base.
        floors: (f, b) of each floor.
        cross: (f, b) of base and floor, conj(base) times floor.
    """

    frequency_hz: Floats
    base: Floats
    floors: Floats
    cross: Complexes


def effective_averages(length: int, count: int) -> float:
    """Return how many independent segments average as well as `count` half-overlapping ones.

    The variance formula of Welch (1967) for Hann windows: n = K / (1 + 2 (1 - 1/K) rho), rho the
    squared correlation of neighbouring windows (1/36 for long ones).
    """
    window, hop = window_of(length), length - length // 2
    rho = (np.sum(window[: length - hop] * window[hop:]) / np.sum(window**2)) ** 2
    return float(count / (1.0 + 2.0 * (1.0 - 1.0 / count) * rho))


def choose_segments(samples: int, time_step: float, wanted_s: float, source: str) -> Segments:
    """Cut a record as the grid wants, or shorter to leave enough averages."""
    length, averages = round(wanted_s / time_step), 5
    if length > samples or cut(samples, time_step, length, wanted_s).effective < averages:
        # K half-overlapping segments fill (K + 1) / 2 lengths.
        length = 2 * samples // (averages + 2)
    # Sixteen samples of a segment, at least.
    if length < 16:
        raise MeasurementError(
            f"{source}: {samples} samples are too short for a spectrum; give a longer record"
            + (", or are the times in ms? Then call them time_s (ms)" if time_step > 0.5 else "")
        )
    return cut(samples, time_step, length, wanted_s)


def welch_spectra(base: Floats, floors: Floats, time_step: float, segments: Segments) -> Spectra:
    """Return the spectra of base (n,) and floors (f, n), segment means removed."""
    from scipy.signal import csd, welch

    length, overlap = segments.length, segments.length // 2
    if segments.chosen:  # one behind the other, without overlap
        chosen = (segments.starts[:, None] + np.arange(length)).ravel()
        base, floors, overlap = base[chosen], floors[:, chosen], 0
    options = {
        "fs": 1.0 / time_step,
        "window": "hann",
        "nperseg": length,
        "noverlap": overlap,
        "nfft": PADDING * length,
        "detrend": "constant",
    }
    frequency_hz, base_density = welch(base, **options)
    # Floor by floor: all at once would hold every segment of every floor in memory.
    floor_density = np.array([welch(floor, **options)[1] for floor in floors])
    cross_density = np.array([csd(base, floor, **options)[1] for floor in floors])
    return Spectra(frequency_hz, base_density, floor_density, cross_density)


def segment_spectra(
    base: Floats, time_step: float, segments: Segments
) -> tuple[Complexes, Floats, Floats]:
    """Spectra (s, b) of a base's segments, the bins (b,), Hz, and the starts (s,), s."""
    length, starts = segments.length, segments.starts
    cut = np.stack([base[start : start + length] for start in starts])
    window = window_of(length)
    padded = PADDING * length
    spectra = np.fft.rfft(window * (cut - cut.mean(axis=1, keepdims=True)), padded)
    bins = np.asarray(np.fft.rfftfreq(padded, time_step), dtype=np.float64)
    return np.asarray(spectra), bins, np.asarray(starts * time_step, dtype=np.float64)


def cut(samples: int, time_step: float, length: int, wanted_s: float) -> Segments:
    """Half-overlapping segments of so many samples."""
    overlap = length // 2
    count = (samples - overlap) // (length - overlap)
    effective = effective_averages(length, count) if count else 0.0
    return Segments(length, count, effective, length * time_step, wanted_s)


def window_of(length: int) -> Floats:
    """The Hann window (length,) of a segment."""
    from scipy.signal import get_window

    return np.asarray(get_window("hann", length), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Estimator:
    """What an estimate makes of an FRF.

    Attributes:
        frequency_hz: (e,) at which the FRF is asked for, increasing.
        columns: (k, e) complex means that give the estimate on a grid, of FRFs to every column of
            the excitation: a force, or of the base translation, rotation, motion across.
        shared: (k,) standard deviation of ln|H| that all floors have in common; none where it is
            not known.
    """

    frequency_hz: Floats
    columns: tuple[csr_array, ...]
    shared: Floats = field(default_factory=lambda: np.zeros(0))

    @property
    def inputs(self) -> int:
        """Columns of the excitation."""
        return len(self.columns)

    @property
    def turns(self) -> bool:
        """Whether the base's own rotation was measured."""
        return len(self.columns) > 1 and self.columns[1].nnz > 0

    def __call__(self, *frf: Tensor) -> Tensor:
        """Estimates (N, f, k) of FRFs (N, f, e) to every column."""
        estimates = [
            torch.cat([column[..., seen] @ means.to(column) for seen, means in blocks], dim=-1)
            for column, blocks in zip(frf, self._blocks, strict=False)
        ]
        return torch.stack(estimates).sum(dim=0) if len(estimates) > 1 else estimates[0]

    def at(self, used: Flags) -> "Estimator":
        """The estimate at some frequencies (k,) of its grid."""
        rows = np.flatnonzero(used)
        columns = tuple(csr_array(means[rows]) for means in self.columns)
        shared = self.shared[rows] if self.shared.size else self.shared
        return replace(self, columns=columns, shared=shared)

    @cached_property
    def _blocks(self) -> list[list[tuple[slice, Tensor]]]:
        """Of every column the frequencies that neighbours see, and their means (e, k), dense."""
        found = []
        for means in self.columns:
            blocks = []
            # Thirty-two frequencies of the grid at a time: one sparse matrix is ten times slower.
            for begin in range(0, means.shape[0], 32):
                rows = means[begin : begin + 32]
                # Rows beyond the spectra are empty.
                columns = rows.nonzero()[1] if rows.nnz else np.zeros(1, dtype=int)
                seen = slice(int(columns.min()), int(columns.max()) + 1)
                dense = np.ascontiguousarray(rows[:, seen].toarray().T)
                blocks.append((seen, torch.from_numpy(dense)))
            found.append(blocks)
        return found


def noise_of_lines(
    inputs: Floats, floors: Floats, time_step: float, top_hz: float
) -> tuple[Floats, Complexes]:
    """Density of what does not follow the excitation, without what leaks, by no model.

    About every third line of the whole record's spectrum Y D = N X + T, with polynomials D of first
    and N and T of second degree over fifteen lines: T is what the motion at both ends of the record
    leaks, with the poles of the response (local rational method: McKelvey and Guerin 2012, IFAC
    Proc. 45(16), 424; Pintelon and Schoukens 2012, ch. 7).

    Args:
        inputs: (q, n) motion that drives the building.
        floors: (f, n) of each floor.

    Returns:
        Frequencies (l,), Hz, and one-sided cross densities (f, f, l).
    """
    inputs = inputs[inputs.any(axis=1)]
    half, degree = (7, 9, 11)[len(inputs) - 1], 2
    spectra = np.fft.rfft(inputs - inputs.mean(axis=1, keepdims=True))
    fine = np.asarray(np.fft.rfftfreq(inputs.shape[1], time_step), dtype=np.float64)
    last = min(int(top_hz / fine[1]), fine.size - 1) - half
    # Six thousand windows tell it to a few per cent, however long the record is.
    middle = np.arange(half + 1, last, max(half // 2, last // 6000))
    away = np.arange(-half, half + 1)
    near, powers = middle[:, None] + away, (away[:, None] / half) ** np.arange(degree + 1)
    columns = [row[near][:, :, None] * powers for row in spectra]
    columns.append(np.broadcast_to(powers, (len(middle), *powers.shape)))
    left = []
    for floor in floors:
        motion = np.fft.rfft(floor - floor.mean())[near]
        system = np.concatenate([*columns, (motion * away)[:, :, None]], axis=2)
        size = np.linalg.norm(system, axis=1, keepdims=True)
        basis = np.linalg.qr(system / np.maximum(size, np.finfo(float).tiny))[0]
        follows = np.einsum("lwp,lvp,lv->lw", basis, basis.conj(), motion, optimize=True)
        left.append(motion - follows)
    free = away.size - columns[0].shape[2] * len(columns) - 1
    rest = np.reshape(left, (len(floors), *near.shape))
    across = np.einsum("ilw,jlw->ijl", rest, rest.conj())
    return fine[middle], 2.0 * time_step / inputs.shape[1] / free * across


def estimator_of(
    inputs: Floats,
    time_step: float,
    segments: Segments,
    grid: Floats,
    bins: csr_array,
    noise: Floats,
    peaks: Floats,
) -> tuple[Estimator, Flags]:
    """The means that Welch's estimate takes of a building at rest before the record.

    Args:
        inputs: (c, n) force, or motion of the base, a row a column (see `Excitation`); zero where
            it was not measured.
        grid: (k,) frequencies of the estimate, evenly spaced, Hz.
        bins: (k, b) that brings estimates at the bins of the spectra to the grid.
        noise: (b,) share of the first input's power that the building does not follow.
        peaks: (p,) frequencies of peaks that may be narrower than the window's, increasing, Hz.

    Returns:
        And whether the means hold (k,): not where what leaks from far away rules.
    """
    length = segments.length
    # A motion that lasted longer would come round again, into the first segments.
    lasting = 4.0 / (2.0 * np.pi * LIGHTEST * peaks[:1]) / time_step
    padded = next_fast_len(inputs.shape[1] + int(np.append(lasting, 2 * length).max()), real=True)
    fine = np.asarray(np.fft.rfftfreq(padded, time_step), dtype=np.float64)
    spectra = np.fft.rfft(inputs, padded)
    cut = [segment_spectra(row, time_step, segments) for row in inputs]
    of_segments, bin_hz, starts = cut[0]
    power = np.square(np.abs(of_segments)).sum(axis=0)
    # Of every column, what goes with a unit of the first one.
    shares = [
        (of_segments.conj() * weighted).sum(axis=0) / np.maximum(power, np.finfo(float).tiny)
        for weighted, _, _ in cut
    ]
    used = np.unique(bins.nonzero()[1])
    # Beyond four times 1 / T the spectrum of a Hann window of length T is negligible.
    reach = 4.0 / segments.seconds
    dense = _dense(grid, reach, segments.seconds, peaks, fine[1])
    # Within the main lobe of zero frequency means were taken off, which leak like steps.
    rows, columns, holds = [], [], bin_hz * segments.seconds > 2.0 - 1e-6
    values: list[list[Complexes]] = [[] for _ in inputs]
    width = int(np.ceil(reach / fine[1]))
    offsets = np.arange(-width, width + 1)
    turns = np.exp(2j * np.pi * fine[1] * starts[:, None] * offsets)
    for some in np.array_split(used, max(1, len(used) // 512)):
        middle = np.rint(bin_hz[some] / fine[1]).astype(int)
        near = np.clip(middle[:, None] + offsets, 1, len(fine) - 1)
        inside = middle[:, None] + offsets == near
        turn = np.exp(2j * np.pi * fine[1] * middle[:, None] * starts)
        together = (turn * of_segments[:, some].conj().T) @ turns
        apart = 2.0 * np.pi * time_step * (bin_hz[some, None] - fine[near])
        seen = _window_spectrum(apart, length)
        parts = [np.where(inside, together * spectrum[near] * seen, 0.0) for spectrum in spectra]
        # They add up to the power of the segments, but where what leaks in from beyond the reach
        # rules, as near zero frequency: there phases say nothing.
        of_all = padded * power[some, None]
        # In white noise and earthquakes above a third of a hertz the two differ by 3 % at most.
        believed = np.abs(parts[0].sum(axis=1, keepdims=True) - of_all) < 0.2 * of_all
        holds[some] &= believed[:, 0]
        size = np.abs(parts[0])
        whole = np.where(believed, parts[0], size).sum(axis=1, keepdims=True)
        # The building does not follow the noise, whose own means are those of white noise.
        means_of_noise = np.where(inside, np.square(np.abs(seen)), 0.0)
        means_of_noise /= means_of_noise.sum(axis=1, keepdims=True)
        for number, (part, share) in enumerate(zip(parts, shares, strict=True)):
            means = np.where(believed, part, size * share[some, None]) / whole
            if number == 0:
                means = (means - noise[some, None] * means_of_noise) / (1.0 - noise[some, None])
            values[number].append(means.ravel())
        rows.append(np.repeat(some, offsets.size))
        columns.append(near.ravel())
    shape = (len(bin_hz), len(fine))
    at, cubics = (np.concatenate(rows), np.concatenate(columns)), _cubics(fine, dense)
    columns_of_all = [csr_array((np.concatenate(part), at), shape=shape) for part in values]
    for part in columns_of_all:
        part.eliminate_zeros()  # of motions that were not measured
    means_of_all = tuple(csr_array(bins @ part @ cubics) for part in columns_of_all)
    return Estimator(dense, means_of_all), np.asarray(bins @ holds > 0.999)


def mean_estimator(
    parts: Sequence[Estimator | None], shares: Floats, grid: Floats
) -> Estimator | None:
    """The mean of several estimates by shares (r, k) that add up to one; None is a table's."""
    known = [part for part in parts if part is not None]
    if not known:
        return None
    dense = np.unique(np.concatenate([part.frequency_hz.round(_DIGITS) for part in known]))
    empty = csr_array((len(grid), len(dense)), dtype=np.complex128)
    totals = [empty] * max(len(part.columns) for part in known)
    for part, share in zip(parts, shares, strict=True):
        columns = (csr_array(np.eye(len(grid))),) if part is None else part.columns
        asked = grid if part is None else part.frequency_hz
        at = np.searchsorted(dense, asked.round(_DIGITS))
        onto = csr_array((np.ones(len(at)), (np.arange(len(at)), at)), shape=(len(at), len(dense)))
        for number, means in enumerate(columns):
            totals[number] = csr_array(totals[number] + diags_array(share) @ means @ onto)
    shared = np.zeros(len(grid))
    for part, share in zip(parts, shares, strict=True):
        if part is not None and part.shared.size:
            shared += (share * part.shared) ** 2
    return Estimator(dense, tuple(totals), np.sqrt(shared))


def _window_spectrum(angle: Floats, total: int) -> Complexes:
    """sum w_t exp(-i angle t) of a Hann window of so many samples, by its closed form."""

    def kernel(shift: float) -> Complexes:
        half = 0.5 * (angle + shift)
        small = np.abs(np.sin(half)) < 1e-12
        ratio = np.where(small, total, np.sin(total * half) / np.where(small, 1.0, np.sin(half)))
        return ratio * np.exp(-1j * half * (total - 1))

    turn = 2.0 * np.pi / total
    return 0.5 * kernel(0.0) - 0.25 * (kernel(-turn) + kernel(turn))


def _dense(grid: Floats, reach: float, seconds: float, peaks: Floats, line: float) -> Floats:
    """Frequencies over a grid and beyond, above zero, about peaks some of the lines (Hz) alone."""
    step = float(np.median(np.diff(grid))) if grid.size > 1 else reach
    # Cubics lie between three frequencies in 1 / T and in a step, which resolves wide peaks.
    fine = step / int(np.ceil(3.0 * max(1.0, step * seconds) - 1e-9))
    below = min(int(np.ceil(reach / fine)) + 2, int(np.floor(grid[0] / fine - 1e-9)))
    below = max(below, 0)
    count = int(np.round((grid[-1] - grid[0]) / fine)) + int(np.ceil(reach / fine)) + 3
    first = grid[0] - below * fine
    if first <= 0.0:
        first, below = grid[0] - (below - 1) * fine, below - 1
    dense = first + fine * np.arange(below + count)
    for peak in peaks:
        # Twice in half the half-power bandwidth of the lightest damping.
        every = max(1, int(0.5 * LIGHTEST * peak / line))
        wide = int(0.5 * reach / (every * line))
        near = line * (round(peak / line) + every * np.arange(-wide, wide + 1))
        if every * line < fine and near[0] > dense[0] and near[-1] < dense[-1]:
            dense = np.concatenate([dense[(dense < near[0]) | (dense > near[-1])], near])
    return np.unique(dense.round(_DIGITS))


def _cubics(fine: Floats, dense: Floats) -> csr_array:
    """(j, e): values between four frequencies by the cubic through them (Lagrange)."""
    # Beyond the ends the first and the last value go on.
    at = np.clip(fine, dense[0], dense[-1])
    first = np.clip(np.searchsorted(dense, at, side="right") - 2, 0, len(dense) - 4)
    columns = first[:, None] + np.arange(4)
    nodes = dense[columns]
    weights = np.ones_like(nodes)
    for k, other in permutations(range(4), 2):
        weights[:, k] *= (at - nodes[:, other]) / (nodes[:, k] - nodes[:, other])
    rows = np.repeat(np.arange(len(fine)), 4)
    shape = (len(fine), len(dense))
    return csr_array((weights.ravel(), (rows, columns.ravel())), shape=shape)
