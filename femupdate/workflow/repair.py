"""repair: add what is missing to the model, and show the gap before and after."""

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femupdate.building.files import save_building
from femupdate.building.schema import Building
from femupdate.discrepancy.diagnose import DiagnosisSettings
from femupdate.discrepancy.fit import Fit
from femupdate.discrepancy.mesh_error import MeshError
from femupdate.discrepancy.posterior import Draws, draw
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.repair import Repair
from femupdate.discrepancy.repair import repair as mend
from femupdate.discrepancy.where import p_value, residual_cells
from femupdate.dynamics.effect_history import effect_histories
from femupdate.dynamics.effect_response import ReducedStructure
from femupdate.errors import MeasurementError
from femupdate.inference.posterior import Posterior, save_posterior
from femupdate.measurement.columns import BASE
from femupdate.measurement.observation import Observation
from femupdate.measurement.observation_file import Histories, read_observation_file
from femupdate.study import Study, file_hash, write_text
from femupdate.workflow.calibrate import (
    POSTERIOR,
    ObservationSource,
    observation_of,
    observed_direction,
)
from femupdate.workflow.diagnose import ModelParts, cells_as_grid, model_parts, prepared, refined
from femupdate.workflow.effects import (
    building_effects,
    keep_basis,
    problem_of,
    with_effect,
    without_effects,
)
from femupdate.workflow.mesh_error import keep_mesh_error
from femupdate.workflow.model import StudyModel, keep_model, reduction_of
from femupdate.workflow.progress import Progress, Silent
from femupdate.workflow.second_record import level_between, second_record

Floats = NDArray[np.float64]
REPAIRED = "repaired"
_DRAWS = 1000
_CHAINS = 4


@dataclass(frozen=True, eq=False)
class Held:
    """How well two models predict data that neither was fitted to.

    Attributes:
        name: of the file.
        error_before, error_after: rms of the predicted less the measured floor accelerations over
            the rms of the measured; NaN for FRF tables.
        chi2_before, chi2_after: mean squared whitened residual of ln|H|.
        floors: names; time, measured, before, after: histories for the picture, or None.
    """

    name: str
    error_before: float
    error_after: float
    chi2_before: float
    chi2_after: float
    floors: tuple[str, ...]
    time: Floats | None = None
    measured: Floats | None = None
    before: Floats | None = None
    after: Floats | None = None


@dataclass(frozen=True, eq=False)
class RepairReport:
    """What was added and what it did.

    Attributes:
        repair: before and after.
        problem: the data.
        building: the repaired building.
        building_path: its file; None where nothing was added.
        study: the study of the repaired building; None likewise.
        theta_before, theta_after: (n, p) draws of the stiffness factors.
        held: on data kept out, if any.
        path: of the JSON file.
        pictures: files drawn.
        seconds: all the time taken.
    """

    repair: Repair
    problem: Problem
    building: Building
    building_path: Path | None
    study: Study | None
    theta_before: Floats
    theta_after: Floats
    held: Held | None
    path: Path
    pictures: tuple[Path, ...]
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """What the JSON file and `--json` hold."""
        done = self.repair
        held = self.held
        return {
            "verdict": done.verdict,
            "sentence": done.last.sentence,
            "rounds": [
                {
                    "effect": one.finding.placed.effect.name,
                    "place": one.finding.placed.place,
                    "size": one.finding.size,
                    "size_sd": one.finding.size_sd,
                    "log_evidence_over_none": one.finding.evidence.log_evidence,
                    "chi2_before": one.chi2_before,
                    "chi2_after": one.chi2_after,
                }
                for one in done.rounds
            ],
            "chi2_before": done.before.chi2,
            "chi2_after": done.after.chi2,
            "independent_points": self.problem.effective,
            "p_value_before": done.p_before,
            "p_value_after": done.p_after,
            "theta_before": self.theta_before.mean(axis=0).tolist(),
            "theta_after": self.theta_after.mean(axis=0).tolist(),
            "theta_sd_before": self.theta_before.std(axis=0).tolist(),
            "theta_sd_after": self.theta_after.std(axis=0).tolist(),
            "holdout_error_before": None if held is None else _number(held.error_before),
            "holdout_error_after": None if held is None else _number(held.error_after),
            "holdout_chi2_before": None if held is None else held.chi2_before,
            "holdout_chi2_after": None if held is None else held.chi2_after,
            "building": None if self.building_path is None else str(self.building_path),
            "study": None if self.study is None else str(self.study.folder),
            "seconds": self.seconds,
        }


