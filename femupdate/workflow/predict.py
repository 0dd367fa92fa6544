"""predict: what the calibrated building does in another earthquake."""

import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from femupdate.building.shear import require_heights
from femupdate.dynamics.history import OwnLevel, ResponseHistories, history_batches
from femupdate.dynamics.members import (
    BaseRecord,
    MemberForces,
    choose_members,
    member_forces,
    write_member_forces,
)
from femupdate.dynamics.spectra import floor_spectra
from femupdate.dynamics.summary import summarise
from femupdate.inference.next_event import EventErrors
from femupdate.inference.posterior import Posterior
from femupdate.measurement.record import GroundMotion
from femupdate.progress import SILENT, Progress
from femupdate.report.prediction import Prediction, read_prediction, save_prediction
from femupdate.report.quantities import ALONE, PEAKS, quantities
from femupdate.seeds import spawn
from femupdate.study import Study, file_hash
from femupdate.units import percent
from femupdate.workflow.amplitude import UNFOLLOWED, changing_note, mean_level
from femupdate.workflow.mesh_error import open_system
from femupdate.workflow.model import StudyModel, on_kept_finer
from femupdate.workflow.predict_draws import (
    PredictionDraws,
    PredictionTask,
    at_reached_level,
    chosen_scatter,
    in_another_event,
    prediction_draws,
)
from femupdate.workflow.prediction_inputs import PredictionSettings, RecordSource, measured_floors
from femupdate.workflow.summary import kept_posterior

_EXAMPLES = 100


def kept_prediction(study: Study, model: StudyModel) -> Prediction:
    """What a study keeps of a prediction.

    Raises:
        StudyError: there is none, or it is damaged.
    """
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
        study: with a posterior.
        measured: observation file with the floors measured in the same motion, to compare.
        columns: its column names, ours to the file's.

    Raises:
        BuildingError: a ratio is asked for, but the building's law gives every mode its own.
        MeasurementError: record or measurement cannot be used.
        StudyError: there is no posterior, or it is of another building.
    """
    settings = settings or PredictionSettings()
    started = time.monotonic()
    model = on_kept_finer(study, model)
    motion = record.motion(columns if measured in (None, record.path) else None)
    if motion.rotation is not None:
        require_heights(model.building)
    reference = None
    if measured is not None:
        reference = measured_floors(model, measured, columns, record, motion)
    study.check_fresh("posterior", model.made_from(), "calibrate")
    posterior = kept_posterior(study, model.building)
    system = open_system(study, model)
    task = PredictionTask(system, posterior, motion, settings, progress)
    draws = prediction_draws(model, posterior, settings)
    progress.start("Integrating the response", len(draws.rows))
    histories, at_level = _histories(task, draws)
    # Of the parameters alone, as they were when they were measured.
    alone = summarise(histories, _EXAMPLES)
    moving, erring = spawn(settings.seed, 2)
    # Errors of the model fade below the lowest frequency.
    lowest = system.modes(draws.values.theta[:1], draws.values.sizes[:1]).omega.min()
    errors = EventErrors(posterior, draws.rows, 0.25 * float(lowest) / (2.0 * np.pi), erring)
    moved = in_another_event(task, draws, moving)
    progress.start("Integrating the response of another event", len(draws.rows))
    histories, _ = _histories(task, moved)
    summary = summarise(errors.applied(histories), _EXAMPLES)
    # A stiffness is the building's own: errors of shear and drift are none of it.
    summary = replace(summary, story_stiffness=alone.story_stiffness)
    best = errors.corrected(alone.floors, alone.acceleration_mean, motion.time_step)
    spectra, damping = None, settings.spectrum_damping
    if damping is not None:
        floors = summary.examples.floor_acceleration
        spectra = floor_spectra(floors, motion.acceleration, motion.time_step, damping)
    peaks = [getattr(summary, name) for name in PEAKS]
    mass = float(model.reduced.story_mass[0])
    members = _members(study, model, draws, task)
    report = Prediction(
        summary=summary,
        alone=alone,
        best=best,
        path=study.result("prediction.nc"),
        damping=draws.damping,
        # The decisive come first.
        notes=(*posterior.warnings, *at_level, *_notes(model, posterior, motion, settings)),
        seconds=time.monotonic() - started,
        quantities=quantities(model.building, summary.floors, peaks, mass),
        motion=motion,
        measured=reference,
        floor_spectra=spectra,
        members=members,
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
    used = {"file": str(record.path), "scale": record.scale, "damping": report.damping}
    if measured is not None:
        origin["measured"], used["measured"] = file_hash(measured), str(measured)
    if report.comparison is not None:
        used["against_measured"] = report.comparison.as_dict()
    study.record("prediction", "prediction.nc", "predict", origin, used)


def _histories(
    task: PredictionTask, draws: PredictionDraws
) -> tuple[Iterator[ResponseHistories], tuple[str, ...]]:
    values, told = at_reached_level(task, draws)
    theta, zeta = values.of_structure, values.zeta
    record = task.motion.inputs, task.motion.time_step
    if not task.system.changes_in_run or task.system.complex_modes:
        batches = history_batches(task.system, theta, zeta, *record, progress=task.show)
        return batches, (*told, *(UNFOLLOWED if task.system.changes_in_run else ()))
    level = mean_level(task.system, task.posterior.settings)
    keep = task.settings.damping is not None
    own = OwnLevel(level, keep)
    batches = history_batches(task.system, theta, zeta, *record, level=own, progress=task.show)
    return batches, (*told, changing_note(level is not None))


def _members(
    study: Study, model: StudyModel, draws: PredictionDraws, task: PredictionTask
) -> tuple[MemberForces, ...]:
    """Forces of the members asked for, written into the study."""
    motion, settings, show = task.motion, task.settings, task.show
    if not settings.members:
        return ()
    chosen = choose_members(model.building, settings.members)
    count = min(settings.member_draws, len(draws.rows))
    few = np.linspace(0, len(draws.rows) - 1, count).astype(int)
    theta, zeta = draws.values.of_structure[few], draws.values.zeta[few]
    show.start("Forces of members", len(theta))
    members = member_forces(
        chosen,
        theta.numpy(),
        zeta.numpy(),
        BaseRecord(motion.acceleration, motion.time_step),
        1.3 * float(model.frequency_hz[-1]),
        show,
    )
    write_member_forces(members, motion.time_step, study.result("member_forces.csv"))
    return members


def _notes(
    model: StudyModel, posterior: Posterior, motion: GroundMotion, settings: PredictionSettings
) -> tuple[str, ...]:
    # How much the building differs between events, and where that is from.
    scatter = chosen_scatter(posterior, settings, np.arange(posterior.log_likelihood.size))
    sizes = (float(np.median(sd)) for sd in (scatter.stiffness, scatter.damping))
    between = "stiffness scatters by {} and damping by {}".format(*map(percent, sizes))
    if posterior.scatter is None or settings.scatter is not None:
        between += " (--scatter, --damping-scatter)"
    else:
        between += f", as between the {posterior.scatter.runs} runs"
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
        if settings.members:
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
