"""predict: what the calibrated building does in another earthquake."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from femupdate.arrays import Floats, Integers
from femupdate.building.kinds import require_heights
from femupdate.dynamics.history import history_batches
from femupdate.dynamics.members import (
    ChosenMembers,
    MemberForces,
    Place,
    choose_members,
    member_forces,
    write_member_forces,
)
from femupdate.dynamics.spectra import floor_spectra
from femupdate.dynamics.summary import HistorySummary, summarise
from femupdate.dynamics.system import System
from femupdate.errors import BuildingError, MeasurementError
from femupdate.inference.event_scatter import DEFAULT, EventScatter
from femupdate.inference.next_event import EventErrors
from femupdate.inference.parameters import Values
from femupdate.inference.posterior import Posterior
from femupdate.measurement.observation import Histories
from femupdate.measurement.reader import read_observation_file
from femupdate.measurement.record import GroundMotion, read_record, without_offset
from femupdate.progress import SILENT, Progress
from femupdate.report.prediction import Prediction, read_prediction, save_prediction
from femupdate.report.quantities import ALONE, PEAKS, quantities
from femupdate.report.scale import plus_minus
from femupdate.seeds import spawn
from femupdate.study import Study, file_hash
from femupdate.units import percent
from femupdate.workflow.amplitude import (
    at_own_level,
    changes_with_level,
    far_stronger,
)
from femupdate.workflow.calibration_report import kept_posterior
from femupdate.workflow.effects import open_system
from femupdate.workflow.model import StudyModel, on_kept_finer
from femupdate.workflow.observed import direction_of


@dataclass(frozen=True)
class RecordSource:
    """Which ground motion, and what of it.

    Attributes:
        unit: where the file does not say.
        channel: name or number, where the file has several.
        scale: factor on the acceleration.
    """

    path: Path
    unit: str | None = None
    channel: str | int | None = None
    scale: float = 1.0

    def motion(self, columns: Mapping[str, str] | None = None, direction: str = "") -> GroundMotion:
        """The motion of the base, without an offset; see `read_record`."""
        found = read_record(self.path, self.unit, self.channel, columns, direction)
        moving = replace(found, acceleration=without_offset(found.acceleration))
        return moving.scaled(self.scale)


@dataclass(frozen=True, kw_only=True)
class PredictionSettings:
    """How to predict.

    Attributes:
        damping: one ratio for all of them; None takes each draw's own where the posterior has it,
            else the building's.
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


def kept_prediction(study: Study, model: StudyModel) -> Prediction:
    """What a study keeps of a prediction."""
    path = study.require("prediction", "predict --record FILE")
    return read_prediction(path, model.building, float(model.reduced.story_mass[0]))