def _number(value: float) -> float | None:
    """JSON knows no NaN."""
    return None if np.isnan(value) else value


def repair_study(
    study: Study,
    model: StudyModel,
    source: ObservationSource,
    holdout: ObservationSource | None = None,
    settings: DiagnosisSettings | None = None,
    progress: Progress | None = None,
    use_phase: bool = True,
    second: ObservationSource | None = None,
) -> RepairReport:
    """Diagnose, add what the evidence carries, update, and compare.

    The repaired building becomes a study of its own, the folder `repaired` inside this one, which
    every command takes; the study itself stays as it is.

    Args:
        study: of the building as it is.
        model: of the study.
        source: the data to explain.
        holdout: other data of the same building, to be predicted before and after.
        settings: of the diagnosis.
        progress: told about the steps.
        use_phase: compare phases where they were measured.
        second: another record at another level, to be explained together with the first.

    Raises:
        MeasurementError: an observation cannot be used.
    """
    show, started = progress or Silent(), time.monotonic()
    chosen = settings or DiagnosisSettings()
    observation = observation_of(model.building, source)
    other = None if holdout is None else observation_of(model.building, holdout)
    more = None if second is None else second_record(model, source, second)
    parts = model_parts(study, model, show)
    problem, base = prepared(model, parts, observation, use_phase, chosen, show, more)
    show.start("Looking for what is missing", 3)

    def renewed(now: Problem, fitted: Fit) -> tuple[Problem, Fit]:
        return refined(model, parts, now, fitted, show)

    done = mend(problem, base, chosen, lambda text: show.advance(1, text), renewed)
    mended = done.problem
    if done.rounds and not done.rounds[-1].finding.placed.exchange:
        mended, last = renewed(done.problem, done.after)
        done = replace(done, after=last, p_after=p_value(mended, last))
    show.start("Updating the posterior", 2)
    inflation = done.last.inflation
    before = draw(problem, done.before, _DRAWS, inflation, chosen.seed)
    show.advance()
    after = before
    if done.rounds:
        after = draw(mended, done.after, _DRAWS, inflation, chosen.seed)
    show.advance()
    held = None
    if holdout is not None and other is not None:
        show.start("Predicting the data kept out", 1)
        level = 0.0 if more is None else level_between(model, source, holdout)
        held = _hold(model, parts.mesh, problem, done, holdout, other, use_phase, level)
        show.advance()
    building, kept = model.building, None
    if done.rounds:
        building = _repaired_building(model.building, done)
        kept = _keep(study, model, building, mended, parts, observation, after, source, inflation)
    pictures = _draw(study, problem.reduced, problem, done, before, after, held, observation)
    report = RepairReport(
        done,
        problem,
        building,
        None if kept is None else kept.path("building.toml"),
        kept,
        before.theta,
        after.theta,
        held,
        study.path("repair.json"),
        pictures,
        time.monotonic() - started,
    )
    write_text(report.path, json.dumps(report.as_dict(), indent=2, default=float) + "\n")
    origin = {**model.made_from(), "observation": file_hash(source.path)}
    study.record("repair", "repair.json", "repair", origin, {"file": str(source.path)})
    return report


def _repaired_building(building: Building, done: Repair) -> Building:
    """The building with all effects of the last fit at their fitted values."""
    repaired = without_effects(building)
    values, first = done.after.sizes()[0], 0
    for placed in done.after.placed:
        count = len(placed.effect.parameters)
        repaired = with_effect(repaired, placed, values[first : first + count])
        first += count
    names = ", ".join(one.finding.placed.label for one in done.rounds)
    text = f"{building.description.rstrip()}\nRepaired: {names}.".strip()
    return repaired.model_copy(update={"description": text})


