"""Every measured event of one structure from every other: bands, peaks, scores and pairs.

A band is honest when it holds as much of what is measured as it says: 95 % of the samples within
two standard deviations, nine of ten largest responses within their 90 % intervals, and the
estimates from one event within the 90 % intervals that another gives for the next.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

from femupdate.arrays import Floats
from femupdate.dynamics.system import System
from femupdate.inference.event_scatter import EventScatter
from femupdate.inference.posterior import Posterior
from femupdate.measurement.histories import Histories
from femupdate.measurement.kinds import read_observation_file
from femupdate.measurement.record import read_record
from femupdate.study import Study
from femupdate.workflow.calibrate import calibrate_study
from femupdate.workflow.calibrate_settings import CalibrationSettings
from femupdate.workflow.mesh_error import open_system
from femupdate.workflow.model import StudyModel, open_study
from femupdate.workflow.observed import ObservationSource, direction_of
from femupdate.workflow.predict import predict_study
from femupdate.workflow.prediction_inputs import PredictionSettings, RecordSource

from ..result import Job, Report, markdown_table
from .free_fit import FreeFit, fit_free

# Events whose base peaks differ by less than this factor are of like strength.
_LIKE = 2.0
# Of the model's band, where free modes begin.
_LOWEST = 0.02
_FREE = "of free modes"


@dataclass(frozen=True)
class MeasuredPlan:
    """What is calibrated and predicted.

    Attributes:
        building: shipped name or file.
        files: histories of the base and of floors, an event each.
        base: column of the base's motion.
        columns: our column names to the files'.
        particles: posterior draws.
        samples: histories of a prediction.
        several: whether each event is predicted from all others together.
    """

    building: str
    files: tuple[Path, ...]
    base: str
    columns: Mapping[str, str] | None
    particles: int
    samples: int
    several: bool = False


@dataclass(frozen=True)
class Event:
    """One event and the posterior that it gives."""

    name: str
    path: Path
    peak: float
    study: Study
    model: StudyModel
    posterior: Posterior
    free: FreeFit


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """One floor of one event, predicted from another."""

    calibrated: str
    predicted: str
    floor: str
    within: float
    peak_within: bool
    score: float
    error: float
    free: float


@dataclass(frozen=True, kw_only=True)
class Pair:
    """Whether 90 % intervals for the next event hold the estimates from another."""

    calibrated: str
    other: str
    like: bool
    factors: float
    frequency: bool


def run_measured(job: Job, plan: MeasuredPlan) -> Report:
    """Calibrate to every file, and predict every other one."""
    with TemporaryDirectory() as folder:
        job.progress.start("Calibrating", len(plan.files))
        events = []
        for path in plan.files:
            events.append(_calibrated(plan, (path,), Path(folder) / path.stem, job.seed))
            job.progress.advance()
        couples = list(permutations(events, 2))
        if plan.several:
            job.progress.start("Calibrating to all others together", len(events))
            couples = [(_others(plan, one, Path(folder), job), one) for one in events]
        job.progress.start("Predicting", len(couples))
        predictions: list[Prediction] = []
        pairs: list[Pair] = []
        for one, other in couples:
            predictions += _predicted(plan, one, other)
            pairs.append(pair_of(one, other, job.seed))
            job.progress.advance()
    name = f"measured_{events[0].model.building.name}{'_from_several' if plan.several else ''}"
    # Results are kept with the project: names of files, not where they lie.
    names = {"building": Path(plan.building).name, "files": [path.name for path in plan.files]}
    content = {**names, "predictions": predictions, "pairs": pairs}
    return job.write(name, content, _text(predictions, pairs), answer=_answer(predictions, pairs))


def _others(plan: MeasuredPlan, event: Event, folder: Path, job: Job) -> Event:
    """All events but one, together."""
    paths = tuple(path for path in plan.files if path != event.path)
    found = _calibrated(plan, paths, folder / f"all_but_{event.name}", job.seed)
    job.progress.advance()
    return found


def _calibrated(plan: MeasuredPlan, paths: tuple[Path, ...], folder: Path, seed: int) -> Event:
    study = Study(folder)
    model = open_study(study, plan.building)
    path = paths[0]
    source = ObservationSource(path, columns=plan.columns, further=paths[1:])
    settings = CalibrationSettings(particles=plan.particles, exact=True, chains=2, seed=seed)
    report = calibrate_study(study, model, source, settings)
    peak = read_record(path, None, _channel(plan)).peak
    free = free_of(plan, paths, model)
    return Event(folder.name, path, peak, study, model, report.posterior, free)


def free_of(plan: MeasuredPlan, paths: tuple[Path, ...], model: StudyModel) -> FreeFit:
    """As many free modes as there are floors, in the band of the model."""
    events = [_histories(plan, path) for path in paths]
    top = float(model.frequency_hz[-1])
    band = max(float(model.frequency_hz[0]), _LOWEST * top), top
    return fit_free(events, direction_of(model.building), band, len(events[0].floors))


def _histories(plan: MeasuredPlan, path: Path) -> Histories:
    read = read_observation_file(path, None, plan.columns)
    assert isinstance(read, Histories)
    return read


def _channel(plan: MeasuredPlan) -> str:
    return (plan.columns or {}).get(plan.base, plan.base)


def _predicted(plan: MeasuredPlan, event: Event, other: Event) -> list[Prediction]:
    found = predict_study(
        event.study,
        event.model,
        RecordSource(other.path, channel=_channel(plan)),
        PredictionSettings(samples=plan.samples),
        measured=other.path,
        columns=plan.columns,
    ).comparison
    assert found is not None
    measured = _histories(plan, other.path)
    free = dict(
        zip(
            measured.floors,
            event.free.error(measured, direction_of(event.model.building)),
            strict=True,
        )
    )
    return [
        Prediction(
            calibrated=event.name,
            predicted=other.name,
            floor=floor,
            within=float(found.within_band[k]),
            peak_within=bool(found.peak_within[k]),
            score=float(found.score[k]),
            error=float(found.relative_error[k]),
            free=float(free[floor]),
        )
        for k, floor in enumerate(found.floors)
    ]


def pair_of(event: Event, other: Event, seed: int) -> Pair:
    """Whether intervals from one event hold the estimates from another; effects stay as found."""
    own = event.posterior
    system, theta, sizes = _draws(event)
    scatter = EventScatter() if own.scatter is None else own.scatter.of(own.rows(len(theta), 0))
    prior = own.parameters.of("stiffness")
    zeta = torch.full_like(theta[:, 0], 0.05)
    moved, _ = scatter.next_event(theta, zeta, (prior.lower, prior.upper), seed)
    least, most = np.quantile(moved.numpy(), [0.05, 0.95], axis=0)
    others, found, apart = _draws(other)
    mean = found.mean(dim=0).numpy()
    frequency = np.quantile(_fundamental(system, moved, sizes), [0.05, 0.95])
    estimate = _fundamental(others, found, apart).mean()
    return Pair(
        calibrated=event.name,
        other=other.name,
        like=max(event.peak, other.peak) < _LIKE * min(event.peak, other.peak),
        factors=float(((least <= mean) & (mean <= most)).mean()),
        frequency=bool(frequency[0] <= estimate <= frequency[1]),
    )


def _draws(event: Event, count: int = 400) -> tuple[System, torch.Tensor, torch.Tensor]:
    """The building with its effects, and draws of factors and of the sizes of effects."""
    system = open_system(event.study, event.model)
    known = event.posterior.parameters.split(event.posterior.thinned(count, 0))
    return system, known.theta, known.sizes


def _fundamental(system: System, theta: torch.Tensor, sizes: torch.Tensor) -> Floats:
    omega = system.modes(theta, sizes).omega
    return np.asarray(omega.min(dim=1).values.numpy() / (2.0 * np.pi))


def _answer(predictions: list[Prediction], pairs: list[Pair]) -> dict[str, float]:
    like = [pair for pair in pairs if pair.like]
    return {
        "within_2_sd": float(np.mean([one.within for one in predictions])),
        "peaks_within_90": float(np.mean([one.peak_within for one in predictions])),
        "crps_over_rms": float(np.mean([one.score for one in predictions])),
        "error_rms": float(np.mean([one.error for one in predictions])),
        "error_rms_of_free_modes": float(np.mean([one.free for one in predictions])),
        "factors_of_others_within_90": float(np.mean([one.factors for one in pairs])),
        "frequency_of_others_within_90": float(np.mean([one.frequency for one in pairs])),
        "frequency_of_like_within_90": float(np.mean([one.frequency for one in like or pairs])),
    }


def _text(predictions: list[Prediction], pairs: list[Pair]) -> str:
    head = ("floor", "within 2 sd", "least", "peaks in 90 %", "CRPS / rms", "error rms", _FREE)
    rows = []
    for floor in dict.fromkeys(one.floor for one in predictions):
        some = [one for one in predictions if one.floor == floor]
        within = [one.within for one in some]
        rows.append(
            (
                floor,
                f"{np.mean(within):.1%}",
                f"{np.min(within):.1%}",
                f"{np.mean([one.peak_within for one in some]):.0%}",
                f"{np.mean([one.score for one in some]):.3f}",
                f"{np.mean([one.error for one in some]):.3f}",
                f"{np.mean([one.free for one in some]):.3f}",
            )
        )
    answer = _answer(predictions, pairs)
    others = "all others" if pairs[0].calibrated.startswith("all_but") else "another"
    return (
        f"{len(pairs)} predictions of one event from {others}.\n\n{markdown_table(head, rows)}\n\n"
        f"Estimates of another event within the 90 % interval of the next: factors "
        f"{answer['factors_of_others_within_90']:.0%}, first frequency "
        f"{answer['frequency_of_others_within_90']:.0%} "
        f"({answer['frequency_of_like_within_90']:.0%} among events of like strength)."
    )
