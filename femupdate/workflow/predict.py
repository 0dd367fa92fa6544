"""predict: what the calibrated building does in another earthquake."""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.shear import require_heights
from femupdate.dynamics.history import OwnLevel, ResponseHistories, history_batches
from femupdate.dynamics.members import (
    BaseRecord,
    MemberForces,
    choose_members,
    member_forces,
    write_member_forces,
)
from femupdate.dynamics.spectra import FloorSpectra, floor_spectra
from femupdate.dynamics.summary import (
    Comparison,
    HistorySummary,
    Statistics,
    compare,
    score_table,
    statistics,
    summarise,
)
from femupdate.inference.next_event import EventErrors
from femupdate.inference.posterior import Posterior
from femupdate.measurement.record import GroundMotion
from femupdate.progress import SILENT, Progress
from femupdate.report.curves import Curve, history_curves, spectrum_curves
from femupdate.report.scale import Scale
from femupdate.result import Item, Note, Notes, Picture, Result
from femupdate.seeds import spawn
from femupdate.study import Study, file_hash
from femupdate.tables import Table
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
from femupdate.workflow.prediction_file import save_prediction
from femupdate.workflow.prediction_inputs import PredictionSettings, RecordSource, measured_floors
from femupdate.workflow.prediction_quantities import (
    ALONE,
    PEAKS,
    DrawnQuantity,
    floor_table,
    force_scales,
    in_unit,
    member_tables,
    quantities,
    quantity_tables,
    tidy_table,
)
from femupdate.workflow.summary import kept_posterior

PREDICTION = "prediction"
_EXAMPLES = 100


