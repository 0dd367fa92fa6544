"""Observation files, written as they are read, all at once or not at all."""

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from femupdate.errors import MeasurementError
from femupdate.measurement.columns import FREQUENCY, TIME
from femupdate.measurement.histories import Histories
from femupdate.measurement.mode_table import DAMPING, DAMPING_SD, FREQUENCY_SD, MODE
from femupdate.measurement.recording import RecordedMode
from femupdate.storage import atomic_path

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
    names, values = [one.name for one in histories.channels], histories.acceleration
    buffer = io.StringIO()
    buffer.writelines(f"# {line}\n" for comment in comments for line in comment.splitlines())
    buffer.write(",".join([TIME, *names]) + "\n")
    buffer.write(",".join(["s", *["m/s2"] * len(names)]) + "\n")
    time = np.arange(values.shape[1]) * histories.time_step
    formats = [_TIME_FORMAT, *[f"%.{digits}g"] * len(names)]
    np.savetxt(buffer, np.column_stack([time, values.T]), fmt=formats, delimiter=",")
    return _write_text(path, buffer.getvalue())


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


def _write_text(path: str | Path, text: str) -> Path:
    target = Path(path)
    with atomic_path(target, MeasurementError) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return target
