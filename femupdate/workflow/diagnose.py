"""diagnose: where model and measurement disagree, and what the model may lack."""

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor

from femupdate.discrepancy.data import Data
from femupdate.discrepancy.diagnose import AMBIGUOUS, PARTLY, UNKNOWN, Diagnosis, Finding
from femupdate.discrepancy.diagnose import diagnose as find
from femupdate.discrepancy.exchange import promising
from femupdate.discrepancy.fit import (
    Fit,
    about,
    extended,
    fit,
    fit_baseline,
    log_posterior,
    settle,
)
from femupdate.discrepancy.global_search import global_fit
from femupdate.discrepancy.mesh_error import MeshError, corrected
from femupdate.discrepancy.mesh_scatter import with_mesh_error
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.score import candidates
from femupdate.discrepancy.screen import screen_channels
from femupdate.discrepancy.thresholds import FIT, VERDICT, DiagnosisSettings
from femupdate.dynamics.local_basis import SPREAD, Sized
from femupdate.dynamics.reduced_terms import ReducedStructure
from femupdate.effects.effect import Placed
from femupdate.effects.structure import Structure
from femupdate.measurement.observation import Observation
from femupdate.progress import Progress, Silent
from femupdate.study import Study, write_text
from femupdate.tables import table
from femupdate.workflow.effects import (
    BuildingEffects,
    building_effects,
    check_places,
    check_sizes,
    finder_structure,
    plain_structure,
    problem_of,
)
from femupdate.workflow.finder_data import read_given, with_rest_about
from femupdate.workflow.kinds import Measured
from femupdate.workflow.mesh_error import open_mesh_error, with_finer_mesh
from femupdate.workflow.model import StudyModel
from femupdate.workflow.near_basis import structure_near
from femupdate.workflow.observed import ObservationSource

DIAGNOSIS = "diagnosis"
_SHOWN = 6  # rows of the table of effects


@dataclass(frozen=True, eq=False, kw_only=True)
class DiagnosisReport:
    """A diagnosis and what was made of it.

    Attributes:
        diagnosis: the finding.
        problem: what it was found from.
        reduced: the structure with its basis.
        observation: the data.
        screen: what the channels themselves say, in sentences.
        settings: of the diagnosis.
        path: of the JSON file.
        seconds: all the time taken.
    """

    diagnosis: Diagnosis
    problem: Problem
    reduced: ReducedStructure
    observation: Observation
    screen: tuple[str, ...]
    settings: DiagnosisSettings
    path: Path
    seconds: float

    @property
    def would_decide(self) -> tuple[str, ...]:
        """Sentences on what would tell the first effect from others, where the data do not."""
        return self.diagnosis.would_decide(self.settings)

    def as_dict(self) -> dict[str, Any]:
        """What the JSON file and `--json` hold."""
        found = self.diagnosis
        return {
            "verdict": found.verdict,
            "sentence": found.sentence,
            "effects": [
                {**_finding(one), "probability": share}
                for one, share in zip(found.findings, found.shares, strict=True)
            ],
            "remaining": found.left.as_dict(),
            "cannot_be_seen": list(found.unobservable),
            "cannot_be_told_from_the_first": list(found.twins),
            "would_decide": list(self.would_decide),
            "where": [
                {
                    "floor": cell.floor,
                    "band_hz": list(cell.band_hz),
                    "excess": cell.excess,
                    "data": cell.data,
                }
                for cell in found.residuals
                if cell.p_value < 1e-3
            ],
            "chi2": found.base.chi2,
            "independent_points": self.problem.effective,
            "p_value": found.p_value,
            "theta": found.base.theta()[0].tolist(),
            "screen": list(self.screen),
            "seconds": self.seconds,
        }

    def lines(self) -> tuple[str, ...]:
        """The verdict, the leading effects in a table, and notes, for people."""
        found, points = self.diagnosis, self.problem.effective
        lines = [
            f"Verdict: {found.verdict}. {found.sentence}",
            f"  residuals {found.base.chi2:.0f} over {points:.0f} independent points "
            f"by the noise alone; {self.seconds:.1f} s",
        ]
        if found.findings:
            head = ("effect", "log evidence", "on other data", "size", "absorbed by theta")
            lines.append(table(head, [_row(one) for one in found.findings[:_SHOWN]]))
        if found.unobservable:
            lines.append(f"  cannot be seen with these sensors: {', '.join(found.unobservable)}")
        notes = (f"  - {note}" for note in (*self.would_decide, *self.screen))
        return (*lines, *notes, f"  {self.path}")


