"""What is kept of a prediction: floor spectra and the netCDF file."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.dynamics.spectra import response_spectrum
from femupdate.dynamics.summary import HistorySummary, Statistics, statistics
from femupdate.measurement.record import GroundMotion
from femupdate.netcdf import write_tree
from femupdate.tables import table

_SPECTRUM_HZ, _SPECTRUM_POINTS = (0.2, 40.0), 120


@dataclass(frozen=True)
class FloorSpectra:
    """Response spectra of the floors: peak absolute acceleration of oscillators that stand there.

    Attributes:
        frequency_hz: (k,) of the oscillators.
        damping: their damping ratio.
        acceleration: (f, k) statistics over the samples, m/s2.
        base: (k,) of the ground motion itself, m/s2.
    """

    frequency_hz: Floats
    damping: float
    acceleration: Statistics
    base: Floats

    def as_dict(self, floors: Sequence[str]) -> dict[str, Any]:
        """What `--json` holds."""
        return {
            "frequency_hz": self.frequency_hz,
            "damping": self.damping,
            "base_m_s2": self.base,
            "floors_m_s2": self.acceleration.by_name(floors),
        }

    def table(self, floors: Sequence[str]) -> str:
        """The peak of every floor's mean spectrum, and where it lies."""
        mean = self.acceleration.mean
        rows = [
            (floor, f"{own.max():.3f}", f"{self.frequency_hz[own.argmax()]:.3g}")
            for floor, own in zip(floors, mean, strict=True)
        ]
        return table((f"spectrum, {self.damping:.0%}", "peak m/s2", "at Hz"), rows)


def floor_spectra(
    summary: HistorySummary, motion: GroundMotion, damping: float | None
) -> FloorSpectra | None:
    """Response spectra of the floors where a damping ratio of oscillators is given."""
    if damping is None:
        return None
    step = motion.time_step
    top = min(_SPECTRUM_HZ[1], 0.4 / step)
    frequency = np.geomspace(_SPECTRUM_HZ[0], top, _SPECTRUM_POINTS)
    of_floors = response_spectrum(summary.examples.floor_acceleration, step, frequency, damping)
    base = response_spectrum(motion.acceleration, step, frequency, damping)
    return FloorSpectra(frequency, damping, statistics(of_floors), base)


def save_prediction(
    summary: HistorySummary,
    motion: GroundMotion,
    path: Path,
    damping: str,
    spectra: FloorSpectra | None = None,
) -> None:
    """Write netCDF groups `predictions` (bands, per-sample peaks) and `constant_data`."""
    import xarray as xr

    stories = np.arange(1, summary.peak_shear.shape[1] + 1)
    coordinates = {"floor": list(summary.floors), "time_s": summary.time, "story": stories}
    predictions = xr.Dataset(
        {
            "acceleration_mean": (("floor", "time_s"), summary.acceleration_mean),
            "acceleration_sd": (("floor", "time_s"), summary.acceleration_sd),
            "peak_acceleration": (("sample", "floor"), summary.peak_acceleration),
            "peak_shear": (("sample", "story"), summary.peak_shear),
            "peak_drift": (("sample", "story"), summary.peak_drift),
            "story_stiffness": (("sample", "story"), summary.story_stiffness),
        },
        coords=coordinates,
        attrs={"units": json.dumps({"acceleration": "m/s2", "shear": "N", "drift": "m"})},
    )
    if spectra is not None:
        predictions = predictions.assign_coords(oscillator_hz=spectra.frequency_hz).assign(
            floor_spectrum_mean=(("floor", "oscillator_hz"), spectra.acceleration.mean),
            floor_spectrum_sd=(("floor", "oscillator_hz"), spectra.acceleration.sd),
        )
    constant = xr.Dataset(
        {"base_acceleration": ("time_s", motion.acceleration)}, {"time_s": summary.time}
    )
    tree = xr.DataTree.from_dict({"/predictions": predictions, "/constant_data": constant})
    tree.attrs = {"record": motion.name, "channel": motion.channel, "damping": damping}
    write_tree(tree, path)
