"""The netCDF file of a prediction."""

import json
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.dynamics.spectra import FloorSpectra
from femupdate.dynamics.summary import HistorySummary
from femupdate.measurement.record import GroundMotion
from femupdate.storage import write_tree

_BASE = ("base_acceleration", "base_rotation")  # m/s2, rad/s2


def save_prediction(
    summary: HistorySummary,
    alone: HistorySummary,
    motion: GroundMotion,
    path: Path,
    damping: str,
    spectra: FloorSpectra | None = None,
    measured: Floats | None = None,
) -> None:
    """Write netCDF groups `predictions` (bands, per-sample peaks) and `constant_data`.

    Bands and peaks are those of the next measurement (`summary`); variables that begin with
    `parameters_`, and stiffnesses, are of the parameters alone. Floors that were measured in the
    same motion, (f, n) m/s2 with NaN where there is no sensor, are kept beside the base motion,
    which has a rotation where one was measured.
    """
    import xarray as xr

    stories = np.arange(1, summary.peak_shear.shape[1] + 1)
    coordinates = {"floor": list(summary.floors), "time_s": summary.time, "story": stories}
    predictions = xr.Dataset(
        {
            "acceleration_mean": (("floor", "time_s"), summary.acceleration_mean),
            "acceleration_sd": (("floor", "time_s"), summary.acceleration_sd),
            "parameters_acceleration_mean": (("floor", "time_s"), alone.acceleration_mean),
            "parameters_acceleration_sd": (("floor", "time_s"), alone.acceleration_sd),
            "peak_acceleration": (("sample", "floor"), summary.peak_acceleration),
            "peak_shear": (("sample", "story"), summary.peak_shear),
            "peak_drift": (("sample", "story"), summary.peak_drift),
            "story_stiffness": (("sample", "story"), alone.story_stiffness),
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
        dict(zip(_BASE, [("time_s", row) for row in motion.inputs], strict=False)),
        {"time_s": summary.time},
    )
    if measured is not None:
        constant = constant.assign_coords(floor=list(summary.floors)).assign(
            measured_acceleration=(("floor", "time_s"), measured)
        )
    tree = xr.DataTree.from_dict({"/predictions": predictions, "/constant_data": constant})
    tree.attrs = {"record": motion.name, "channel": motion.channel, "damping": damping}
    write_tree(tree, path)