def diagnose_study(
    study: Study,
    model: StudyModel,
    source: ObservationSource,
    settings: DiagnosisSettings | None = None,
    progress: Progress | None = None,
    use_phase: bool = True,
    second: ObservationSource | None = None,
) -> DiagnosisReport:
    """Find where the study's model fails and rank what it may lack; changes nothing in it.

    Args:
        study: where the JSON file goes.
        model: of the study.
        source: the data.
        settings: of the diagnosis.
        progress: told about the steps.
        use_phase: compare phases where they were measured.
        second: another record at another level, to be explained together with the first.

    Raises:
        MeasurementError: the observation cannot be used.
        BuildingError: an effect of the building's file cannot be.
    """
    show, started = progress or Silent(), time.monotonic()
    chosen = settings or DiagnosisSettings()
    given = read_given(study, model, source, second, show)
    parts = model_parts(study, model, show)
    data = given.data(model, parts.mesh, use_phase)
    problem, base = prepared(model, parts, data, chosen, show)
    show.start("Looking for what is missing", 4)
    problem, base, found = sought(model, parts, problem, base, chosen, show)
    report = DiagnosisReport(
        diagnosis=found,
        problem=problem,
        reduced=problem.reduced,
        observation=given.measured.as_observation,
        screen=(*given.notes, *_parted(data), *_screen(given.measured, found)),
        settings=chosen,
        path=study.path("diagnosis.json"),
        seconds=time.monotonic() - started,
    )
    write_text(report.path, json.dumps(report.as_dict(), indent=2, default=float) + "\n")
    origin = {**model.made_from(), **source.made_from()}
    study.record(DIAGNOSIS, "diagnosis.json", "diagnose", origin, source.files_as_settings())
    return report


def _parted(data: Sequence[Data]) -> tuple[str, ...]:
    """Whether names can be tested on data to which they were not fitted."""
    if len(data) > 1 or data[0].halves:
        return ()
    if data[0].name == "modes":
        return (
            "One table of modes cannot be parted in two, so that a name rests on its evidence"
            " alone; a second test would let each test what the other says.",
        )
    return ()


@dataclass(frozen=True, eq=False)
class ModelParts:
    """What of a study's model serves every observation of its building.

    Attributes:
        plain: the structure on the study's own basis, which knows the story factors alone.
        structure: the full model in which effects act.
        mesh: error of its mesh where it is a frame's, or None.
        study: keeps the basis near a fit; None keeps none.
    """

    plain: ReducedStructure
    structure: Structure
    mesh: MeshError | None = None
    study: Study | None = None


def model_parts(study: Study, model: StudyModel, progress: Progress | None = None) -> ModelParts:
    """Open what serves every observation; the error of a mesh is learned when first needed."""
    model = with_finer_mesh(study, model, progress)
    plain = plain_structure(model)
    if plain.structure.operators is None:
        return ModelParts(plain, plain.structure)
    structure = finder_structure(model.building)
    mesh = open_mesh_error(study, model, structure, progress)
    return ModelParts(plain, structure, mesh, study)


def prepared(
    model: StudyModel,
    parts: ModelParts,
    data: Sequence[Data],
    settings: DiagnosisSettings | None = None,
    progress: Progress | None = None,
) -> tuple[Problem, Fit]:
    """The problem with its mesh error, and the model as it is fitted to it.

    The stiffness factors of a frame are found on the study's own basis; then it gets one that
    serves near them and lets effects act.
    """
    show = progress or Silent()
    seed = settings.seed if settings is not None else 0
    effects = building_effects(model.building)
    plain = parts.plain
    check_places(plain.structure, effects)
    show.start("Fitting the model as it is", 1)
    problem = problem_of(plain, model.building, data)
    if plain.structure.operators is None:
        check_sizes(model.building, problem.system(effects.placed), effects.values)
        base = fit_baseline(problem, effects.placed, effects.values, seed)[0]
        show.advance()
        return problem, base
    problem = replace(problem, search=plain.first(FIT.rough_shapes))
    rough = fit_baseline(problem.for_search(), seed=seed)[0]
    middle = _rightly_named(problem, rough, seed)
    show.advance()
    # An exchange that is not in the building's file is for the finder to name.
    listed = set(middle.placed) <= set(effects.placed)
    known = middle if listed else rough
    start = extended(problem, known, effects.placed, np.array(effects.values))
    problem, base = _around(parts, model, problem, middle, (effects.placed, start), show)
    if not effects.placed:
        return problem, base
    check_sizes(model.building, problem.system(effects.placed), effects.values)
    return _as_listed(model, parts, problem, base, effects, show, seed)