def _keep(
    study: Study,
    model: StudyModel,
    building: Building,
    problem: Problem,
    parts: ModelParts,
    observation: Observation,
    draws: Draws,
    source: ObservationSource,
    inflation: float,
) -> Study:
    """A study of the repaired building, with its file, reduced model, basis and posterior."""
    kept = Study(study.path(REPAIRED))
    kept.folder.mkdir(parents=True, exist_ok=True)
    save_building(building, kept.path("building.toml"))
    repaired = keep_model(kept, building, reduction_of(model))
    if problem.reduced.structure.operators is not None:
        from femupdate.building.files import mechanics_hash

        origin = {"building": mechanics_hash(without_effects(building))}
        keep_basis(kept, problem.reduced, origin)
    if parts.mesh is not None:
        keep_mesh_error(kept, building, parts.mesh)
    posterior = effect_posterior(repaired, observation, draws, {"inflation": inflation})
    save_posterior(posterior, kept.path("posterior.nc"))
    origin = {**repaired.made_from(), "observation": file_hash(source.path)}
    kept.record(POSTERIOR, "posterior.nc", "repair", origin, {"file": str(source.path)})
    return kept


def effect_posterior(
    model: StudyModel, observation: Observation, draws: Draws, settings: Mapping[str, Any]
) -> Posterior:
    """Draws of a building with effects as a posterior whose last columns are their parameters."""
    effects = building_effects(model.building)
    parameters = [(one, p) for one in effects.placed for p in one.effect.parameters]
    names = [f"{one.label}.{p.name}" for one, p in parameters]
    low = [max(p.lower, p.neutral - 5.0 * p.scale) for _, p in parameters]
    high = [min(p.upper, p.neutral + 5.0 * p.scale) for _, p in parameters]
    both = np.column_stack([draws.theta, draws.sizes])
    each = len(both) // _CHAINS
    # Resampled draws come in the order of their proposals: dealt out, every chain sees all.
    order = np.random.default_rng(0).permutation(len(both))[: each * _CHAINS]
    return Posterior(
        (*model.prior.names, *names),
        both[order].reshape(_CHAINS, each, -1),
        None if model.zeta_bounds is None else draws.zeta[order].reshape(_CHAINS, each),
        draws.log_likelihood[order].reshape(_CHAINS, each),
        np.concatenate([model.prior.lower.numpy(), low]),
        np.concatenate([model.prior.upper.numpy(), high]),
        "exact",
        np.full(_CHAINS, draws.log_evidence),
        observation,
        {"particles": len(both), "chains": _CHAINS, "exact": True, **settings},
    )


def _hold(
    model: StudyModel,
    mesh: MeshError | None,
    problem: Problem,
    done: Repair,
    source: ObservationSource,
    observation: Observation,
    use_phase: bool,
    level: float,
) -> Held:
    """Both models against data that neither has seen, at their level of motion."""
    reduced = problem.reduced
    own = problem_of(reduced, model.building, observation, use_phase, mesh)
    own = replace(own, blocks=tuple(replace(block, level=level) for block in own.blocks))
    chi2 = [_mean_square(own, fitted) for fitted in (done.before, done.after)]
    data = read_observation_file(source.path, source.unit, source.columns)
    floors = observation.floors
    if not isinstance(data, Histories):
        return Held(source.path.name, np.nan, np.nan, chi2[0], chi2[1], floors)
    base, measured = _channels(data, floors, observed_direction(model))
    rows = [reduced.model.floors.index(floor) for floor in floors]
    predicted = []
    for fitted in (done.before, done.after):
        theta, zeta, sizes = fitted.coordinates.split(fitted.z[None], problem.fixed_zeta)
        theta, zeta = fitted.system.at_level(theta, zeta, sizes, level)
        histories = next(
            effect_histories(
                fitted.system,
                theta.numpy(),
                zeta.numpy(),
                sizes.numpy(),
                base,
                data.time_step,
                instruments=True,
            )
        )
        predicted.append(histories.floor_acceleration[0][rows])
    size = np.sqrt((measured**2).mean())
    errors = [float(np.sqrt(((one - measured) ** 2).mean()) / size) for one in predicted]
    instants = data.time_step * np.arange(measured.shape[1], dtype=np.float64)
    return Held(
        source.path.name,
        errors[0],
        errors[1],
        chi2[0],
        chi2[1],
        floors,
        instants,
        measured,
        predicted[0],
        predicted[1],
    )