def predict_study(
    study: Study,
    model: StudyModel,
    record: RecordSource,
    settings: PredictionSettings | None = None,
    *,
    measured: Path | None = None,
    columns: Mapping[str, str] | None = None,
    progress: Progress = SILENT,
) -> Prediction:
    """Predict floor histories and story shears for a ground motion.

    Args:
        measured: observation file with the floors measured in the same motion, to compare.
        columns: its column names, ours to the file's.

    Raises:
        BuildingError: a ratio is asked for, but the building's law gives every mode its own.
        MeasurementError: record or measurement cannot be used, or the record is too coarse.
        StudyError: there is no posterior, or it is of another building.
    """
    settings, started = settings or PredictionSettings(), time.monotonic()
    model = on_kept_finer(study, model)
    mapped = columns if measured in (None, record.path) else None
    motion = record.motion(mapped, direction_of(model.building))
    if not model.system.crosses:
        motion = replace(motion, across=None)
    if motion.rotation is not None:
        require_heights(model.building)
    chosen = choose_members(model.building, settings.members) if settings.members else None
    known = columns, record, motion
    reference = None if measured is None else _measured_floors(model, measured, *known)
    study.check_fresh("posterior", model.made_from(), "calibrate")
    posterior = kept_posterior(study, model.building)
    system = open_system(study, model)
    rows = posterior.rows(settings.samples, settings.seed)
    values, damping = _damped(model, posterior, settings)
    lowest = system.first_hz(values.theta[:1], values.sizes[:1])
    motion.require_frequency(lowest)
    progress.start("Integrating the response", len(rows))
    # Of the parameters alone, as they were when they were measured.
    alone, at_level = _summary(system, posterior, motion, values, settings, None, progress)
    moving, erring = spawn(settings.seed, 2)
    # Errors of the model fade below the lowest frequency.
    errors = EventErrors(posterior, rows, 0.25 * lowest, erring)
    scatter = _chosen_scatter(posterior, settings, rows)
    if settings.damping is not None or model.building.damping.is_rayleigh:
        scatter = replace(scatter, damping=0.0, damped=0.0)
    box = posterior.parameters.of("stiffness")
    theta, zeta = scatter.next_event(values.theta, values.zeta, (box.lower, box.upper), moving)
    progress.start("Integrating the response of another event", len(rows))
    moved = replace(values, theta=theta, zeta=zeta)
    summary = _summary(system, posterior, motion, moved, settings, errors, progress)[0]
    # A stiffness is the building's own: errors of shear and drift are none of it.
    summary = replace(summary, story_stiffness=alone.story_stiffness)
    best = errors.corrected(alone.floors, alone.acceleration_mean, motion.time_step)
    spectra, ratio = None, settings.spectrum_damping
    if ratio is not None:
        floors = summary.examples.floor_acceleration
        spectra = floor_spectra(floors, motion.acceleration, motion.time_step, ratio)
    peaks, mass = [getattr(summary, name) for name in PEAKS], float(model.reduced.story_mass[0])
    report = Prediction(
        summary=summary,
        alone=alone,
        best=best,
        path=study.result("prediction.nc"),
        damping=damping,
        # The decisive come first.
        notes=(*posterior.warnings, *at_level, *_notes(model, posterior, motion, settings)),
        warnings=(*posterior.warnings, *at_level),
        seconds=time.monotonic() - started,
        quantities=quantities(model.building, summary.floors, peaks, mass),
        motion=motion,
        measured=reference,
        floor_spectra=spectra,
        members=_members(study, model, values, motion, (chosen, settings.member_draws), progress),
    )
    save_prediction(report)
    _record(study, model, record, report, measured)
    return report


def _record(
    study: Study, model: StudyModel, record: RecordSource, report: Prediction, measured: Path | None
) -> None:
    """Note in the study what the prediction was made from, and how well it met measured floors."""
    origin = {
        **model.made_from(),
        "posterior": file_hash(study.require("posterior", "calibrate")),
        "record": file_hash(record.path),
    }
    used: dict[str, Any] = {
        "file": str(record.path),
        "scale": record.scale,
        "damping": report.damping,
    }
    if measured is not None:
        origin["measured"], used["measured"] = file_hash(measured), str(measured)
    if (scores := report.comparison) is not None:
        used["against_measured"] = scores
    study.record("prediction", "prediction.nc", "predict", origin, used)


def _summary(
    system: System,
    posterior: Posterior,
    motion: GroundMotion,
    values: Values,
    settings: PredictionSettings,
    errors: EventErrors | None,
    progress: Progress,
) -> tuple[HistorySummary, list[str]]:
    """Summary of the histories of draws, and what is to be said of their level."""
    theta, zeta, told = values.of_structure, values.zeta, list[str]()
    if not changes_with_level(system.placed):
        told += far_stronger(posterior.settings, motion.peak)
    else:
        progress.start("Finding the level of the motion", len(zeta))
        kept = settings.damping is not None
        there, _, note = at_own_level(
            system, values, motion, posterior.settings, keep_damping=kept, progress=progress
        )
        theta, zeta = there.of_structure, there.zeta
        told.append(note)
    histories = history_batches(
        system, theta, zeta, motion.inputs, motion.time_step, progress=progress
    )
    return summarise(errors.applied(histories) if errors else histories, 100), told


def _measured_floors(
    model: StudyModel,
    path: Path,
    columns: Mapping[str, str] | None,
    record: RecordSource,
    motion: GroundMotion,
) -> Floats:
    """Measured floor accelerations (f, n), sensors averaged, NaN for floors without any."""
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
        if sensors := data.rows(floor, direction):
            rows[place] = without_offset(data.acceleration[sensors].mean(axis=0)) * record.scale
    if np.isnan(rows).all():
        raise MeasurementError(
            f"{path}: none of its floors ({', '.join(data.floors)}) belongs to the building "
            f"({', '.join(model.reduced.floors)})"
        )
    return rows


