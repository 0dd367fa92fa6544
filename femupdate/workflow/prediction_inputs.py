"""What a prediction is made from: the ground motion, floors measured in it, and settings."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.dynamics.members import Place
from femupdate.errors import MeasurementError
from femupdate.measurement.histories import Histories
from femupdate.measurement.kinds import read_observation_file
from femupdate.measurement.record import GroundMotion, read_record
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import direction_of


@dataclass(frozen=True)
class RecordSource:
    """Which ground motion, and what of it.

    Attributes:
        path: the file.
        unit: where the file does not say.
        channel: name or number, where the file has several.
        scale: factor on the acceleration.
    """

    path: Path
    unit: str | None = None
    channel: str | int | None = None
    scale: float = 1.0

    def motion(self, columns: Mapping[str, str] | None = None) -> GroundMotion:
        """The motion of the base.

        Args:
            columns: our names of the base's channels to the file's.

        Raises:
            MeasurementError: the file cannot be used.
        """
        found = read_record(self.path, self.unit, self.channel, columns=columns)
        return found.scaled(self.scale)


@dataclass(frozen=True, kw_only=True)
class PredictionSettings:
    """How to predict.

    Attributes:
        samples: posterior draws used.
        damping: one ratio for all of them; None takes each draw's own where the posterior has it,
            else the building's.
        seed: which draws.
        spectrum_damping: damping ratio of the oscillators on the floors whose response spectra are
            asked for; None for no spectra.
        members: places in the building, m: the end forces of the beam elements nearest to them are
            found; and names of walls, such as "X2:S1": the forces through their feet are.
        member_draws: draws at which the full model is solved for these.
        scatter, damping_scatter: standard deviations of ln stiffness and of ln damping between
            events; None takes what several runs have taught, else the default.
    """

    samples: int = 300
    damping: float | None = None
    seed: int = 0
    spectrum_damping: float | None = None
    members: tuple[Place | str, ...] = ()
    member_draws: int = 24
    scatter: float | None = None
    damping_scatter: float | None = None


def measured_floors(
    model: StudyModel,
    path: Path,
    columns: Mapping[str, str] | None,
    record: RecordSource,
    motion: GroundMotion,
) -> Floats:
    """Measured floor accelerations (f, n), sensors averaged, NaN for floors without any.

    Raises:
        MeasurementError: the file cannot be used, or is not of the record's motion.
    """
    data = read_observation_file(path, record.unit, columns)
    if not isinstance(data, Histories):
        raise MeasurementError(f"{path}: a comparison needs histories (a column time_s)")
    count = motion.acceleration.size
    same = abs(data.time_step - motion.time_step) < 1e-6 * motion.time_step
    if not same or data.acceleration.shape[1] != count:
        raise MeasurementError(
            f"{path}: {data.acceleration.shape[1]} samples every {data.time_step:g} s do not match "
            f"the record's {count} every {motion.time_step:g} s; take both from one recording"
        )
    direction = direction_of(model.building)
    rows = np.full((len(model.reduced.floors), count), np.nan)
    for place, floor in enumerate(model.reduced.floors):
        if own := data.rows(floor, direction):
            rows[place] = data.acceleration[own].mean(axis=0) * record.scale
    if np.isnan(rows).all():
        raise MeasurementError(
            f"{path}: none of its floors ({', '.join(data.floors)}) belongs to the building "
            f"({', '.join(model.reduced.floors)})"
        )
    return rows