def _mean_square(problem: Problem, fitted: Fit) -> float:
    """Mean squared whitened residual of other data at the fitted parameters."""
    where = fitted.coordinates
    theta, zeta, sizes = where.split(fitted.z[None], problem.fixed_zeta)
    residual = problem.residuals(fitted.system, theta, zeta, sizes)
    return float((residual**2).sum()) / max(problem.effective, 1.0)


def _channels(data: Histories, floors: tuple[str, ...], direction: str) -> tuple[Floats, Floats]:
    """Base (n,) and floors (f, n), sensors averaged."""

    def mean(floor: str) -> Floats:
        own = [
            row
            for row, channel in enumerate(data.channels)
            if channel.floor == floor and channel.direction == direction
        ]
        if not own:
            raise MeasurementError(f"{data.source}: there is no channel {floor} along {direction}")
        return np.asarray(data.acceleration[own].mean(axis=0))

    return mean(BASE), np.stack([mean(floor) for floor in floors])


def _draw(
    study: Study,
    reduced: ReducedStructure,
    problem: Problem,
    done: Repair,
    before: Draws,
    after: Draws,
    held: Held | None,
    observation: Observation,
) -> tuple[Path, ...]:
    from femupdate.report.figure import save_figure
    from femupdate.report.glyphs import Glyphs
    from femupdate.report.plot_diagnosis import residual_map
    from femupdate.report.plot_repair import Curves, GapStory, Scene, gap_story
    from femupdate.workflow.effect_glyphs import effect_glyphs, geometry_of

    floors, edges, first = cells_as_grid(residual_cells(problem, done.before))
    maps = [("before", first)]
    names = [one.finding.placed for one in done.rounds]
    scene = None
    if done.rounds:
        last = cells_as_grid(residual_cells(problem, done.after))[2]
        maps.append(("after", last))
        structure = reduced.structure
        geometry = geometry_of(structure)
        glyphs = sum((effect_glyphs(structure, geometry, one) for one in names), Glyphs())
        levels = list(zip(structure.floors, structure.levels.tolist(), strict=True))
        caption = "\n".join(
            f"{one.finding.placed.effect.title}, {one.finding.placed.place}" for one in done.rounds
        )
        scene = Scene(edges, first, last, geometry, glyphs, levels, caption)
    title = " and ".join(f"{p.effect.title.lower()} at {p.place}" for p in names)
    headline = f"Added: {title}" if names else "Nothing was added"
    paths = [
        save_figure(
            residual_map(floors, edges, maps, title=headline),
            study.path("pictures", "gap_residuals.png"),
        )
    ]
    first_record = slice(problem.blocks[0].points)
    measured = np.where(np.isfinite(problem.sd.numpy()), problem.log_frf.numpy(), np.nan)
    curves = Curves(
        problem.frequency_hz.numpy()[first_record],
        floors,
        measured[:, first_record],
        _log_frf(problem, done.before),
        _log_frf(problem, done.after) if done.rounds else None,
    )
    story = GapStory(
        headline,
        scene,
        curves,
        [f"θ{k + 1}" for k in range(before.theta.shape[1])],
        before.theta,
        after.theta if done.rounds else None,
        None if held is None or held.time is None else held,
    )
    paths.append(save_figure(gap_story(story), study.path("pictures", "gap_before_after.png")))
    return tuple(paths)


def _log_frf(problem: Problem, fitted: Fit) -> Floats:
    theta, zeta, sizes = fitted.coordinates.split(fitted.z[None], problem.fixed_zeta)
    frequency = problem.frequency_hz[: problem.blocks[0].points]
    frf = fitted.system.frf(theta, zeta, sizes, frequency)[0, list(problem.rows)]
    return np.asarray(frf.abs().log().numpy())
