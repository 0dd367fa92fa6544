"""repair: add what is missing to the model, and show the gap before and after."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.document import Building, factor_titles, without_effects
from femupdate.building.files import save_building
from femupdate.discrepancy.evidence import missed_in_turn
from femupdate.discrepancy.findings import STANDS_IN, Diagnosis
from femupdate.discrepancy.fit import Fit, likelihood_about, parameters_at
from femupdate.discrepancy.mesh_error import MeshError
from femupdate.discrepancy.repair import Held, KeptOut, Repair, hold, mend
from femupdate.discrepancy.search import FinderModel
from femupdate.discrepancy.thresholds import DiagnosisSettings
from femupdate.dynamics.reduced import ReducedStructure
from femupdate.effects.effect import DrawnBuilding
from femupdate.effects.registry import with_effect
from femupdate.effects.tolerances import tolerances_of
from femupdate.errors import MeasurementError
from femupdate.inference.frf_data import FrfData
from femupdate.inference.likelihood import Likelihood
from femupdate.inference.maxima import found_from
from femupdate.measurement.observation import Histories
from femupdate.progress import SILENT, Progress
from femupdate.report.curves import Curve
from femupdate.report.scale import plus_minus
from femupdate.result import Item, Note, Notes, Picture, Result, first_lines
from femupdate.seeds import Seed, spawn
from femupdate.study import BUILDING_FILE, REPAIRED, Study, typed
from femupdate.tables import Column, Table
from femupdate.units import percent
from femupdate.workflow.amplitude import level_between, level_settings
from femupdate.workflow.conclusion import concluded
from femupdate.workflow.diagnose import finder_model, keep_found, search
from femupdate.workflow.effects import MESH_ERROR_PART, finder_origin, keep_basis
from femupdate.workflow.kinds import Measured, measured_of, read_measured_of, with_rest
from femupdate.workflow.likelihoods import LEAST_EXPLAINED, CalibrationSettings, Sampled, data_of
from femupdate.workflow.model import (
    FINER_PART,
    CertifiedModel,
    StudyModel,
    finer_origin,
    keep_model,
    on_kept_finer,
    open_study,
)
from femupdate.workflow.observed import ObservationSource, direction_of
from femupdate.workflow.sampling import FROM_FIT, Target, sampled, with_fitted

WORSE_HISTORIES = (
    "With that event's own stiffness and damping, histories kept out are predicted worse than "
    "before: what was added may not serve histories."
)


@dataclass(frozen=True, eq=False, kw_only=True)
class RepairReport(Result):
    """What was added and what it did.

    Attributes:
        building: as repaired.
        study: of the repaired building; None where nothing was added.
        theta_before, theta_after: (n, p) draws of the stiffness factors.
        in_turn: mean squared residual of each half of the data by a fit to the other, before and
            after; None where other data were kept out, NaN where the data have no halves.
    """

    repair: Repair
    problem: Likelihood
    building: Building
    study: Study | None
    theta_before: Floats
    theta_after: Floats
    held: Held | None
    in_turn: tuple[float, float] | None
    path: Path
    seconds: float

    @property
    def building_path(self) -> Path | None:
        """File of the repaired building; None where nothing was added."""
        return None if self.study is None else self.study.path(BUILDING_FILE)

    def items(self) -> Iterator[Item]:
        """What was added, what it did to the model and to data kept out."""
        done, held, points = self.repair, self.held, self.problem.effective
        rounds = [
            {
                "effect": added.finding.placed.effect.name,
                "place": added.finding.placed.place,
                "in_words": added.finding.placed.in_words,
                "size": added.finding.size,
                "size_sd": added.finding.size_sd,
                "log_evidence_over_none": added.finding.log_evidence,
                "chi2_before": added.chi2_before,
                "chi2_after": added.chi2_after,
                "settled_by": added.finding.placed.effect.settled_by,
            }
            for added in done.rounds
        ]
        kept_out = self._in_turn() if held is None else held.lines()
        verdict = f"nothing was added ({done.last.verdict}). {done.last.sentence}"
        if rounds:
            verdict = f"repaired. {'; '.join(step.finding.in_words for step in done.rounds)}."
        squares = f"{done.before.chi2:.0f} -> {done.after.chi2:.0f} over {points:.0f} points"
        path, folder = self.building_path, None if self.study is None else self.study.folder
        yield from first_lines(
            f"Verdict: {verdict}",
            f"Residuals: {'; '.join((squares, *kept_out[:1]))}. {self._left}",
            f"`{typed('report', path or self.path)}` writes the page",
        )
        # What predicts data kept out better stands for itself, and what others complete.
        if held is None and done.left.size > 0.0 and any(s.stands_in(points) for s in done.rounds):
            yield Notes((STANDS_IN,))
        own = (0.0, 0.0) if held is None else held.figures.get("own_error", (0.0, 0.0))
        if rounds and own[1] > own[0]:
            yield Notes((WORSE_HISTORIES,))
        yield Note(content={"verdict": done.verdict, "sentence": done.last.sentence})
        yield from (Note(self._round(number), detail=True) for number in range(len(rounds)))
        left = {"rounds": rounds, "remaining": {**done.left.as_dict(), "sentence": self._left}}
        yield Note(f"  what is left: {self._left}", left, detail=True)
        told = ""
        if done.refused:
            names = "; ".join(added.in_words for added in done.refused)
            told = f"  not added, for data kept out are predicted worse with it: {names}"
        yield Note(told, {"refused": [added.placed.label for added in done.refused]})
        yield self._factors()
        yield Note("\n".join(f"  {line}" for line in kept_out), self._kept_out(), detail=True)
        told = "" if path is None else f"  repaired building {path}"
        yield Note(told, {"building": path, "study": folder}, detail=True, page=False)
        figures = {"seconds": self.seconds, "independent_points": points}
        yield Note(f"  {self.path}", figures, detail=True, page=False)

    def _kept_out(self) -> dict[str, Any]:
        """How both models meet the data, and data kept out, for JSON."""
        halves = self.in_turn or (None, None)
        figures = {} if self.held is None else self.held.figures
        held = {
            f"holdout_{key}_{when}": figures.get(key, (None, None))[number]
            for key in ("error", "own_error", "chi2")
            for number, when in enumerate(("before", "after"))
        }
        squares = {"chi2_before": self.repair.before.chi2, "chi2_after": self.repair.after.chi2}
        return {**squares, **held, "halves_chi2_before": halves[0], "halves_chi2_after": halves[1]}

    def _factors(self) -> Table:
        """Stiffness factors before and after."""
        both = {"before": self.theta_before, "after": self.theta_after}
        titles = factor_titles(self.problem.reduced.structure.building).values()
        count = self.theta_before.shape[1]
        columns = [Column(list(titles)[:count], "factor of")]
        for when, draws in both.items():
            cells = [plus_minus(values.mean(), values.std()) for values in draws.T]
            columns += [
                Column(draws.mean(axis=0), when, cells[:count], key=f"theta_{when}"),
                Column(draws.std(axis=0), key=f"theta_sd_{when}"),
            ]
        caption = "Stiffness factors before and after the repair"
        return Table(name="factors", columns=tuple(columns), caption=caption, detail=True)

    def figures(self) -> Iterator[Picture]:
        """Maps of residuals before and after, and the picture that tells the whole story."""
        from femupdate.report.plot_diagnosis import (
            ResidualMap,
            gap_story,
            repair_headline,
            residual_pictures,
        )

        done = self.repair
        added = [step.finding.placed for step in done.rounds]
        cells = {"Before": done.before.cells()}
        if added:
            cells["After"] = done.after.cells()
        yield from residual_pictures("gap_residuals", cells, repair_headline(added))
        yield Picture(
            "gap_before_after",
            lambda: gap_story(
                [ResidualMap.of(cell, cells["Before"][0].data) for cell in cells.values()],
                DrawnBuilding(self.problem.reduced.structure),
                added,
                self._curves(),
                tuple(factor_titles(self.building).values()),
                [self.theta_before, self.theta_after][: len(cells)],
                self.held,
            ),
        )

    def _curves(self) -> tuple[Curve, ...]:
        """The first record's FRFs, the top floor first, measured and as the models give them."""
        done = self.repair
        data = next((kind for kind in self.problem.data if isinstance(kind, FrfData)), None)
        if data is None:
            return ()
        first = slice(data.blocks[0].points)
        measured = np.where(data.valid.numpy(), data.log_frf.numpy(), np.nan)[:, first]
        fits = [done.before, done.after] if done.rounds else [done.before]
        told = [data.drawn(fitted.system, *fitted.split).abs().log().numpy() for fitted in fits]
        return tuple(
            Curve(
                title=name,
                across="frequency, Hz",
                up=f"{name}, ln|H|",
                x=data.frequency_hz.numpy()[first],
                mean=told[0][row],
                measured=measured[row],
                beside=told[1][row] if done.rounds else None,
            )
            for row, name in reversed(list(enumerate(data.names)))
        )

    @property
    def _left(self) -> str:
        return self.repair.left.sentence or "What was fitted shows no error of the model."

    def _in_turn(self) -> tuple[str, ...]:
        """What the data say of both models where no others were kept out."""
        if not self.repair.rounds or self.in_turn is None:
            return ()
        before, after = self.in_turn
        if np.isnan(before):
            return ("No part of the data could be kept out: test this with another, --holdout.",)
        return (
            f"each half of the data, kept out in turn: error (chi2 a point) {before:.1f} -> "
            f"{after:.1f}; another measurement tests more, --holdout",
        )

    def _round(self, number: int) -> str:
        """What one round added, and what tells on site whether it is there."""
        step, points = self.repair.rounds[number], self.problem.effective
        return (
            f"{number + 1}. {step.finding.in_words}\n  residuals {step.chi2_before:.0f} -> "
            f"{step.chi2_after:.0f} over {points:.0f} independent points\n"
            f"  without the model it is settled by {step.finding.placed.effect.settled_by}"
        )


