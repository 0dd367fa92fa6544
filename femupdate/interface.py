"""The Python interface: what the commands do, as functions of a building and its observations.

    import femupdate

    building = femupdate.Building.load("shear_3dof")
    observation = femupdate.Observation.read("run.csv")
    print(*femupdate.calibrate(building, observation).lines(), sep="\\n")

Every result has its figures as attributes, `as_dict()` for programs and `lines()` for people.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from femupdate.progress import SILENT, Progress
from femupdate.study import MAIN_POSTERIOR, Study
from femupdate.workflow.calibrate import calibrate_study
from femupdate.workflow.calibrate_settings import CalibrationSettings
from femupdate.workflow.calibration_report import CalibrationReport
from femupdate.workflow.checks import check_calibration, readable
from femupdate.workflow.compare import CompareReport, compare_states, find_state
from femupdate.workflow.diagnose import DiagnosisReport, diagnose_study
from femupdate.workflow.model import StudyModel, choose_building, open_study
from femupdate.workflow.observed import ObservationSource
from femupdate.workflow.predict import PredictionReport, predict_study
from femupdate.workflow.prediction_inputs import PredictionSettings, RecordSource


@dataclass(frozen=True, eq=False)
class Building:
    """A building and the study in which everything made for it is kept.

    Attributes:
        study: its folder; made when something is first written.
    """

    study: Study
    _name: str | None = None

    @classmethod
    def load(cls, name: str | Path | None = None, study: Path | str = "study") -> "Building":
        """A building by its file or its shipped name; without either, that of the study.

        Raises:
            BuildingError: no such building, or its file is wrong.
            StudyError: the study holds another building.
        """
        building = cls(Study(study), None if name is None else str(name))
        choose_building(building.study, building._name)
        return building

    @cached_property
    def model(self) -> StudyModel:
        """Its reduced model, built when it is first asked for."""
        return open_study(self.study, self._name)

    @property
    def floors(self) -> tuple[str, ...]:
        """Names, bottom to top."""
        return self.model.building.floors


@dataclass(frozen=True)
class Observation:
    """Measured files that can be read.

    Attributes:
        source: the files and how they are read.
    """

    source: ObservationSource

    @classmethod
    def read(cls, path: Path | str, *further: Path | str, **reading: Any) -> "Observation":
        """Files of one building, of any kind that `calibrate` takes.

        Args:
            path: of the first file.
            further: files of other runs.
            reading: `sensors`, `band_hz`, `unit`, `columns`, `force`, `mode_error`, as
                `ObservationSource` has them.

        Raises:
            MeasurementError: a file cannot be used.
        """
        others = tuple(Path(one) for one in further)
        return cls(readable(reading, Path(path), *others))


def calibrate(
    building: Building,
    observation: Observation,
    *,
    name: str = MAIN_POSTERIOR,
    progress: Progress = SILENT,
    **settings: Any,
) -> CalibrationReport:
    """Draw the posterior of the stiffness factors.

    Args:
        name: of the posterior in the study.
        settings: `exact`, `particles`, `chains`, `seed`, as `CalibrationSettings` has them.

    Raises:
        MeasurementError, SurrogateError, InferenceError, StudyError: as of `calibrate_study`.
    """
    study, chosen = Study(building.study.folder, name), CalibrationSettings(**settings)
    check_calibration(study, observation.source, chosen, building._name)
    return calibrate_study(study, building.model, observation.source, chosen, progress)


def predict(
    building: Building,
    record: Path | str | RecordSource,
    *,
    posterior: str = MAIN_POSTERIOR,
    measured: Path | str | None = None,
    columns: Mapping[str, str] | None = None,
    progress: Progress = SILENT,
    **settings: Any,
) -> PredictionReport:
    """Predict the response to a ground motion.

    Args:
        building: with a posterior.
        record: file of the motion; a `RecordSource` says channel, unit and scale as well.
        posterior: its name.
        measured: file with the floors measured in the same motion, to compare.
        columns: its column names, ours to the file's.
        settings: `samples`, `damping`, `seed`, ..., as `PredictionSettings` has them.

    Raises:
        MeasurementError, StudyError: as of `predict_study`.
    """
    source = record if isinstance(record, RecordSource) else RecordSource(Path(record))
    return predict_study(
        Study(building.study.folder, posterior),
        building.model,
        source,
        PredictionSettings(**settings),
        measured=None if measured is None else Path(measured),
        columns=columns,
        progress=progress,
    )


def diagnose(
    building: Building, observation: Observation, *, progress: Progress = SILENT
) -> DiagnosisReport:
    """Find where model and measurement disagree, and what is missing in the model.

    Raises:
        MeasurementError, BuildingError: as of `diagnose_study`.
    """
    return diagnose_study(building.study, building.model, observation.source, progress=progress)


def compare(building: Building, before: str, after: str) -> CompareReport:
    """Which stories changed between two posteriors of the study, by their names.

    Raises:
        StudyError: there is no such posterior.
        InferenceError: they come from the same measurement.
    """
    return compare_states(*(find_state(name, building.study) for name in (before, after)))


__all__ = [
    "Building",
    "Observation",
    "RecordSource",
    "calibrate",
    "compare",
    "diagnose",
    "predict",
]