def _as_listed(
    model: StudyModel,
    parts: ModelParts,
    problem: Problem,
    base: Fit,
    effects: BuildingEffects,
    show: Progress,
    seed: int,
) -> tuple[Problem, Fit]:
    """Theta where it lies with the listed effects, as large as the file says.

    The search without them may have ended far from there.
    """
    tried = fit_baseline(
        problem, effects.placed, effects.values, seed, FIT.listed_draws, FIT.listed_starts
    )[0]
    if log_posterior(problem, tried) < log_posterior(problem, base) + VERDICT.clearly:
        return problem, base
    return refined(model, parts, problem, tried, show)


def sought(
    model: StudyModel,
    parts: ModelParts,
    problem: Problem,
    base: Fit,
    settings: DiagnosisSettings | None = None,
    progress: Progress | None = None,
) -> tuple[Problem, Fit, Diagnosis]:
    """What a model lacks; far from its most probable theta, too, where nothing near it explains
    the data, or it takes two effects, or several do about equally well.

    Args:
        model: of the study.
        parts: of the model.
        problem: structure and data.
        base: the model as it is, fitted.
        settings: of the diagnosis.
        progress: told about the steps.

    Returns:
        Problem, base and diagnosis; the first two anew where something was found far off.
    """
    show, chosen = progress or Silent(), settings or DiagnosisSettings()

    first = find(problem, chosen, base, show)
    near = _run_off(model, parts, problem, base, first, chosen, show)
    if near[2].verdict not in (UNKNOWN, AMBIGUOUS, PARTLY):
        return near
    show.advance(note="searching far from the model as it is")
    leading = [one.placed for one in first.findings]
    far = global_fit(problem, base, first.scores, leading, chosen.seed)
    if far is None:
        return near
    there, far = refined(model, parts, problem, far, show)
    moved = fit(there, base.placed, base.z)
    again = find(there, chosen, moved, show, far)
    if again.verdict == UNKNOWN or _best(again) < _best(near[2]) + VERDICT.clearly:
        return near
    return _run_off(model, parts, there, moved, again, chosen, show)


def _run_off(
    model: StudyModel,
    parts: ModelParts,
    problem: Problem,
    base: Fit,
    found: Diagnosis,
    settings: DiagnosisSettings,
    show: Progress,
) -> tuple[Problem, Fit, Diagnosis]:
    """Of a frame's leading effects that are close, each on a basis that serves them alone.

    What one basis for all effects leaves of each is a few hundredths of ln|H|, and not of all the
    same.
    """
    close = found.close
    if problem.reduced.structure.operators is None or len(close) < 2:
        return problem, base, found

    sets = [_sized(one.fitted) for one in close]
    problem, first = _around(
        parts, model, problem, close[0].fitted, (base.placed, base.z), show, sets
    )
    labels = frozenset(one.placed.label for one in close)
    again = find(problem, settings, first, show, close[0].fitted, among=labels)
    others = (one for one in found.findings if one.placed.label not in labels)
    # What all effects show is told by the basis that serves them all.
    told = replace(
        again,
        findings=(*again.findings, *others),
        scores=found.scores,
        unobservable=found.unobservable,
    )
    return problem, first, told


def _best(found: Diagnosis) -> float:
    """Log density of the data by the best of the fits."""
    fits = [found.base, *(one.fitted for one in found.findings)]
    return max(log_posterior(one.problem, one) for one in fits)


def _rightly_named(problem: Problem, rough: Fit, seed: int) -> Fit:
    """A rough fit, or that with the channels exchanged which explains far more.

    Under a wrong name theta is drawn to where nothing found in its neighbourhood would be right.
    """
    searched = problem.for_search()
    exchanges = [one for one in candidates(searched) if one.exchange]
    found = promising(problem, rough, exchanges, seed)
    if not found or found[0].share > VERDICT.obvious:
        return rough
    return fit(searched, (found[0].placed,), found[0].z, 25)


