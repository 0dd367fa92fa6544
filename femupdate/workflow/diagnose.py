"""diagnose: where model and measurement disagree, and what the model may lack."""

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import torch

from femupdate.discrepancy.diagnose import PARTLY, Diagnosis, Finding
from femupdate.discrepancy.finder_model import FinderModel, finder_structure, plain_structure
from femupdate.discrepancy.fit import Fit
from femupdate.discrepancy.pairs import with_pair
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.screen import screen_channels
from femupdate.discrepancy.search import prepared, sought
from femupdate.discrepancy.thresholds import VERDICT, DiagnosisSettings
from femupdate.dynamics.reduced_terms import ReducedStructure
from femupdate.effects.registry import CATALOGUE
from femupdate.inference.data import Data
from femupdate.inference.frf_data import FrfData
from femupdate.measurement.observation import Observation
from femupdate.progress import SILENT, Progress
from femupdate.report.scale import with_unit
from femupdate.study import Study, write_text
from femupdate.tables import first_notes, table
from femupdate.units import percent
from femupdate.workflow.effects import finder_basis
from femupdate.workflow.finder_data import read_given
from femupdate.workflow.kinds import Measured
from femupdate.workflow.mesh_error import open_mesh_error, with_finer_mesh
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import ObservationSource

_SHOWN = 6  # rows of the table of effects