def repair_study(
    study: Study,
    model: StudyModel,
    source: ObservationSource,
    holdout: ObservationSource | None = None,
    settings: DiagnosisSettings | None = None,
    progress: Progress = SILENT,
) -> RepairReport:
    """Diagnose, add what the evidence carries, update, and compare.

    The repaired building becomes a study of its own, in the folder `repaired` of this one.

    Args:
        holdout: other data of the same building, to be predicted before and after.

    Raises:
        MeasurementError: an observation cannot be used.
    """
    started, settings = time.monotonic(), settings or DiagnosisSettings()
    if holdout and {*source.made_from().values()} & {*holdout.made_from().values()}:
        raise MeasurementError(
            f"{holdout.path} is fitted, so it proves nothing; keep another measurement out"
        )
    given, other = read_measured_of(study, model, source, progress, apart=True), None
    if holdout is not None:
        other = with_rest(study, model, measured_of(model.building, holdout), progress)
    finder, model = finder_model(study, model, progress), on_kept_finer(study, model)
    data = data_of(given, model.system)
    problem, found = search(finder, data, settings, progress, given.run)
    kept_out = None
    if holdout is not None and other is not None:
        kept_out = _kept_out(model, finder, holdout, other, source if any(given.levels) else None)
        _check_explained(kept_out, problem, found, source)
    elsewhere = None if kept_out is None else kept_out.gain
    mended, done = mend(finder, problem, found, settings, progress, elsewhere)
    before = _updated(done.before, settings.seed, progress)
    after = _updated(done.after, settings.seed, progress) if done.rounds else before
    held, in_turn = None, None
    if kept_out is not None:
        progress.start("Predicting the data kept out", 1)
        held = hold(kept_out, problem, done)
        progress.advance()
    else:
        missed = missed_in_turn(done.before)
        in_turn = missed, missed_in_turn(done.after) if done.rounds else missed
    building, kept = model.building, None
    if done.rounds:
        building = repaired_building(building, done)
        kept = _kept(study, model, building, mended.reduced, finder.mesh)
        repaired = with_fitted(open_study(kept), mended, done.after, finder.mesh)
        # The posterior of the study, with all that was added as it was fitted.
        drawing, count = spawn(settings.seed, 4), len(after.theta)
        how = CalibrationSettings(particles=count, exact=True, chains=1, anyway=True)
        told = concluded(
            repaired, given, how, after, drawing, kept.result("posterior.nc")
        ).with_settings(level_settings(repaired, repaired.system.placed, source, problem.levels))
        told.keep(kept, "repair", source, source.files_as_settings())
    theta = [draws.parameters.split(draws.theta).theta.numpy() for draws in (before, after)]
    report = RepairReport(
        repair=done,
        problem=problem,
        building=building,
        study=kept,
        theta_before=theta[0],
        theta_after=theta[1],
        held=held,
        in_turn=in_turn,
        path=study.path("repair.json"),
        seconds=time.monotonic() - started,
    )
    origin = {**model.made_from(), **source.made_from()}
    keep_found(study, "repair", report.path, report, origin, source, holdout)
    return report