def refined(
    model: StudyModel,
    parts: ModelParts,
    problem: Problem,
    fitted: Fit,
    progress: Progress | None = None,
    *,
    alone: bool = False,
) -> tuple[Problem, Fit]:
    """The problem around a fit with effects, whose theta may be far from the first one's.

    Where theta leaves the neighbourhood that the new basis serves, it is followed.

    Args:
        model: of the study.
        parts: of the model.
        problem: as the effects were found.
        fitted: with the effects.
        progress: told about the steps.
        alone: no other effects need act in it; then it serves these better, and costs a third.
    """
    if problem.reduced.structure.operators is None:
        return problem, fitted
    show = progress or Silent()
    for _ in range(FIT.most_bases):
        middle = fitted
        start = (fitted.placed, fitted.z)
        sets = [_sized(middle)] if alone else None
        problem, fitted = _around(parts, model, problem, middle, start, show, sets)
        if np.abs(np.log(fitted.theta()[0] / middle.theta()[0])).max() < SPREAD:
            break
    return problem, fitted


def _around(
    parts: ModelParts,
    model: StudyModel,
    problem: Problem,
    middle: Fit,
    start: tuple[tuple[Placed, ...], Tensor],
    show: Progress,
    present: Sequence[Sized] | None = None,
) -> tuple[Problem, Fit]:
    """A frame's problem on a basis about a fit, with its mesh error there, and a fit from there."""
    theta, zeta = middle.theta()[0], middle.zeta(problem.fixed_zeta)
    near = structure_near(parts.structure, model.building, theta, zeta, show, present, parts.study)
    data = with_rest_about(problem.data, parts.structure, near.model, theta)
    if parts.mesh is not None:
        near = corrected(near, parts.mesh)
    problem = replace(problem, reduced=near, data=data)
    if parts.mesh is not None:
        problem = with_mesh_error(problem, parts.mesh)
    # Where the fit was, the errors of the mesh are as straight lines have them.
    begun = fit(problem.at_row(problem.error.start), *start)
    problem = about(problem, begun)
    fitted = settle(problem, begun)
    return fitted.problem, fitted


def _sized(fitted: Fit) -> Sized:
    """The effects of a fit, each with its first parameter."""
    values, found, first = fitted.sizes()[0], [], 0
    for placed in fitted.placed:
        count = len(placed.effect.parameters)
        found.append((placed, float(values[first]) if count else 1.0))
        first += count
    return tuple(found)


def _screen(measured: Measured, found: Diagnosis) -> tuple[str, ...]:
    if not measured.has_base:
        return ()
    return screen_channels(measured.base, found.base.system, found.base.theta()[0])


def _row(one: Finding) -> tuple[str, ...]:
    """What the table says of an effect."""
    error = f" ± {one.evidence.error:.2g}" if one.evidence.effective else ""
    return (
        one.placed.label,
        f"{one.evidence.log_evidence:.1f}{error}",
        _on_other_data(one),
        f"{one.size:.4g} ± {one.size_sd:.2g}",
        f"{one.score.absorbed:.0%}",
    )


def _on_other_data(one: Finding) -> str:
    """What the halves of the data say of an effect that was fitted to the other."""
    if one.tested is None:
        return "-"
    return f"{one.tested.log_e_value:.1f} ({'holds' if one.tested.certified else 'too little'})"


def _finding(one: Finding) -> dict[str, Any]:
    effect = one.placed.effect
    return {
        "name": effect.name,
        "place": one.placed.place,
        "log_evidence_on_other_data": None if one.tested is None else one.tested.log_e_value,
        "certified": None if one.tested is None else one.tested.certified,
        "changes_of_frequency": one.changes.frequency,
        "changes_of_response": one.changes.response,
        "log_evidence_over_none": one.evidence.log_evidence,
        "size": one.size,
        "size_sd": one.size_sd,
        "unit": effect.parameters[0].unit if effect.parameters else "",
        "absorbed_by_theta": one.score.absorbed,
        "explains": effect.sentence,
    }


__all__ = [
    "DIAGNOSIS",
    "DiagnosisReport",
    "ModelParts",
    "diagnose_study",
    "model_parts",
    "prepared",
    "refined",
    "sought",
]
