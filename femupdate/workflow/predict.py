"""predict: what the calibrated building does in another earthquake."""

import json
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray

from femupdate.building.analysis import RayleighDamping
from femupdate.dynamics.history import Histories, HistorySettings, history_batches
from femupdate.dynamics.spectra import response_spectrum
from femupdate.dynamics.summary import HistorySummary, Statistics, statistics, summarise
from femupdate.dynamics.superposition import BaseMotion
from femupdate.errors import BuildingError, MeasurementError
from femupdate.inference.posterior import Posterior, load_posterior
from femupdate.measurement.observation_file import Histories as MeasuredHistories
from femupdate.measurement.observation_file import read_observation_file
from femupdate.measurement.record import GroundMotion, read_record
from femupdate.netcdf import write_tree
from femupdate.study import Study, file_hash
from femupdate.workflow.members import (
    ChosenMembers,
    MemberForces,
    Place,
    choose_members,
    member_forces,
    write_member_forces,
)
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import observed_direction
from femupdate.workflow.progress import Progress, Silent

if TYPE_CHECKING:
    from femupdate.dynamics.effect_response import EffectSystem

Floats = NDArray[np.float64]

PREDICTION = "prediction"
_EXAMPLES = 100
_SPECTRUM_HZ, _SPECTRUM_POINTS = (0.2, 40.0), 120


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
    channel: str | None = None
    scale: float = 1.0