def _updated(fitted: Fit, seed: Seed, progress: Progress) -> Sampled:
    """Draws of the posterior of a fitted model."""
    likelihood = likelihood_about(fitted)
    maxima = found_from(likelihood.prior, likelihood.residuals, parameters_at(fitted))
    target = Target(likelihood, maxima, FROM_FIT, local=True)
    return sampled(target, CalibrationSettings(particles=1000), seed, progress)


def _kept_out(
    model: StudyModel,
    finder: FinderModel,
    source: ObservationSource,
    held: Measured,
    first: ObservationSource | None,
) -> KeptOut:
    """Data kept out, at their level above the first of records at several, where it is given."""
    # The level of modes is taken to be the first's.
    level = 0.0 if first is None or held.modes else level_between(model, first, source)
    read = source.read_base_motion() if held.has_base else None
    return KeptOut(
        name=source.path.name,
        model=finder,
        data=data_of(held, model.system),
        floors=held.as_observation.floors,
        level=level,
        histories=read if isinstance(read, Histories) else None,
        direction=direction_of(model.building),
    )


def _check_explained(
    kept_out: KeptOut, problem: Likelihood, found: Diagnosis, source: ObservationSource
) -> None:
    """Make sure that data kept out may be another event of what was diagnosed.

    Raises:
        MeasurementError: no candidate explains them as one.
    """
    fits = [found.base, *(finding.fitted for finding in found.findings)]
    best = kept_out.explained(problem, fits)
    if best is not None and not best >= LEAST_EXPLAINED:  # which no number is not
        raise MeasurementError(
            f"{kept_out.name}, kept out, is unlike another event of {problem.building.name} as "
            f"{source.path.name} shows it: the best response has {percent(max(best, 0.0))} of its "
            "variation over frequency; keep out a file of the same building in the same state"
        )


