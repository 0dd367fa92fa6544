"""Observation files and records, written as they are read, all at once or not at all."""

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.atomic import atomic_path
from femupdate.errors import MeasurementError
from femupdate.measurement.columns import BASE, FREQUENCY, TIME, vertical_channel
from femupdate.measurement.mode_table import DAMPING, DAMPING_SD, FREQUENCY_SD, MODE
from femupdate.measurement.observation_file import Histories
from femupdate.measurement.record import GroundMotion
from femupdate.measurement.recording import RecordedMode

_TIME_FORMAT = "%.10g"
DIGITS = 9  # significant ones of accelerations


def write_observation_histories(
    path: str | Path, histories: Histories, comments: Sequence[str] = (), digits: int = DIGITS
) -> Path:
    """Write histories as an observation file in s and m/s2, and return its path.

    Args:
        path: the CSV file; one that is there is replaced once the new one is whole.
        histories: what to write.
        comments: lines that say where the numbers come from; each gets a # in front.
        digits: significant ones of the accelerations.

    Raises:
        MeasurementError: the file cannot be written.
    """
    names = [channel.name for channel in histories.channels]
    values = histories.acceleration
    return _write_table(path, names, values, histories.time_step, comments, digits=digits)


def write_record(path: str | Path, motion: GroundMotion, comments: Sequence[str] = ()) -> Path:
    """Write a ground motion as a table of time and acceleration in m/s2, and return its path.

    Args:
        path: the CSV file; one that is there is replaced once the new one is whole.
        motion: what to write, at nine significant digits; its rotation as two vertical sensors at
            one metre to either side would have it.
        comments: lines that say where the numbers come from; each gets a # in front.

    Raises:
        MeasurementError: the file cannot be written.
    """
    names = [" ".join(motion.channel.replace(",", " ").split()) or "acceleration"]
    rows = motion.inputs
    if motion.rotation is not None:
        names = [BASE, *(vertical_channel(place).name for place in (-1.0, 1.0))]
        rows = np.stack([motion.acceleration, motion.rotation, -motion.rotation])
    return _write_table(path, names, rows, motion.time_step, comments)


def write_modes(
    path: str | Path, modes: Sequence[RecordedMode], comments: Sequence[str] = ()
) -> Path:
    """Write identified modes of real shapes as a table, and return its path.

    Args:
        path: the CSV file; one that is there is replaced once the new one is whole.
        modes: with the same sensors.
        comments: lines that say where the modes come from; each gets a # in front.

    Raises:
        MeasurementError: the file cannot be written.
    """
    sensors = modes[0].sensors
    spreads = [() if mode.shape_sd is None else tuple(mode.shape_sd) for mode in modes]
    names = [MODE, FREQUENCY, FREQUENCY_SD, DAMPING, DAMPING_SD, *sensors]
    names += [f"{name}_sd" for name in sensors] if all(spreads) else []
    rows = [
        [mode.frequency_hz, mode.frequency_sd_hz, mode.damping, mode.damping_sd, *mode.shape, *sd]
        for mode, sd in zip(modes, spreads, strict=True)
    ]
    lines = [f"# {line}" for comment in comments for line in comment.splitlines()]
    lines.append(",".join(names))
    for mode, row in zip(modes, rows, strict=True):
        cells = ["" if value is None else f"{value:.6g}" for value in row]
        lines.append(",".join([mode.name, *cells]))
    return _write_text(path, "\n".join(lines) + "\n")


def _write_table(
    path: str | Path,
    names: Sequence[str],
    values: Floats,
    time_step: float,
    comments: Sequence[str],
    *,
    digits: int = DIGITS,
) -> Path:
    """Write accelerations (c, n) in m/s2 under the names of their columns."""
    buffer = io.StringIO()
    for comment in comments:
        buffer.writelines(f"# {line}\n" for line in comment.splitlines())
    buffer.write(",".join([TIME, *names]) + "\n")
    buffer.write(",".join(["s", *["m/s2"] * len(names)]) + "\n")
    time = np.arange(values.shape[1]) * time_step
    formats = [_TIME_FORMAT, *[f"%.{digits}g"] * len(names)]
    np.savetxt(buffer, np.column_stack([time, values.T]), fmt=formats, delimiter=",")
    return _write_text(path, buffer.getvalue())


def _write_text(path: str | Path, text: str) -> Path:
    target = Path(path)
    with atomic_path(target, MeasurementError) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return target
