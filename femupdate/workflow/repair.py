"""repair: add what is missing to the model, and show the gap before and after."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.parameters import factor_titles
from femupdate.building.schema import Building
from femupdate.discrepancy.certify import missed_in_turn
from femupdate.discrepancy.diagnose import STANDS_IN
from femupdate.discrepancy.finder_model import FinderModel
from femupdate.discrepancy.fit import Fit
from femupdate.discrepancy.held_out import Held, KeptOut, hold
from femupdate.discrepancy.likelihood import likelihood_about, parameters_at
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.repair import Repair, mend
from femupdate.discrepancy.thresholds import VERDICT, DiagnosisSettings
from femupdate.inference.maxima import found_from
from femupdate.measurement.histories import Histories
from femupdate.progress import SILENT, Progress
from femupdate.report.scale import plus_minus
from femupdate.seeds import Seed
from femupdate.study import BUILDING_FILE, Study
from femupdate.tables import table
from femupdate.workflow.about_maxima import FROM_FIT, Target, sampled_about_maxima
from femupdate.workflow.calibrate_effects import with_fitted
from femupdate.workflow.calibrate_settings import Sampled
from femupdate.workflow.diagnose import finder_model, keep_found, search
from femupdate.workflow.finder_data import Given, read_given, read_held
from femupdate.workflow.model import StudyModel, on_kept_finer, open_study
from femupdate.workflow.observed import ObservationSource, direction_of
from femupdate.workflow.repaired import keep_repaired, keep_repaired_posterior, repaired_building
from femupdate.workflow.second_record import level_between


@dataclass(frozen=True, eq=False, kw_only=True)
class RepairReport:
    """What was added and what it did.

    Attributes:
        repair: before and after.
        problem: the data.
        building: the repaired building.
        study: the study of the repaired building; None where nothing was added.
        theta_before, theta_after: (n, p) draws of the stiffness factors.
        held: on data kept out, if any.
        in_turn: mean squared residual of each half of the data by a fit to the other, before and
            after; None where other data were kept out, NaN where the data have no halves.
        path: of the JSON file.
        seconds: all the time taken.
    """

    repair: Repair
    problem: Problem
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

    def as_dict(self) -> dict[str, Any]:
        """What the JSON file and `--json` hold."""
        done, held = self.repair, self.held
        halves = (None, None) if self.in_turn is None else map(_number, self.in_turn)
        return {
            "verdict": done.verdict,
            "sentence": done.last.sentence,
            "refused": [one.placed.label for one in done.refused],
            "rounds": [
                {
                    "effect": one.finding.placed.effect.name,
                    "place": one.finding.placed.place,
                    "size": one.finding.size,
                    "size_sd": one.finding.size_sd,
                    "log_evidence_over_none": one.finding.evidence.log_evidence,
                    "chi2_before": one.chi2_before,
                    "chi2_after": one.chi2_after,
                    "settled_by": one.finding.placed.effect.settled_by,
                }
                for one in done.rounds
            ],
            "chi2_before": done.before.chi2,
            "chi2_after": done.after.chi2,
            "independent_points": self.problem.effective,
            "remaining": {**done.left.as_dict(), "sentence": self._left},
            "theta_before": self.theta_before.mean(axis=0).tolist(),
            "theta_after": self.theta_after.mean(axis=0).tolist(),
            "theta_sd_before": self.theta_before.std(axis=0).tolist(),
            "theta_sd_after": self.theta_after.std(axis=0).tolist(),
            **{
                f"holdout_{key}_{when}": _number(getattr(held, f"{name}_{when}", None))
                for key, name in (("error", "error"), ("own_error", "own"), ("chi2", "chi2"))
                for when in ("before", "after")
            },
            **dict(zip(("halves_chi2_before", "halves_chi2_after"), halves, strict=True)),
            "building": None if self.building_path is None else str(self.building_path),
            "study": None if self.study is None else str(self.study.folder),
            "seconds": self.seconds,
        }

    def lines(self) -> tuple[str, ...]:
        """What was added, what it did to the model and to data kept out, for people."""
        done, held = self.repair, self.held
        lines = [self._round(number) for number in range(len(done.rounds))]
        if not done.rounds:
            lines.append(f"Nothing was added ({done.last.verdict}). {done.last.sentence}")
        else:
            lines.append(f"  what is left: {self._left}")
        if done.refused:
            names = "; ".join(one.in_words for one in done.refused)
            lines.append(f"  not added, for data kept out are predicted worse with it: {names}")
        titles = factor_titles(self.problem.reduced.structure.building).values()
        rows = [
            (title, *(plus_minus(own.mean(), own.std()) for own in both))
            for title, *both in zip(titles, self.theta_before.T, self.theta_after.T, strict=False)
        ]
        lines.append(table(("factor of", "before", "after"), rows))
        kept_out = self._in_turn() if held is None else held.lines()
        lines += [f"  {line}" for line in kept_out]
        if self.building_path is not None:
            lines.append(f"  repaired building {self.building_path}")
        return (*lines, f"  {self.path}")

    @property
    def _left(self) -> str:
        return self.repair.left.sentence or "No error of the model shows beside the noise."

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
        one, points = self.repair.rounds[number], self.problem.effective
        # What predicts data kept out better stands for itself, and what others complete.
        open_end = self.held is None and self.repair.left.size > 0.0
        doubt = f"\n  {STANDS_IN}" if open_end and one.stands_in(points) else ""
        return (
            f"{number + 1}. {one.finding.in_words}\n  residuals {one.chi2_before:.0f} -> "
            f"{one.chi2_after:.0f} over {points:.0f} independent points{doubt}\n"
            f"  without the model it is settled by {one.finding.placed.effect.settled_by}"
        )


def _number(value: float | None) -> float | None:
    """JSON knows no NaN."""
    return None if value is None or np.isnan(value) else value


def repair_study(
    study: Study,
    model: StudyModel,
    source: ObservationSource,
    holdout: ObservationSource | None = None,
    settings: DiagnosisSettings | None = None,
    progress: Progress = SILENT,
    use_phase: bool = True,
    second: ObservationSource | None = None,
) -> RepairReport:
    """Diagnose, add what the evidence carries, update, and compare.

    The repaired building becomes a study of its own, in the folder `repaired` of this one.

    Args:
        source: the data to explain.
        holdout: other data of the same building, to be predicted before and after.
        use_phase: compare phases where they were measured.
        second: another record at another level, to be explained together with the first.

    Raises:
        MeasurementError: an observation cannot be used.
    """
    started, settings = time.monotonic(), settings or DiagnosisSettings()
    given = read_given(study, model, source, second, progress)
    other = None if holdout is None else read_held(study, model, holdout, progress)
    finder, model = finder_model(study, model, progress), on_kept_finer(study, model)
    data = given.data(model, finder.mesh, use_phase)
    problem, base, found = search(finder, data, settings, progress)
    kept_out, elsewhere = None, None
    if holdout is not None and other is not None:
        kept_out = _kept_out(model, finder, holdout, other, use_phase, source if second else None)
        elsewhere = kept_out.gain
    mended, done = mend(finder, problem, base, found, settings, progress, elsewhere)
    before = _updated(problem, done.before, settings.seed, progress)
    after = _updated(mended, done.after, settings.seed, progress) if done.rounds else before
    held = None if kept_out is None else _held(kept_out, problem, done, progress)
    building, kept = model.building, None
    if done.rounds:
        building = repaired_building(building, done)
        kept = keep_repaired(study, model, building, mended.reduced, finder.mesh)
        own = with_fitted(open_study(kept), mended, done.after, finder.mesh)
        known = given.measured, source, after, settings.seed, problem.levels
        keep_repaired_posterior(kept, own, *known)
    report = RepairReport(
        repair=done,
        problem=problem,
        building=building,
        study=kept,
        theta_before=_factors(before),
        theta_after=_factors(after),
        held=held,
        in_turn=_in_turn(done) if held is None else None,
        path=study.path("repair.json"),
        seconds=time.monotonic() - started,
    )
    origin, content = {**model.made_from(), **source.made_from()}, report.as_dict()
    others = {"second": second, "holdout": holdout}
    keep_found(study, "repair", report.path, content, origin, source, **others)
    return report


def _updated(problem: Problem, fitted: Fit, seed: Seed, progress: Progress) -> Sampled:
    """Draws of the posterior of a fitted model; however few of them count, there are no others."""
    likelihood = likelihood_about(problem, fitted)
    maxima = found_from(likelihood.prior, likelihood.residuals, parameters_at(fitted))
    target = Target(likelihood, maxima, FROM_FIT, local=True)
    sampled = sampled_about_maxima(target, VERDICT.repair_draws, seed, progress)
    assert sampled is not None
    return sampled


def _factors(sampled: Sampled) -> Floats:
    """(n, p) draws of the stiffness factors."""
    return sampled.parameters.split(sampled.runs[0].theta).theta.numpy()


def _in_turn(done: Repair) -> tuple[float, float]:
    """How far each half of the data is missed by a fit to the other, before and after."""
    before = missed_in_turn(done.before)
    return before, missed_in_turn(done.after) if done.rounds else before


def _held(kept_out: KeptOut, problem: Problem, done: Repair, progress: Progress) -> Held:
    progress.start("Predicting the data kept out", 1)
    held = hold(kept_out, problem, done)
    progress.advance()
    return held


def _kept_out(
    model: StudyModel,
    finder: FinderModel,
    source: ObservationSource,
    held: Given,
    use_phase: bool,
    first: ObservationSource | None,
) -> KeptOut:
    """Data kept out, with their histories where they are histories under base motion.

    Args:
        first: of two records at their own levels, to place that of the data kept out by.
    """
    # The level of modes is taken to be the first's.
    level = 0.0 if first is None or held.measured.modes else level_between(model, first, source)
    read = None
    if held.measured.has_base:
        read = source.read_base_motion()
    return KeptOut(
        name=source.path.name,
        model=finder,
        data=held.data(model, finder.mesh, use_phase),
        floors=held.measured.as_observation.floors,
        level=level,
        histories=read if isinstance(read, Histories) else None,
        direction=direction_of(model.building),
    )