@dataclass(frozen=True)
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
    """

    samples: int = 300
    damping: float | None = None
    seed: int = 0
    spectrum_damping: float | None = None
    members: tuple[Place | str, ...] = ()
    member_draws: int = 24


@dataclass(frozen=True)
class FloorSpectra:
    """Response spectra of the floors: peak absolute acceleration of oscillators that stand there.

    Attributes:
        frequency_hz: (k,) of the oscillators.
        damping: their damping ratio.
        acceleration: (f, k) statistics over the samples, m/s2.
        base: (k,) of the ground motion itself, m/s2.
    """

    frequency_hz: Floats
    damping: float
    acceleration: Statistics
    base: Floats


@dataclass(frozen=True)
class Comparison:
    """Prediction against floors that were measured in the same motion.

    Attributes:
        floors: that were measured.
        relative_error: (f,) rms of mean prediction less measurement over rms of the measurement.
        correlation: (f,) of the two histories.
        peak_ratio: (f,) peak of the mean prediction over the measured peak.
        within_band: (f,) share of the instants at which the measurement lies within 2 sd.
    """

    floors: tuple[str, ...]
    relative_error: Floats
    correlation: Floats
    peak_ratio: Floats
    within_band: Floats


@dataclass(frozen=True)
class PredictionReport:
    """What was predicted.

    Attributes:
        summary: bands and peaks.
        path: the netCDF file.
        peak_acceleration: (f,) statistics over the samples, m/s2.
        story_stiffness: (s,) statistics, N/m.
        damping: what damping was used, in words.
        comparison: with measured floors, where there are any.
        notes: what the user should know.
        pictures: files drawn.
        seconds: all the time taken.
        floor_spectra: where they were asked for, over the first hundred samples.
        members: forces of the members asked for.
    """

    summary: HistorySummary
    path: Path
    peak_acceleration: Statistics
    story_stiffness: Statistics
    damping: str
    comparison: Comparison | None
    notes: tuple[str, ...]
    pictures: tuple[Path, ...]
    seconds: float
    floor_spectra: FloorSpectra | None = None
    members: tuple[MemberForces, ...] = ()


def predict_study(
    study: Study,
    model: StudyModel,
    record: RecordSource,
    settings: PredictionSettings | None = None,
    *,
    measured: Path | None = None,
    columns: Mapping[str, str] | None = None,
    progress: Progress | None = None,
) -> PredictionReport:
    """Predict floor histories and story shears for a ground motion.

    Args:
        study: with a posterior.
        model: of the study.
        record: the ground motion.
        settings: samples and damping.
        measured: observation file with the floors measured in the same motion, to compare.
        columns: its column names, ours to the file's.
        progress: told about samples done.

    Raises:
        BuildingError: a ratio is asked for, but the building's law gives every mode its own.
        MeasurementError: record or measurement cannot be used.
        StudyError: there is no posterior, or it is of another building.
    """
    show, settings = progress or Silent(), settings or PredictionSettings()
    started = time.monotonic()
    motion = read_record(record.path, record.unit, _channel(record.channel)).scaled(record.scale)
    reference = None if measured is None else _measured(model, measured, columns, record, motion)
    posterior = load_posterior(study.require("posterior", "calibrate"))
    study.check_fresh("posterior", model.made_from(), "calibrate")
    theta, zeta, damping = _draws(model, posterior, settings)
    system = _with_effects(study, model)
    theta, zeta, at_level = _at_level(system, posterior, theta, zeta, motion, settings, show)
    chosen = choose_members(model.building, settings.members) if settings.members else None
    show.start("Integrating the response", len(theta))
    summary = summarise(_histories(system, model, theta, zeta, motion, show), _EXAMPLES)
    comparison = None if reference is None else _compare(summary, reference)
    spectra = _spectra(summary, motion, settings.spectrum_damping)
    few = np.linspace(0, len(theta) - 1, min(settings.member_draws, len(theta))).astype(int)
    members = _members(study, model, chosen, theta[few], zeta[few], motion, show)
    path = study.path("prediction.nc")
    save_prediction(summary, motion, path, damping, spectra)
    study.record(
        PREDICTION,
        "prediction.nc",
        "predict",
        {
            **model.made_from(),
            "posterior": study.artefacts()["posterior"].sha256,
            "record": file_hash(record.path),
        },
        {"file": str(record.path), "scale": record.scale, "damping": damping},
    )
    return PredictionReport(
        summary,
        path,
        statistics(summary.peak_acceleration),
        statistics(summary.story_stiffness),
        damping,
        comparison,
        (*_notes(model, motion), *at_level),
        _draw(study, summary, motion, reference, show, spectra, members),
        time.monotonic() - started,
        spectra,
        members,
    )


def _members(
    study: Study,
    model: StudyModel,
    chosen: ChosenMembers | None,
    theta: torch.Tensor,
    zeta: torch.Tensor,
    motion: GroundMotion,
    show: Progress,
) -> tuple[MemberForces, ...]:
    """Forces of the members asked for, written into the study."""
    if chosen is None:
        return ()
    show.start("Forces of members", len(theta))
    members = member_forces(
        chosen,
        theta.numpy(),
        None if isinstance(model.building.damping, RayleighDamping) else zeta.numpy(),
        BaseMotion(motion.acceleration, motion.time_step),
        1.3 * float(model.frequency_hz[-1]),
        show.advance,
    )
    write_member_forces(members, motion.time_step, study.path("member_forces.csv"))
    return members


def _spectra(
    summary: HistorySummary, motion: GroundMotion, damping: float | None
) -> FloorSpectra | None:
    if damping is None:
        return None
    step = motion.time_step
    top = min(_SPECTRUM_HZ[1], 0.4 / step)
    frequency = np.geomspace(_SPECTRUM_HZ[0], top, _SPECTRUM_POINTS)
    of_floors = response_spectrum(summary.examples.floor_acceleration, step, frequency, damping)
    base = response_spectrum(motion.acceleration, step, frequency, damping)
    return FloorSpectra(frequency, damping, statistics(of_floors), base)


def _with_effects(study: Study, model: StudyModel) -> "EffectSystem | None":
    """The structure with the effects that the building lists, if any."""
    if not model.building.effects:
        return None
    from femupdate.workflow.calibrate_effects import open_effects

    return open_effects(study, model)


def _at_level(
    system: "EffectSystem | None",
    posterior: Posterior,
    parameters: torch.Tensor,
    zeta: torch.Tensor,
    motion: GroundMotion,
    settings: PredictionSettings,
    show: Progress,
) -> tuple[torch.Tensor, torch.Tensor, tuple[str, ...]]:
    """Draws at the level of motion that they reach, and what is to be said of it."""
    from femupdate.workflow.amplitude import at_own_level, changes_with_level

    if system is None or not changes_with_level(system.placed):
        return parameters, zeta, ()
    stories = system.reduced.model.parameters
    show.start("Finding the level of the motion", len(parameters))
    found = at_own_level(
        system,
        (parameters[:, :stories].numpy(), zeta.numpy(), parameters[:, stories:].numpy()),
        motion,
        posterior.settings,
        keep_damping=settings.damping is not None,
        progress=show.advance,
    )
    moved = torch.cat([torch.from_numpy(found.theta), parameters[:, stories:]], dim=1)
    return moved, torch.from_numpy(found.zeta), (found.note,)


def _histories(
    system: "EffectSystem | None",
    model: StudyModel,
    parameters: torch.Tensor,
    zeta: torch.Tensor,
    motion: GroundMotion,
    show: Progress,
) -> Iterator[Histories]:
    """Response histories; a building with effects has their parameters behind its factors."""
    if system is None:
        return history_batches(
            model.reduced,
            parameters,
            zeta,
            motion.acceleration,
            motion.time_step,
            settings=HistorySettings(law=model.law),
            progress=show.advance,
        )
    from femupdate.dynamics.effect_history import effect_histories

    stories = model.reduced.parameters
    return effect_histories(
        system,
        parameters[:, :stories].numpy(),
        zeta.numpy(),
        parameters[:, stories:].numpy(),
        motion.acceleration,
        motion.time_step,
        show.advance,
    )


def save_prediction(
    summary: HistorySummary,
    motion: GroundMotion,
    path: Path,
    damping: str,
    spectra: FloorSpectra | None = None,
) -> None:
    """Write netCDF groups `predictions` (bands, per-sample peaks) and `constant_data`."""
    import xarray as xr

    stories = np.arange(1, summary.peak_shear.shape[1] + 1)
    coordinates = {"floor": list(summary.floors), "time_s": summary.time, "story": stories}
    predictions = xr.Dataset(
        {
            "acceleration_mean": (("floor", "time_s"), summary.acceleration_mean),
            "acceleration_sd": (("floor", "time_s"), summary.acceleration_sd),
            "peak_acceleration": (("sample", "floor"), summary.peak_acceleration),
            "peak_shear": (("sample", "story"), summary.peak_shear),
            "peak_drift": (("sample", "story"), summary.peak_drift),
            "story_stiffness": (("sample", "story"), summary.story_stiffness),
        },
        coords=coordinates,
        attrs={"units": json.dumps({"acceleration": "m/s2", "shear": "N", "drift": "m"})},
    )
    if spectra is not None:
        predictions = predictions.assign_coords(oscillator_hz=spectra.frequency_hz).assign(
            floor_spectrum_mean=(("floor", "oscillator_hz"), spectra.acceleration.mean),
            floor_spectrum_sd=(("floor", "oscillator_hz"), spectra.acceleration.sd),
        )
    constant = xr.Dataset(
        {"base_acceleration": ("time_s", motion.acceleration)}, {"time_s": summary.time}
    )
    tree = xr.DataTree.from_dict({"/predictions": predictions, "/constant_data": constant})
    tree.attrs = {"record": motion.name, "channel": motion.channel, "damping": damping}
    write_tree(tree, path)


def _channel(text: str | None) -> str | int | None:
    return int(text) if text is not None and text.isdigit() else text


def _draws(
    model: StudyModel, posterior: Posterior, settings: PredictionSettings
) -> tuple[torch.Tensor, torch.Tensor, str]:
    theta, zeta = posterior.thinned(settings.samples, settings.seed)
    if isinstance(model.building.damping, RayleighDamping):
        if settings.damping is not None:
            raise BuildingError(
                f"{model.building.name}: damping.law is rayleigh, which gives every mode its own "
                "ratio; leave --damping out"
            )
        ratio, text = np.full(len(theta), model.building.damping.ratio), "the building's law"
    elif settings.damping is not None:
        ratio, text = np.full(len(theta), settings.damping), f"{settings.damping:g} in all modes"
    elif zeta is not None:
        ratio, text = zeta, f"{zeta.mean():.4f} +- {zeta.std():.4f}, from the posterior"
    else:
        ratio = np.full(len(theta), model.building.damping.ratio)
        text = f"{model.building.damping.ratio:g} in all modes, the building file's"
    return torch.from_numpy(theta), torch.from_numpy(ratio), text


def _measured(
    model: StudyModel,
    path: Path,
    columns: Mapping[str, str] | None,
    record: RecordSource,
    motion: GroundMotion,
) -> Floats:
    """Measured floor accelerations (f, n), sensors averaged, NaN for floors without any."""
    data = read_observation_file(path, record.unit, columns)
    if not isinstance(data, MeasuredHistories):
        raise MeasurementError(f"{path}: a comparison needs histories (a column time_s)")
    count = motion.acceleration.size
    same = abs(data.time_step - motion.time_step) < 1e-6 * motion.time_step
    if not same or data.acceleration.shape[1] != count:
        raise MeasurementError(
            f"{path}: {data.acceleration.shape[1]} samples every {data.time_step:g} s do not match "
            f"the record's {count} every {motion.time_step:g} s; take both from one recording"
        )
    direction = observed_direction(model)
    rows = np.full((len(model.reduced.floors), count), np.nan)
    for place, floor in enumerate(model.reduced.floors):
        own = [
            row
            for row, channel in enumerate(data.channels)
            if channel.floor == floor and channel.direction == direction
        ]
        if own:
            rows[place] = data.acceleration[own].mean(axis=0) * record.scale
    if np.isnan(rows).all():
        raise MeasurementError(
            f"{path}: none of its floors ({', '.join(data.floors)}) belongs to the building "
            f"({', '.join(model.reduced.floors)})"
        )
    return rows


def _compare(summary: HistorySummary, measured: Floats) -> Comparison:
    seen = np.isfinite(measured).all(axis=1)
    mean, sd, truth = summary.acceleration_mean[seen], summary.acceleration_sd[seen], measured[seen]
    error = np.sqrt(((mean - truth) ** 2).mean(axis=1) / (truth**2).mean(axis=1))
    correlation = (mean * truth).sum(axis=1) / np.sqrt(
        (mean**2).sum(axis=1) * (truth**2).sum(axis=1)
    )
    return Comparison(
        tuple(summary.floors[row] for row in np.flatnonzero(seen)),
        error,
        correlation,
        np.abs(mean).max(axis=1) / np.abs(truth).max(axis=1),
        (np.abs(mean - truth) <= 2.0 * sd).mean(axis=1),
    )


def _notes(model: StudyModel, motion: GroundMotion) -> tuple[str, ...]:
    notes = [
        f"Record {motion.name}{' ' + motion.channel if motion.channel else ''}: peak "
        f"{motion.peak:.3g} m/s2, {motion.duration:.1f} s at {1 / motion.time_step:.4g} Hz."
    ]
    top = float(model.frequency_hz[-1])
    if 0.5 / motion.time_step > 1.05 * top:
        notes.append(
            f"The reduced model is checked up to {top:.4g} Hz; what the record holds above that is "
            "followed approximately."
        )
    if not getattr(model.building, "masses_known", True):
        notes.append(
            "The masses of this building are nominal: story shears and stiffnesses are relative."
        )
    return tuple(notes)


def _draw(
    study: Study,
    summary: HistorySummary,
    motion: GroundMotion,
    measured: Floats | None,
    show: Progress,
    spectra: FloorSpectra | None,
    members: tuple[MemberForces, ...],
) -> tuple[Path, ...]:
    from femupdate.report.figure import save_figure
    from femupdate.report.plot_history import floor_history_bands, story_shear_drift
    from femupdate.report.plot_members import member_force_bands
    from femupdate.report.plot_spectra import floor_spectra_bands

    show.start("Drawing", 2)
    title = f"Floor acceleration, mean ± 2 sd: {motion.name} (peak {motion.peak:.2f} m/s²)"
    bands = floor_history_bands(
        summary.time,
        summary.acceleration_mean,
        summary.acceleration_sd,
        summary.floors,
        measured=measured,
        title=title,
    )
    paths = [save_figure(bands, study.path("pictures", "floor_histories.png"))]
    show.advance()
    lines = story_shear_drift(
        summary.examples.story_shear, summary.examples.story_drift, summary.story_stiffness
    )
    paths.append(save_figure(lines, study.path("pictures", "story_shear_drift.png")))
    show.advance()
    if spectra is not None:
        figure = floor_spectra_bands(
            spectra.frequency_hz,
            spectra.acceleration.mean,
            spectra.acceleration.sd,
            summary.floors,
            base=spectra.base,
            title=f"Floor spectra at {spectra.damping:.0%} damping, mean ± 2 sd: {motion.name}",
        )
        paths.append(save_figure(figure, study.path("pictures", "floor_spectra.png")))
    if members:
        figure = member_force_bands(
            summary.time,
            [(f"{m.member.kind} {m.member.name}", *_main_forces(m)) for m in members],
            title=f"Forces of members, mean ± 2 sd: {motion.name}",
        )
        paths.append(save_figure(figure, study.path("pictures", "member_forces.png")))
    return tuple(paths)


def _main_forces(member: MemberForces) -> tuple[tuple[str, ...], Floats, Floats]:
    """Name, mean and sd of the largest normal force, shear and moment of a member."""
    names = member.member.forces
    kinds = [[k for k, name in enumerate(names) if name[0] == first] for first in "NVM"]
    largest = [max(kind, key=lambda k: float(member.peak.mean[k])) for kind in kinds]
    return tuple(names[k] for k in largest), member.mean[largest], member.sd[largest]
