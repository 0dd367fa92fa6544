"""Observation files and tables of modes, written all at once or not at all."""

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from femupdate.errors import MeasurementError
from femupdate.measurement.modes import DAMPING, DAMPING_SD, FREQUENCY_SD, MODE
from femupdate.measurement.names import FREQUENCY, TIME
from femupdate.measurement.observation import Histories, Observation
from femupdate.measurement.recording import RecordedMode
from femupdate.storage import write_text

_TIME_FORMAT = "%.10g"


def write_observation_histories(
    path: str | Path, histories: Histories, comments: Sequence[str] = (), digits: int = 9
) -> Path:
    """Write histories as an observation file in s and m/s2, and return its path.

    Args:
        path: the CSV file; one that is there is replaced once the new one is whole.
        comments: lines that say where the numbers come from; each gets a # in front.
        digits: significant ones of the accelerations.
    """
    names, values = [channel.name for channel in histories.channels], histories.acceleration
    buffer = io.StringIO()
    buffer.writelines(f"# {line}\n" for comment in comments for line in comment.splitlines())
    buffer.write(",".join([TIME, *names]) + "\n")
    buffer.write(",".join(["s", *["m/s2"] * len(names)]) + "\n")
    time = np.arange(values.shape[1]) * histories.time_step
    formats = [_TIME_FORMAT, *[f"%.{digits}g"] * len(names)]
    np.savetxt(buffer, np.column_stack([time, values.T]), fmt=formats, delimiter=",")
    return write_text(path, buffer.getvalue(), MeasurementError)


def write_frfs(path: str | Path, seen: Observation) -> Path:
    """Write FRFs under base motion as a table, at frequencies where all floors have one."""
    whole = seen.valid.all(axis=0)
    names, columns = [FREQUENCY], [seen.frequency_hz[whole]]
    h = np.exp(seen.log_frf + (0.0 if seen.phase is None else 1j * seen.phase))[:, whole]
    for floor, row, noise in zip(seen.floors, h, seen.noise_sd[:, whole], strict=True):
        names += [floor] if seen.phase is None else [f"{floor}_re", f"{floor}_im"]
        columns += [row.real] if seen.phase is None else [row.real, row.imag]
        names, columns = [*names, f"{floor}_sd"], [*columns, noise]
    buffer = io.StringIO()
    np.savetxt(buffer, np.column_stack(columns), "%.9g", ",", header=",".join(names), comments="")
    return write_text(path, buffer.getvalue(), MeasurementError)


def write_modes(
    path: str | Path, modes: Sequence[RecordedMode], comments: Sequence[str] = ()
) -> Path:
    """Write identified modes of real shapes as a table, and return its path.

    Args:
        modes: with the same sensors.
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
    return write_text(path, "\n".join(lines) + "\n", MeasurementError)


def write_modes_uff(
    path: str | Path, modes: Sequence[RecordedMode], heights: Sequence[float], direction: str
) -> Path:
    """Write real shapes as a universal file: points (set 15) and a mode each (set 55).

    Args:
        modes: whose components are of points 1, 2, ..., in one direction.
        heights: of these points, m.
        direction: x or y.
    """
    axis, blocks = "xyz".index(direction), []
    points = [f"{k:10d}{1:10d}{1:10d}{11:10d}" for k in range(1, len(heights) + 1)]
    zero = f"{0:13.5E}" * 2
    blocks.append(
        ["    15", *(f"{p}{zero}{z:13.5E}" for p, z in zip(points, heights, strict=True))]
    )
    for number, mode in enumerate(modes, 1):
        figures = (mode.frequency_hz, 1.0, mode.damping or 0.0, 0.0)
        titles = [f"mode {mode.name}", *(f"point {k} {n}" for k, n in enumerate(mode.sensors, 1))]
        lines = ["    55", *[*(line[:80] for line in titles[:5]), *["NONE"] * 5][:5]]
        lines += [
            "".join(f"{k:10d}" for k in row) for row in ((1, 2, 2, 8, 2, 3), (2, 4, 1, number))
        ]
        lines.append("".join(f"{value:13.5E}" for value in figures))
        for point, value in enumerate(mode.shape.real, 1):
            row = [value if k == axis else 0.0 for k in range(3)]
            lines += [f"{point:10d}", "".join(f"{each:13.5E}" for each in row)]
        blocks.append(lines)
    parted = (line for block in blocks for line in ("    -1", *block, "    -1"))
    return write_text(path, "\n".join(parted) + "\n", MeasurementError)