@dataclass(frozen=True, kw_only=True)
class Prediction(Result):
    """What was predicted.

        >>> import femupdate
        >>> how = {"exact": True, "particles": 400}
        >>> found = femupdate.calibrate("house", "run.csv", building="shear_3dof", **how)
        >>> predicted = femupdate.predict("house", "quake.csv", unit="m/s2", samples=20)
        >>> isinstance(predicted, femupdate.Prediction), predicted.summary.floors
        (True, ('2F', '3F', 'RF'))

    Attributes:
        summary: bands and peaks of the next measurement: parameters, scatter between events,
            errors of the model and what does not follow the base.
        alone: those of the parameters alone.
        best: (f, n) floor acceleration by the mean of these and by what stays of the model's
            error, m/s2.
        path: the netCDF file.
        damping: what damping was used, in words.
        notes: what the user should know.
        seconds: all the time taken.
        quantities: peaks, drift ratios, base shear and stiffness of the stories, by key.
        motion: of the base.
        measured: (f, n) floors measured in the same motion, m/s2, if any.
        floor_spectra: where they were asked for, over the first hundred samples.
        members: forces of the members asked for.
    """

    summary: HistorySummary
    alone: HistorySummary
    best: Floats
    path: Path
    damping: str
    notes: tuple[str, ...]
    seconds: float
    quantities: Mapping[str, DrawnQuantity]
    motion: GroundMotion
    measured: Floats | None = None
    floor_spectra: FloorSpectra | None = None
    members: tuple[MemberForces, ...] = ()

    @property
    def peak_acceleration(self) -> Statistics:
        """(f,) statistics over the samples, m/s2."""
        return statistics(self.summary.peak_acceleration)

    @property
    def story_stiffness(self) -> Statistics:
        """(s,) statistics over the samples, N/m."""
        return statistics(self.alone.story_stiffness)

    @property
    def comparison(self) -> Comparison | None:
        """With measured floors, where there are any."""
        return None if self.measured is None else compare(self.summary, self.best, self.measured)

    def items(self) -> Iterator[Item]:
        """Peaks, stiffnesses and what else was asked for, notes and tables."""
        summary, alone, spectra = self.summary, self.alone, self.floor_spectra
        floors = summary.floors
        peaks = {
            "peak_acceleration_m_s2": self.peak_acceleration,
            "peak_acceleration_of_parameters_m_s2": statistics(alone.peak_acceleration),
        }
        stories = [str(k) for k in range(1, len(self.story_stiffness.mean) + 1)]
        yield Note(
            f"Prediction from {len(summary)} posterior draws, {self.seconds:.1f} s",
            {
                "floors": floors,
                **{key: own.by_name(floors) for key, own in peaks.items()},
                "story_stiffness_n_per_m": self.story_stiffness.by_name(stories),
                "seconds": self.seconds,
            },
        )
        yield Note(f"  damping ratio: {self.damping}", {"damping": self.damping})
        found = self.quantities.values()
        yield from quantity_tables(found)
        yield Note("  mean, and 5 to 95 % in brackets")
        yield from member_tables(self.members)
        if self.members:
            forces = [member.as_dict() for member in self.members]
            yield Note(content={"member_forces": forces})
        if spectra is not None:
            yield Note(content={"floor_spectra": spectra.as_dict(floors)})
            yield spectra.table(floors)
        if self.comparison is not None:
            figures = self.comparison.as_dict()
            yield Note(content={"comparison": figures})
            yield score_table(figures)
        yield Notes(self.notes, "--json has them", key="notes")
        yield Note(f"  {self.path}", {"prediction": self.path})
        yield tidy_table("peaks", found, key="peaks")
        yield tidy_table("predicted_peaks", found, self.members)
        if spectra is not None:
            yield _spectra_table(spectra, floors)
        histories = {
            "acceleration_mean_m_s2": lambda: _short(summary.acceleration_mean),
            "acceleration_sd_m_s2": lambda: _short(summary.acceleration_sd),
            "parameters_mean_m_s2": lambda: _short(alone.acceleration_mean),
            "parameters_sd_m_s2": lambda: _short(alone.acceleration_sd),
        }
        yield floor_table("floor_histories", floors, "time_s", _short(summary.time), histories)

    def figures(self) -> Iterator[Picture]:
        """Histories and stories; floor spectra and members where they were asked for."""
        from femupdate.report.plot_curves import (
            floor_history_bands,
            floor_spectra_bands,
            member_force_bands,
            story_shear_drift,
        )

        summary, motion, spectra = self.summary, self.motion, self.floor_spectra
        title = f"Floor acceleration, mean ± 2 sd: {motion.title} (peak {motion.peak:.2f} m/s²)"
        curves = history_curves(
            summary.time,
            summary.floors,
            summary.acceleration_mean,
            summary.acceleration_sd,
            alone=(self.alone.acceleration_mean, self.alone.acceleration_sd),
            measured=self.measured,
        )
        yield Picture("floor_histories", lambda: floor_history_bands(curves, title=title))
        yield Picture(
            "story_shear_drift",
            lambda: story_shear_drift(
                summary.examples.story_shear,
                summary.examples.story_drift,
                summary.story_stiffness,
                self.quantities["drift"].places,
            ),
        )
        if spectra is not None:
            own, damping = spectra.acceleration, f"{100.0 * spectra.damping:.3g} % damping"
            lines = spectrum_curves(
                spectra.frequency_hz, summary.floors, own.mean, own.sd, spectra.base
            )
            over = f"Floor spectra at {damping}, mean ± 2 sd: {motion.title}"
            yield Picture("floor_spectra", lambda: floor_spectra_bands(lines, title=over))
        if self.members:
            scales = force_scales(self.members)
            rows = [
                (f"{one.member.kind} {one.member.name}", force_curves(summary.time, one, scales))
                for one in self.members
            ]
            above = f"Forces of members, mean ± 2 sd: {motion.title}"
            yield Picture(
                "member_forces", lambda: member_force_bands(rows, title=above, note=ALONE)
            )


def force_curves(time: Floats, one: MemberForces, scales: tuple[Scale, Scale]) -> tuple[Curve, ...]:
    """Histories (n,) of a member's largest normal force, shear and moment, in units of tables."""
    curves = []
    for first in "NVM":
        kind = [k for k, name in enumerate(one.member.forces) if name[0] == first]
        k = max(kind, key=lambda k: float(one.peak.mean[k]))
        name, unit, factor = in_unit(one.member.forces[k], scales)
        own = history_curves(time, [name], one.mean[[k]] / factor, one.sd[[k]] / factor)
        curves += [replace(curve, up=f"{name}, {unit}") for curve in own]
    return tuple(curves)


def _spectra_table(found: FloorSpectra, floors: Sequence[str]) -> Table:
    """Response spectra of the ground and of every floor."""
    own, base = found.acceleration, found.base
    columns = {
        "damping_ratio": lambda: np.full((len(floors) + 1, len(base)), found.damping),
        "acceleration_mean_m_s2": lambda: np.vstack([base, own.mean]),
        "acceleration_sd_m_s2": lambda: np.vstack([0.0 * base, own.sd]),
        "acceleration_q05_m_s2": lambda: np.vstack([base, own.q05]),
        "acceleration_q95_m_s2": lambda: np.vstack([base, own.q95]),
    }
    return floor_table(
        "floor_spectra", ("base", *floors), "frequency_hz", found.frequency_hz, columns
    )