def _damped(
    model: StudyModel, posterior: Posterior, settings: PredictionSettings
) -> tuple[Values, str]:
    """Some draws with their damping ratios, and whose ratios these are, in words."""
    values = posterior.parameters.split(posterior.thinned(settings.samples, settings.seed))
    law, zeta = model.building.damping, values.zeta
    if law.is_rayleigh:
        if settings.damping is not None:
            raise BuildingError(
                f"{model.building.name}: damping.law is rayleigh, which gives every mode its own "
                "ratio; leave --damping out"
            )
        return values, "the building's law"
    if settings.damping is not None:
        asked = torch.full_like(zeta, settings.damping)
        return replace(values, zeta=asked), f"{settings.damping:g} in all modes"
    if posterior.zeta_samples is not None:
        drawn = zeta.numpy()
        return values, f"{plus_minus(drawn.mean(), drawn.std())}, from the posterior"
    where = "in all modes" if law.ratios is None else "in the first mode"
    return values, f"{law.ratio:g} {where}, the building file's"


def _chosen_scatter(
    posterior: Posterior, settings: PredictionSettings, rows: Integers
) -> EventScatter:
    """What was asked for, else what several runs have taught, else the default."""
    found = DEFAULT if posterior.scatter is None else posterior.scatter.of(rows)
    if settings.scatter is not None:
        found = replace(found, stiffness=settings.scatter)
    if settings.damping_scatter is not None:
        found = replace(found, damping=settings.damping_scatter)
    return found


def _members(
    study: Study,
    model: StudyModel,
    values: Values,
    motion: GroundMotion,
    asked: tuple[ChosenMembers | None, int],
    progress: Progress,
) -> tuple[MemberForces, ...]:
    """Forces of the members asked for, at so many draws, written into the study."""
    (chosen, draws), drawn = asked, len(values.zeta)
    if chosen is None:
        return ()
    few = np.linspace(0, drawn - 1, min(draws, drawn)).astype(int)
    progress.start("Forces of members", len(few))
    members = member_forces(
        chosen,
        values.of_structure[few].numpy(),
        values.zeta[few].numpy(),
        (motion.acceleration, motion.time_step),
        1.3 * float(model.frequency_hz[-1]),
        progress,
    )
    write_member_forces(members, motion.time_step, study.result("member_forces.csv"))
    return members


def _notes(
    model: StudyModel, posterior: Posterior, motion: GroundMotion, settings: PredictionSettings
) -> tuple[str, ...]:
    # How much the building differs between events, and where that is from.
    scatter = _chosen_scatter(posterior, settings, np.arange(posterior.log_likelihood.size))
    sizes = (float(np.median(sd)) for sd in (scatter.stiffness, scatter.damping))
    between = "stiffness scatters by {} and damping by {}".format(*map(percent, sizes))
    learned = None if settings.scatter is not None else posterior.scatter
    between += " (assumed)" if learned is None else f", as between the {learned.runs} runs"
    errs = (
        "; the calibration learned no error of the model, so none is in them"
        if posterior.model_error is None
        else ", and the model errs as it did in the calibration: what of it stays corrects the mean"
    )
    notes = [
        f"Intervals are those of the next measurement: between events {between}{errs}.",
        f"Record {motion.title}: peak "
        f"{motion.peak:.3g} m/s², {motion.duration:.1f} s at {1 / motion.time_step:.4g} Hz.",
    ]
    top = float(model.frequency_hz[-1])
    if motion.rotation is not None:
        size = float(np.sqrt((motion.rotation**2).mean()))
        notes.append(
            f"The base turns as two vertical sensors or more measured it, by {size:.3g} rad/s2 rms;"
            " drifts are those against the base as it turns."
        )
    if motion.across is not None:
        notes.append("Floors follow the base's motion across, too, which the record has.")
    elif model.system.crosses:
        notes.append(
            "Floors follow the base's motion across, too, which the record lacks: it is zero here."
        )
    if settings.members and len(motion.inputs) > 1:
        notes.append("Forces of members are those of the base's translation alone.")
    if 0.5 / motion.time_step > 1.05 * top:
        notes.append(
            f"The reduced model is checked up to {top:.4g} Hz; what the record holds above that is "
            "followed approximately."
        )
    if model.building.forces_are_relative:
        notes.append(
            "The masses of this building are nominal: story shears and stiffnesses are relative."
        )
    if settings.members:
        notes.append(ALONE)
    return tuple(notes)