@dataclass(frozen=True, eq=False, kw_only=True)
class DiagnosisReport:
    """A diagnosis and what was made of it.

    Attributes:
        diagnosis: the finding.
        problem: what it was found from.
        reduced: the structure with its basis.
        observation: the data.
        limits: factors that end at a limit of their prior, in a sentence.
        screen: what else is to be said of the data and their channels, in sentences.
        settings: of the diagnosis.
        path: of the JSON file.
        seconds: all the time taken.
    """

    diagnosis: Diagnosis
    problem: Problem
    reduced: ReducedStructure
    observation: Observation
    limits: tuple[str, ...]
    screen: tuple[str, ...]
    settings: DiagnosisSettings
    path: Path
    seconds: float

    @property
    def would_decide(self) -> tuple[str, ...]:
        """Sentences on what would tell the first effect from others, where the data do not."""
        return self.diagnosis.would_decide(self.settings)

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know, the decisive first."""
        return (*self.limits, *self.would_decide, *self.screen)

    def as_dict(self) -> dict[str, Any]:
        """What the JSON file and `--json` hold."""
        found = self.diagnosis
        return {
            "verdict": found.verdict,
            "sentence": found.sentence,
            "effects": [_finding(one) for one in found.findings],
            "together": [
                {"name": one.placed.effect.name, "place": one.placed.place}
                | {"size": one.size, "size_sd": one.size_sd}
                for one in found.pair
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
            "screen": [*self.limits, *self.screen],
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
        lines += first_notes(self.notes, f"{self.path.name} in the study")
        return (*lines, f"  {self.path}")


def diagnose_study(
    study: Study,
    model: StudyModel,
    source: ObservationSource,
    settings: DiagnosisSettings | None = None,
    progress: Progress = SILENT,
    use_phase: bool = True,
    second: ObservationSource | None = None,
) -> DiagnosisReport:
    """Find where the study's model fails and rank what it may lack; changes nothing in it.

    Args:
        study: where the JSON file goes.
        use_phase: compare phases where they were measured.
        second: another record at another level, to be explained together with the first.

    Raises:
        MeasurementError: the observation cannot be used.
        BuildingError: an effect of the building's file cannot be.
    """
    started = time.monotonic()
    chosen = settings or DiagnosisSettings()
    source, second = source.opened(), None if second is None else second.opened()
    given = read_given(study, model, source, second, progress)
    finder = finder_model(study, model, progress)
    data = given.data(model, finder.mesh, use_phase)
    problem, _, found = search(finder, data, chosen, progress)
    report = DiagnosisReport(
        diagnosis=found,
        problem=problem,
        reduced=problem.reduced,
        observation=given.measured.as_observation,
        limits=_at_limits(model, found.base),
        screen=(
            *given.notes,
            *_parted(data),
            *_turns(data),
            *_screen(given.measured, found),
            *_looks_on(found),
        ),
        settings=chosen,
        path=study.path("diagnosis.json"),
        seconds=time.monotonic() - started,
    )
    origin = {**model.made_from(), **source.made_from()}
    keep_found(study, "diagnose", report.path, report.as_dict(), origin, source, second=second)
    return report


def search(
    finder: FinderModel, data: Sequence[Data], settings: DiagnosisSettings, progress: Progress
) -> tuple[Problem, Fit, Diagnosis]:
    """Fit the model as it is, and look for what it lacks."""
    problem, base = prepared(finder, data, settings, progress)
    progress.start("Looking for what is missing", 4)
    problem, base, found = sought(finder, problem, base, settings, progress)
    return problem, base, with_pair(found, settings, progress)


def keep_found(
    study: Study,
    command: str,
    path: Path,
    content: dict[str, Any],
    made_from: Mapping[str, str],
    source: ObservationSource,
    **others: ObservationSource | None,
) -> None:
    """Write what was found as JSON and record it, with the files that options name beside."""
    write_text(path, json.dumps(content, indent=2, default=float) + "\n")
    given = {option: one for option, one in others.items() if one is not None}
    hashes = {option: one.made_from()["observation"] for option, one in given.items()}
    beside = {option: str(one.path) for option, one in given.items()}
    files = {**source.files_as_settings(), **beside}
    study.record(path.stem, path.name, command, {**made_from, **hashes}, files)


def _at_limits(model: StudyModel, base: Fit) -> tuple[str, ...]:
    """Factors of the model as it is that end at a limit of their prior."""
    where, count = base.coordinates, base.coordinates.stories
    room = torch.minimum(base.z - where.lower, where.upper - base.z)[:count]
    ended = (room < VERDICT.at_limit).nonzero()[:, 0].tolist()
    names = ", ".join(f"{model.prior.names[k]} ({base.theta()[0][k]:.3g})" for k in ended)
    if not names:
        return ()
    return (
        f"Without effects {names} end{'s' if len(ended) == 1 else ''} at the prior's limit: widen "
        "the prior first, or what is named may only make up for it.",
    )


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


def _turns(data: Sequence[Data]) -> tuple[str, ...]:
    """What is not looked for where it was measured how the base turns."""
    if not any(isinstance(one, FrfData) and one.turns for one in data):
        return ()
    names = " and ".join(effect.name for effect in CATALOGUE.values() if effect.turns_base)
    return (f"The base's rotation was measured and is an input, so {names} are not looked for.",)


def finder_model(study: Study, model: StudyModel, progress: Progress = SILENT) -> FinderModel:
    """Open what serves every observation; the error of a mesh is learned when first needed."""
    model = with_finer_mesh(study, model, progress)
    building, plain = model.building, plain_structure(model.building, model.reduced)
    if plain.structure.operators is None:
        return FinderModel(building, plain, plain.structure)
    structure = finder_structure(building)
    mesh = open_mesh_error(study, model, structure, progress)
    return FinderModel(building, plain, structure, mesh, partial(finder_basis, study, building))


def _looks_on(found: Diagnosis) -> tuple[str, ...]:
    """What looks for the rest, where one effect explains a part."""
    if found.verdict != PARTLY or found.pair:
        return ()
    return ("The effect explains only a part: `repair` adds it and looks for what is beside it.",)


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
        shown_size(one),
        percent(one.score.absorbed),
    )


def shown_size(one: Finding) -> str:
    """Size of an effect with its spread and unit; nothing of one that is there or not."""
    first = next(iter(one.placed.effect.parameters), None)
    return "" if first is None else with_unit(*first.as_read(one.size, one.size_sd))


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
        "added_mass_kg": one.mass,
        "absorbed_by_theta": one.score.absorbed,
        "explains": effect.sentence,
    }