def repaired_building(building: Building, done: Repair) -> Building:
    """The building with all effects of the last fit at their fitted values."""
    repaired = without_effects(building)
    varying = tolerances_of(building)
    for number, placed in enumerate(done.after.placed):
        if placed not in varying:  # the file states them still
            repaired = with_effect(repaired, placed, done.after.known_of(number))
    names = "; ".join(added.finding.placed.in_words for added in done.rounds)
    text = f"{building.description.rstrip()}\nRepaired: {names}.".strip()
    return repaired.model_copy(update={"description": text})


def _kept(
    study: Study,
    model: StudyModel,
    building: Building,
    reduced: ReducedStructure,
    mesh: MeshError | None,
) -> Study:
    """A study of the repaired building in a study's folder, with all that the fit was made on."""
    kept = Study(study.path(REPAIRED))
    kept.folder.mkdir(parents=True, exist_ok=True)
    save_building(building, kept.path(BUILDING_FILE))
    keep_model(kept, building, CertifiedModel(model.reduced, model.reduction_error))
    if reduced.structure.operators is not None:
        keep_basis(kept, reduced, building)
    if mesh is not None:
        kept.keep(MESH_ERROR_PART, finder_origin(building), mesh)
    if model.finer is not None:
        kept.keep(FINER_PART, finer_origin(building), model.finer)
    return kept
