"""train: the data set and the MVAE of a study's building."""

import textwrap
import time
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from femupdate import __version__
from femupdate.errors import SurrogateError
from femupdate.progress import SILENT, Progress
from femupdate.result import Item, Note, Told, first_lines
from femupdate.seeds import DATA_SET, stream
from femupdate.study import BUILDING_FILE, Study, typed
from femupdate.surrogate.network import NetworkSizes
from femupdate.surrogate.storage import (
    TRAINED,
    Surrogate,
    SurrogateInfo,
    find_surrogate,
)
from femupdate.surrogate.training import (
    ModalDataset,
    TrainingSettings,
    TrainingTask,
    check_samples,
    compute_dataset,
    modes_kept,
    train_mvae,
)
from femupdate.workflow.effects import with_finer_mesh
from femupdate.workflow.likelihoods import unserved
from femupdate.workflow.model import StudyModel, choose_building

_MODES_KEPT = 28


class Trained(Told):
    """What `train` tells, with the surrogate itself and the path of its file."""

    def __init__(self, surrogate: Surrogate, path: Path, items: Iterable[Item]) -> None:
        super().__init__(items)
        self.surrogate, self.path = surrogate, path


def _told(
    surrogate: Surrogate, path: Path, folder: Path, seconds: tuple[float, float] | None = None
) -> Trained:
    """What was trained into a study, with the seconds of data set and training; else found."""
    trained, metrics = seconds is not None, surrogate.info.metrics
    dataset, training = seconds or (0.0, 0.0)
    content = {"surrogate": path, "trained": trained, "metrics": metrics}
    content |= {"dataset_seconds": dataset, "training_seconds": training}
    there = f"{path} fits this building; --fresh trains again"
    took = f"data set {dataset:.0f} s, training {training:.0f} s"
    first = first_lines(
        f"Verdict: {'trained' if trained else 'trained already'}.",
        f"Surrogate: {took if trained else there}.",
        f"`{typed('calibrate FILE', folder / BUILDING_FILE)}`",
    )
    more = []
    if trained:
        epochs = f"best epoch {metrics['best_epoch']:.0f} of {metrics['epochs']:.0f}"
        loss = f"validation loss {metrics['validation_loss']:.1f}"
        more = [Note(f"  {epochs}, {loss}\n  {path}", detail=True)]
    return Trained(surrogate, path, (Note(content=content), *first, *more))


def check_training(study: Study, samples: int, batch: int, building: str | None = None) -> None:
    """Tell what can be told of a training before anything is built or written.

    Args:
        building: name or path, for a new study.

    Raises:
        SurrogateError: too few samples, or the building is one that no surrogate serves.
        BuildingError: the building cannot be read.
        StudyError: the study has no building and none is named, is of another one, or cannot be
            written.
    """
    study.check_writable()
    check_samples(samples, TrainingSettings(batch=batch))
    chosen = choose_building(study, building)
    if why := unserved(chosen):
        raise SurrogateError(
            f"{chosen.name} {why}, which no surrogate serves; it needs none: `femupdate calibrate` "
            "samples the likelihood of the data themselves"
        )


def train_study(
    study: Study,
    model: StudyModel,
    samples: int,
    settings: TrainingSettings | None = None,
    *,
    fresh: bool = False,
    progress: Progress = SILENT,
    device: str = "cpu",
) -> Trained:
    """Make the data set and train; skipped when a fitting surrogate is there.

    Raises:
        SurrogateError: too few samples.
    """
    found = None if fresh else find_surrogate(study, model.building)
    if found is not None:
        return _told(*found, study.folder)
    settings = settings or default_settings(model)
    check_samples(samples, settings)
    model = with_finer_mesh(study, model, progress)
    started = time.monotonic()
    dataset = compute_dataset(
        model.system,
        model.prior,
        samples=samples,
        modes=_MODES_KEPT,
        top_hz=float(model.frequency_hz[-1]),
        seed=stream(settings.seed, DATA_SET),
        progress=progress,
    )
    between = time.monotonic()
    result = train_mvae(training_task(model, dataset, device), settings, progress)
    how = {
        "samples": samples,
        "modes": _MODES_KEPT,
        "training": asdict(settings),
    }
    info = SurrogateInfo(
        model.building.name,
        model.hash,
        model.reduced.floors,
        settings.noise_sd,
        __version__,
        how,
        result.metrics,
    )
    surrogate = Surrogate(result.average, info)
    study.keep(TRAINED, model.made_from(), surrogate)
    seconds = between - started, time.monotonic() - between
    return _told(surrogate, study.path(TRAINED.file), study.folder, seconds)


def default_settings(model: StudyModel, **changes: Any) -> TrainingSettings:
    """Settings for a building: its own noise, everything else as shipped but for the changes."""
    return TrainingSettings(noise_sd=model.building.observation.noise_sd, **changes)


def training_task(model: StudyModel, dataset: ModalDataset, device: str = "cpu") -> TrainingTask:
    """What a building's MVAE learns from a data set; of many floors each contributes less."""
    floors = len(model.reduced.floors)
    sizes = NetworkSizes(
        floors=floors,
        points=len(model.frequency_hz),
        parameters=model.prior.size,
        free_damping=model.damping.free,
        modes=modes_kept(model.system, _MODES_KEPT),
        floor_features=max(24, 384 // floors),
    )
    return TrainingTask(
        dataset,
        model.frequency_hz.float(),
        model.system,
        (model.damping.lower, model.damping.upper),
        model.prior,
        sizes,
        device,
    )


def check_device(name: str) -> None:
    """Make sure that torch can compute in double precision on a device.

    Raises:
        SurrogateError: it cannot.
    """
    import torch

    try:
        torch.zeros(1, dtype=torch.float64, device=name).sum().item()
    # Builds of torch without a device say so by errors of several kinds.
    except (RuntimeError, AssertionError, TypeError, ValueError, NotImplementedError) as error:
        reason = textwrap.shorten(str(error), 60, placeholder=" ...")
        raise SurrogateError(
            f"the device {name} cannot be used ({reason}); choose another, such as cpu"
        ) from error
