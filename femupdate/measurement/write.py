"""Observation files and records, written as they are read, all at once or not at all."""

import contextlib
import io
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from femupdate.errors import MeasurementError
from femupdate.measurement.columns import TIME
from femupdate.measurement.observation_file import Histories
from femupdate.measurement.record import GroundMotion

Floats = NDArray[np.float64]

_TIME_FORMAT = "%.10g"
_ACCELERATION_FORMAT = "%.9g"


def write_observation_histories(
    path: str | Path, histories: Histories, comments: Sequence[str] = ()
) -> Path:
    """Write histories as an observation file in s and m/s2, and return its path.

    Args:
        path: the CSV file; one that is there is replaced once the new one is whole.
        histories: what to write, at nine significant digits.
        comments: lines that say where the numbers come from; each gets a # in front.

    Raises:
        MeasurementError: the file cannot be written.
    """
    names = [channel.name for channel in histories.channels]
    return _write_table(path, names, histories.acceleration, histories.time_step, comments)


def write_record(path: str | Path, motion: GroundMotion, comments: Sequence[str] = ()) -> Path:
    """Write a ground motion as a table of time and acceleration in m/s2, and return its path.

    Args:
        path: the CSV file; one that is there is replaced once the new one is whole.
        motion: what to write, at nine significant digits.
        comments: lines that say where the numbers come from; each gets a # in front.

    Raises:
        MeasurementError: the file cannot be written.
    """
    name = " ".join(motion.channel.replace(",", " ").split()) or "acceleration"
    return _write_table(path, [name], motion.acceleration[None], motion.time_step, comments)


def _write_table(
    path: str | Path,
    names: Sequence[str],
    values: Floats,
    time_step: float,
    comments: Sequence[str],
) -> Path:
    buffer = io.StringIO()
    for comment in comments:
        buffer.writelines(f"# {line}\n" for line in comment.splitlines())
    buffer.write(",".join([TIME, *names]) + "\n")
    buffer.write(",".join(["s", *["m/s2"] * len(names)]) + "\n")
    time = np.arange(values.shape[1]) * time_step
    formats = [_TIME_FORMAT, *[_ACCELERATION_FORMAT] * len(names)]
    np.savetxt(buffer, np.column_stack([time, values.T]), fmt=formats, delimiter=",")
    return _replace(Path(path), buffer.getvalue())


def _replace(path: Path, text: str) -> Path:
    """Write beside the file and move into place, so that nobody ever sees half of it."""
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        part.write_text(text, encoding="utf-8", newline="\n")
        os.replace(part, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        raise MeasurementError(
            f"{path}: cannot be written ({error.strerror}); check the folder and the space on it"
        ) from None
    return path
