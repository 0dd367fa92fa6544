"""What would stop a step half-way, found before anything is built or written."""

import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from femupdate.building.files import mechanics_hash
from femupdate.errors import InferenceError, StudyError, SurrogateError
from femupdate.inference.encoder_input import encoder_input
from femupdate.progress import SILENT, Progress
from femupdate.study import BUILDING_FILE, Study
from femupdate.surrogate.storage import load_surrogate
from femupdate.surrogate.training import TrainingSettings
from femupdate.workflow.calibrate_settings import CalibrationSettings
from femupdate.workflow.calibration_report import POSTERIOR
from femupdate.workflow.kinds import measured_of
from femupdate.workflow.model import StudyModel, choose_building, open_study
from femupdate.workflow.observed import ObservationSource, check_readable
from femupdate.workflow.surrogates import require_surrogate, unserved
from femupdate.workflow.train import check_samples


def check_calibration(
    study: Study,
    source: ObservationSource,
    settings: CalibrationSettings,
    building: str | None = None,
) -> None:
    """Read and compare all that a calibration needs, and write nothing.

    Args:
        building: name or path, for a new study.

    Raises:
        MeasurementError: the observation cannot be used, or belongs to another building.
        BuildingError: the building cannot be read.
        SurrogateError: no surrogate fits the building, and one is needed.
        InferenceError: the device is not there.
        StudyError: the study is of another building, or cannot be written.
    """
    study.check_writable()
    check_device(settings.device)
    check_readable(source)
    chosen = choose_building(study, building)
    measured = measured_of(chosen, source)
    if not (settings.exact or measured.beyond_surrogates or unserved(chosen)):
        known = study.path(BUILDING_FILE).exists()
        surrogate = require_surrogate(study, chosen, None if known else building)
        encoder_input(measured.base, surrogate.info.floors)


def readable(reading: Mapping[str, Any], path: Path, *further: Path) -> ObservationSource:
    """Observation files as a source, read once; a bad one is told before anything is built.

    Args:
        reading: fields of `ObservationSource` that say how to read the files.

    Raises:
        MeasurementError: a file cannot be used.
    """
    source = ObservationSource(path, further=further, **reading).opened()
    check_readable(source)
    return source


def check_training(
    study: Study, samples: int, batch: int, start: Path | None = None, building: str | None = None
) -> None:
    """Tell what can be told of a training before anything is built or written.

    Args:
        building: name or path, for a new study.

    Raises:
        SurrogateError: too few samples, no weights to start from, or the building is one that no
            surrogate serves.
        BuildingError: the building cannot be read.
        StudyError: the study has no building and none is named, is of another one, or cannot be
            written.
    """
    study.check_writable()
    if building is None and not study.path(BUILDING_FILE).exists():
        # The default building has a shipped surrogate: to train one is never what was meant.
        raise StudyError(
            f"the study {study.folder} has no building yet; name one with --building, or run "
            "`femupdate build-model NAME` first"
        )
    check_samples(samples, TrainingSettings(batch=batch))
    chosen = choose_building(study, building)
    if why := unserved(chosen):
        raise SurrogateError(
            f"{chosen.name} {why}, which no surrogate serves; it needs none: `femupdate calibrate` "
            "samples the likelihood of the data themselves"
        )
    if start is not None:
        load_surrogate(start)


def check_device(name: str) -> None:
    """Make sure that torch can compute in double precision on a device.

    Raises:
        InferenceError: it cannot.
    """
    import torch

    try:
        torch.zeros(1, dtype=torch.float64, device=name).sum().item()
    # Builds of torch without a device say so by errors of several kinds.
    except (RuntimeError, AssertionError, TypeError, ValueError, NotImplementedError) as error:
        reason = textwrap.shorten(str(error), 60, placeholder=" ...")
        raise InferenceError(
            f"the device {name} cannot be used ({reason}); choose another, such as cpu"
        ) from error


def open_calibrated(study: Study, progress: Progress = SILENT) -> StudyModel:
    """Return the model of a study that has a posterior of just this model.

    Raises:
        StudyError: there is no posterior, or it is damaged or of another building.
    """
    study.require(POSTERIOR, "calibrate")
    building = choose_building(study, None)
    study.check_fresh(POSTERIOR, {"building": mechanics_hash(building)}, "calibrate")
    return open_study(study, None, progress)
