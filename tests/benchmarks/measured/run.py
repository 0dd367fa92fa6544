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
from femupdate.dynamics import System
from femupdate.dynamics.spectra import floor_spectra
from femupdate.inference.event_scatter import EventScatter
from femupdate.inference.posterior import Posterior
from femupdate.measurement import Histories, read_observation_file, read_record
from femupdate.study import Study
from femupdate.workflow import (
    CalibrationSettings,
    ObservationSource,
    PredictionSettings,
    RecordSource,
    StudyModel,
    calibrate_study,
    open_study,
    open_system,
    predict_study,
)
from femupdate.workflow.observed import direction_of

from ..result import Job, Report, markdown_table
from .free_fit import FreeFit, fit_free
from .impulse_filter import ImpulseFilter, fit_filter

# Events whose base peaks differ by less than this factor are of like strength.
_LIKE = 2.0
# Of the model's band, where free modes begin.
_LOWEST = 0.02
# Of oscillators on the floors, as floor spectra for equipment have it.
_SPECTRUM_DAMPING = 0.05


@dataclass(frozen=True)
class MeasuredPlan:
    """What is calibrated and predicted."""

    building: str  # shipped name or file
    files: tuple[Path, ...]  # histories of the base and of floors, an event each
    base: str  # column of the base's motion
    columns: Mapping[str, str] | None  # our column names to the files'
    particles: int  # posterior draws
    samples: int  # histories of a prediction
    several: bool = False  # whether each event is predicted from all others together
    # Floor that no calibration sees, and that is predicted all the same
    leave_out: str | None = None


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
    rival: ImpulseFilter


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """One floor of one event, predicted from another."""

    # calibrated, predicted: events
    calibrated: str
    predicted: str
    floor: str  # that was measured
    unseen: bool  # whether the calibration was kept from this floor
    within: float  # share of the samples within two standard deviations
    peak_within: bool  # whether the peak lies in its 90 % interval
    peak_ratio: float  # measured peak over the median predicted one
    # Share of the frequencies at which the measured floor spectrum (5 % damping) lies in its 90 %
    # interval
    spectrum_within: float
    # score, filter_score: continuous ranked probability score over the rms, ours and of an impulse
    # response
    score: float
    filter_score: float
    # error, free, filter_error: rms of the best estimate's error over the rms measured: ours, of
    # free modes and of an impulse response
    error: float
    free: float
    filter_error: float


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
    name += f"_without_{plan.leave_out}" if plan.leave_out else ""
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
    events = [_histories(plan, each) for each in paths]
    direction = direction_of(model.building)
    floors = events[0].floors if plan.leave_out else ()
    seen = tuple(floor for floor in floors if floor != plan.leave_out)
    source = ObservationSource(path, columns=plan.columns, further=paths[1:], sensors=seen)
    settings = CalibrationSettings(particles=plan.particles, exact=True, chains=2, seed=seed)
    report = calibrate_study(study, model, source, settings)
    peak = read_record(path, None, _channel(plan)).peak
    top = float(model.frequency_hz[-1])
    band = max(float(model.frequency_hz[0]), _LOWEST * top), top
    free = fit_free(events, direction, band, len(events[0].floors))
    rival = fit_filter(events, direction)
    return Event(folder.name, path, peak, study, model, report.posterior, free, rival)


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
        PredictionSettings(samples=plan.samples, spectrum_damping=_SPECTRUM_DAMPING),
        measured=other.path,
        columns=plan.columns,
    )
    scores, spectra, seen = found.comparison, found.floor_spectra, found.measured
    assert scores is not None
    assert spectra is not None
    assert seen is not None
    measured, direction = _histories(plan, other.path), direction_of(event.model.building)
    free = dict(zip(measured.floors, event.free.error(measured, direction), strict=True))
    filters = dict(
        zip(
            measured.floors, zip(*event.rival.scores(measured, direction), strict=True), strict=True
        )
    )
    rows = [found.summary.floors.index(floor) for floor in scores]
    motion = found.motion
    true = floor_spectra(seen[None, rows], motion.acceleration, motion.time_step, spectra.damping)
    low, high = spectra.acceleration.q05[rows], spectra.acceleration.q95[rows]
    inside = ((low <= true.acceleration.mean) & (true.acceleration.mean <= high)).mean(axis=1)
    median = np.median(found.summary.peak_acceleration[:, rows], axis=0)
    peaks = np.abs(seen[rows]).max(axis=1) / median
    return [
        Prediction(
            calibrated=event.name,
            predicted=other.name,
            floor=floor,
            unseen=floor == plan.leave_out,
            within=scores[floor]["within_band"],
            peak_within=bool(scores[floor]["peak_within"]),
            peak_ratio=float(peaks[k]),
            spectrum_within=float(inside[k]),
            score=scores[floor]["score"],
            filter_score=float(filters[floor][1]),
            error=scores[floor]["relative_error"],
            free=float(free[floor]),
            filter_error=float(filters[floor][0]),
        )
        for k, floor in enumerate(scores)
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
    shares: dict[str, list[float]] = {
        "within_2_sd": [row.within for row in predictions],
        "peaks_within_90": [row.peak_within for row in predictions],
        "peaks_below_the_median": [row.peak_ratio < 1.0 for row in predictions],
        "spectra_within_90": [row.spectrum_within for row in predictions],
        "crps_over_rms": [row.score for row in predictions],
        "crps_over_rms_of_filter": [row.filter_score for row in predictions],
        "error_rms": [row.error for row in predictions],
        "error_rms_of_filter": [row.filter_error for row in predictions],
        "error_rms_of_free_modes": [row.free for row in predictions],
        "factors_of_others_within_90": [pair.factors for pair in pairs],
        "frequency_of_others_within_90": [pair.frequency for pair in pairs],
        "frequency_of_like_within_90": [pair.frequency for pair in like or pairs],
    }
    return {name: float(np.mean(values)) for name, values in shares.items()}


def _text(predictions: list[Prediction], pairs: list[Pair]) -> str:
    head = (
        *("floor", "within 2 sd", "least", "peaks in 90 %", "peaks below the median"),
        *("spectra in 90 %", "CRPS / rms", "of the filter"),
        *("error rms", "of the filter", "of free modes", "best"),
    )
    rows = []
    for floor, unseen in dict.fromkeys((row.floor, row.unseen) for row in predictions):
        some = [row for row in predictions if row.floor == floor]

        def mean(name: str, some: list[Prediction] = some) -> float:
            return float(np.mean([getattr(row, name) for row in some]))

        errors = {
            "ours": mean("error"),
            "the filter": mean("filter_error"),
            "free modes": mean("free"),
        }
        rows.append(
            (
                f"{floor}, which no calibration saw" if unseen else floor,
                f"{mean('within'):.1%}",
                f"{min(row.within for row in some):.1%}",
                f"{mean('peak_within'):.0%}",
                f"{np.mean([row.peak_ratio < 1.0 for row in some]):.0%}",
                f"{mean('spectrum_within'):.0%}",
                f"{mean('score'):.3f}",
                f"{mean('filter_score'):.3f}",
                *(f"{value:.3f}" for value in errors.values()),
                min(errors, key=lambda name: errors[name]),
            )
        )
    answer = _answer(predictions, pairs)
    others = "all others" if pairs[0].calibrated.startswith("all_but") else "another"
    return (
        f"{len(pairs)} predictions of one event from {others}. The filter is an impulse response "
        f"fitted to the same events.\n\n{markdown_table(head, rows)}\n\n"
        f"Estimates of another event within the 90 % interval of the next: factors "
        f"{answer['factors_of_others_within_90']:.0%}, first frequency "
        f"{answer['frequency_of_others_within_90']:.0%} "
        f"({answer['frequency_of_like_within_90']:.0%} among events of like strength)."
    )
