"""Spectra of base and floors by Welch's method, and the averages in them."""

from dataclasses import dataclass, replace

import numpy as np

from femupdate.arrays import Complexes, Floats, Indices
from femupdate.errors import MeasurementError
from femupdate.measurement.thresholds import SPECTRUM


@dataclass(frozen=True)
class Segments:
    """How a record is cut.

    Attributes:
        length: samples in a segment.
        count: number of segments, each overlapping half of the one before.
        effective: number of independent segments that average as well.
        seconds: length of a segment, s.
        wanted: the length that the frequency grid asks for, s.
        first, every: of these segments in half-overlapping ones, and the step between them.
    """

    length: int
    count: int
    effective: float
    seconds: float
    wanted: float
    first: int = 0
    every: int = 1

    @property
    def starts(self) -> Indices:
        """Samples (s,) at which segments begin."""
        hop = self.length - self.length // 2
        return hop * (self.first + self.every * np.arange(self.count, dtype=np.int32))

    def half(self, number: int) -> "Segments":
        """Every other segment, from the first or the second.

        Both halves err all but independently: of half-overlapping Hann windows that are neighbours
        the squared correlation is 1/36 (Welch 1967).
        """
        count = (self.count + 1 - number) // 2
        return replace(self, count=count, effective=float(count), first=number, every=2)

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
        padding: bins per independent bin.
    """

    frequency_hz: Floats
    base: Floats
    floors: Floats
    cross: Complexes
    padding: int = SPECTRUM.padding


def effective_averages(length: int, count: int) -> float:
    """Return how many independent segments average as well as `count` half-overlapping ones.

    The variance formula of Welch (1967) for Hann windows: n = K / (1 + 2 (1 - 1/K) rho), rho the
    squared correlation of neighbouring windows (1/36 for long ones).
    """
    window, hop = window_of(length), length - length // 2
    rho = (np.sum(window[: length - hop] * window[hop:]) / np.sum(window**2)) ** 2
    return float(count / (1.0 + 2.0 * (1.0 - 1.0 / count) * rho))


def choose_segments(samples: int, time_step: float, wanted_s: float, source: str) -> Segments:
    """Cut a record as the grid wants, or shorter to leave enough averages.

    Raises:
        MeasurementError: the record is too short.
    """
    length = round(wanted_s / time_step)
    if length > samples or _cut(samples, time_step, length, wanted_s).effective < SPECTRUM.averages:
        # K half-overlapping segments fill (K + 1) / 2 lengths.
        length = 2 * samples // (int(np.ceil(SPECTRUM.averages)) + 2)
    if length < SPECTRUM.shortest:
        raise MeasurementError(
            f"{source}: {samples} samples are too short for a spectrum; give a longer record"
        )
    return _cut(samples, time_step, length, wanted_s)


def welch_spectra(base: Floats, floors: Floats, time_step: float, segments: Segments) -> Spectra:
    """Return the spectra of base (n,) and floors (f, n), segment means removed."""
    from scipy.signal import csd, welch

    length, overlap = segments.length, segments.length // 2
    if segments.every > 1:  # one behind the other, without overlap
        chosen = (segments.starts[:, None] + np.arange(length)).ravel()
        base, floors, overlap = base[chosen], floors[:, chosen], 0
    options = {
        "fs": 1.0 / time_step,
        "window": "hann",
        "nperseg": length,
        "noverlap": overlap,
        "nfft": SPECTRUM.padding * length,
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
    padded = SPECTRUM.padding * length
    spectra = np.fft.rfft(window * (cut - cut.mean(axis=1, keepdims=True)), padded)
    bins = np.asarray(np.fft.rfftfreq(padded, time_step), dtype=np.float64)
    return np.asarray(spectra), bins, np.asarray(starts * time_step, dtype=np.float64)


def _cut(samples: int, time_step: float, length: int, wanted_s: float) -> Segments:
    overlap = length // 2
    count = (samples - overlap) // (length - overlap)
    effective = effective_averages(length, count) if count else 0.0
    return Segments(length, count, effective, length * time_step, wanted_s)


def window_of(length: int) -> Floats:
    """The Hann window (length,) of a segment."""
    from scipy.signal import get_window

    return np.asarray(get_window("hann", length), dtype=np.float64)
