"""What a file tells of a building: histories, response functions or identified modes."""

from collections.abc import Mapping
from pathlib import Path

from femupdate.measurement.frf_table import FrfTable
from femupdate.measurement.modes import IdentifiedModes, identified_modes
from femupdate.measurement.observation_file import Histories, observation_in
from femupdate.measurement.registry import read_measured


def read_any_kind(
    path: str | Path,
    unit: str | None = None,
    columns: Mapping[str, str] | None = None,
    direction: str = "x",
) -> Histories | FrfTable | IdentifiedModes:
    """Read a measured file of any kind.

    Args:
        path: the file.
        unit: of accelerations, where the file does not give it.
        columns: our column name to the file's.
        direction: of the motion; of identified modes other components are left out.

    Raises:
        MeasurementError: the file, a column or a cell cannot be used; the message names it.
    """
    recording = read_measured(path)
    if recording.modes or recording.mode_table is not None:
        return identified_modes(recording, columns, direction)
    return observation_in(recording, unit, columns)