def _short(values: Floats) -> Floats:
    """Six significant figures: histories are long."""
    return np.array([float(f"{value:.6g}") for value in np.ravel(values)])


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
    alone, at_level = _as_calibrated(task, draws)
    # A stiffness is the building's own: errors of shear and drift are none of it.
    errors = _event_errors(task, draws)
    summary = replace(_in_another_event(task, draws, errors), story_stiffness=alone.story_stiffness)
    best = errors.corrected(alone.floors, alone.acceleration_mean, motion.time_step)
    spectra = _spectra(summary, motion, settings.spectrum_damping)
    members = _members(study, model, draws, task)
    path = study.result("prediction.nc")
    save_prediction(summary, alone, motion, path, draws.damping, spectra, reference)
    report = Prediction(
        summary=summary,
        alone=alone,
        best=best,
        path=path,
        damping=draws.damping,
        # The decisive come first.
        notes=(*posterior.warnings, *at_level, *_notes(model, posterior, motion, settings)),
        seconds=time.monotonic() - started,
        quantities=_quantities(model, summary),
        motion=motion,
        measured=reference,
        floor_spectra=spectra,
        members=members,
    )
    _record(study, model, record, report, measured)
    return report


def _as_calibrated(
    task: PredictionTask, draws: PredictionDraws
) -> tuple[HistorySummary, tuple[str, ...]]:
    """Bands of the parameters alone, as they were when they were measured."""
    task.show.start("Integrating the response", len(draws.rows))
    histories, told = _histories(task, draws)
    return summarise(histories, _EXAMPLES), told


def _event_errors(task: PredictionTask, draws: PredictionDraws) -> EventErrors:
    """Errors of the model in another event; they fade below the lowest frequency."""
    first = draws.values.theta[:1], draws.values.sizes[:1]
    lowest = float(task.system.modes(*first).omega.min()) / (2.0 * np.pi)
    seed = spawn(task.settings.seed, 2)[1]
    return EventErrors(task.posterior, draws.rows, 0.25 * lowest, seed)


def _in_another_event(
    task: PredictionTask, draws: PredictionDraws, errors: EventErrors
) -> HistorySummary:
    """Bands of the next measurement."""
    moved = in_another_event(task, draws, spawn(task.settings.seed, 2)[0])
    task.show.start("Integrating the response of another event", len(draws.rows))
    histories, _ = _histories(task, moved)
    return summarise(errors.applied(histories), _EXAMPLES)


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


def _quantities(model: StudyModel, summary: HistorySummary) -> Mapping[str, DrawnQuantity]:
    peaks = [getattr(summary, name) for name in PEAKS]
    return quantities(model.building, summary.floors, peaks, float(model.reduced.story_mass[0]))


def _spectra(
    summary: HistorySummary, motion: GroundMotion, damping: float | None
) -> FloorSpectra | None:
    """Response spectra of the floors where a damping ratio of oscillators is given."""
    if damping is None:
        return None
    floors = summary.examples.floor_acceleration
    return floor_spectra(floors, motion.acceleration, motion.time_step, damping)


def _record(
    study: Study,
    model: StudyModel,
    record: RecordSource,
    report: Prediction,
    measured: Path | None,
) -> None:
    """Note in the study what the prediction was made from, and how well it met measured floors."""
    origin = {
        **model.made_from(),
        "posterior": file_hash(study.require("posterior", "calibrate")),
        "record": file_hash(record.path),
    }
    settings = {"file": str(record.path), "scale": record.scale, "damping": report.damping}
    if measured is not None:
        origin["measured"], settings["measured"] = file_hash(measured), str(measured)
    if report.comparison is not None:
        settings["against_measured"] = report.comparison.as_dict()
    study.record(PREDICTION, "prediction.nc", "predict", origin, settings)


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
    between = _scatter(posterior, settings)
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


def _scatter(posterior: Posterior, settings: PredictionSettings) -> str:
    """How much the building differs between events, and where that is from."""
    scatter = chosen_scatter(posterior, settings, np.arange(posterior.log_likelihood.size))
    sizes = (float(np.median(sd)) for sd in (scatter.stiffness, scatter.damping))
    told = "stiffness scatters by {} and damping by {}".format(*map(percent, sizes))
    if posterior.scatter is None or settings.scatter is not None:
        return f"{told} (--scatter, --damping-scatter)"
    return f"{told}, as between the {posterior.scatter.runs} runs"
