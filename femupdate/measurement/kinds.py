"""What a file tells of a building: histories, response functions or identified modes."""

from collections.abc import Mapping
from pathlib import Path

from femupdate.measurement.frf_table import frfs_in_table, table_of_functions
from femupdate.measurement.histories import Histories, histories_of
from femupdate.measurement.modes import IdentifiedModes, identified_modes
from femupdate.measurement.observation import Observation
from femupdate.measurement.reader import read_measured
from femupdate.measurement.recording import Recording
from femupdate.measurement.resolve import layout_of, placed_channels
from femupdate.measurement.thresholds import SPECTRUM

AnyKind = Histories | tuple[Observation, ...] | IdentifiedModes


def read_observation_file(
    path: str | Path, unit: str | None = None, columns: Mapping[str, str] | None = None
) -> Histories | Observation:
    """Read measured histories or response functions of floors under base motion.

    Args:
        path: a table with the column time_s (histories) or frequency_hz (FRFs), or any other
            format that is known, whose channels `columns` gives to floors.
        unit: of the accelerations, where the file does not give it.
        columns: our column name to the file's column or channel, such as `{"2F": "a_1F"}`; a
            channel also by its number. Once it is given, the file's other columns count only
            where they bear one of our names.

    Raises:
        MeasurementError: the file, a column or a cell cannot be used, or the file is of another
            kind; the message names it.
    """
    return base_motion_in(read_measured(path), unit, columns)


def base_motion_in(
    recording: Recording,
    unit: str | None = None,
    columns: Mapping[str, str] | None = None,
    noise: float = SPECTRUM.default_noise,
) -> Histories | Observation:
    """What `read_observation_file` reads, in a file that was opened."""
    found = kind_in(recording, unit, columns, noise=noise)
    what = "identified modes"
    if not isinstance(found, IdentifiedModes):
        first = found if isinstance(found, Histories) else found[0]
        if not first.excitation.force:
            return first
        what = "responses to a force"
    raise recording.file.error(
        f"these are {what}, which calibrate, diagnose and repair explain; give histories or FRFs"
        " here"
    )


def kind_in(
    recording: Recording,
    unit: str | None = None,
    columns: Mapping[str, str] | None = None,
    direction: str = "x",
    force: str | None = None,
    noise: float = SPECTRUM.default_noise,
) -> AnyKind:
    """What a file holds; of FRFs an observation for each excitation, at the file's frequencies.

    Args:
        unit: of accelerations, or of responses to a force, where the file does not give it.
        direction: of the motion; of identified modes other components are left out.
        force: floor at which the force acts, where the columns' names do not say it.
        noise: standard deviation of ln|H| where a table of FRFs gives none.

    Raises:
        MeasurementError: the file, a column or a cell cannot be used; the message names it.
    """
    if recording.modes or recording.mode_table is not None:
        return identified_modes(recording, columns, direction)
    file, table = recording.file, recording.table
    if table is None and recording.functions and not recording.channels:
        table, columns = table_of_functions(recording, columns or {}), None
    if table is None:
        return histories_of(file, placed_channels(recording, columns, unit), unit)
    layout = layout_of(table, columns)
    if layout.of_histories:
        return histories_of(file, layout.channels(), unit)
    return frfs_in_table(layout, force, unit, noise)
