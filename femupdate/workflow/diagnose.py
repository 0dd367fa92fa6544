"""diagnose: where model and measurement disagree, and what the model may lack."""

import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import torch

from femupdate.discrepancy.diagnose import with_pair
from femupdate.discrepancy.findings import (
    NAMED,
    NONE,
    PARTLY,
    UNKNOWN,
    Diagnosis,
    Finding,
    grouped,
    mass_in_words,
    taken,
)
from femupdate.discrepancy.mesh_error import judged_by_mesh
from femupdate.discrepancy.search import (
    FinderModel,
    finder_structure,
    plain_structure,
    prepared,
    sought,
)
from femupdate.discrepancy.strength import judged_by_strength, peaks_with
from femupdate.discrepancy.thresholds import DiagnosisSettings
from femupdate.effects.effect import EffectParameter
from femupdate.effects.registry import CATALOGUE
from femupdate.inference.frf_data import FrfData
from femupdate.inference.likelihood import Data, Likelihood
from femupdate.measurement.observation import Observation
from femupdate.progress import SILENT, Progress
from femupdate.report.page import kept_items
from femupdate.report.scale import with_unit
from femupdate.result import Item, Note, Notes, Picture, Result, first_lines
from femupdate.study import Study, on_files, typed, write_text
from femupdate.tables import Column, Table
from femupdate.units import percent
from femupdate.workflow.effects import finder_basis, open_mesh_error, with_finer_mesh
from femupdate.workflow.kinds import Measured, read_measured_of
from femupdate.workflow.likelihoods import data_of
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import ObservationSource, direction_of


@dataclass(frozen=True, eq=False, kw_only=True)
class DiagnosisReport(Result):
    """A diagnosis and what was made of it.

    Attributes:
        problem: what it was found from.
        limits: factors that end at a limit of their prior, in a sentence.
        screen: what else is to be said of the data and their channels, in sentences.
    """

    diagnosis: Diagnosis
    problem: Likelihood
    limits: tuple[str, ...]
    screen: tuple[str, ...]
    settings: DiagnosisSettings
    path: Path
    seconds: float
    files: tuple[Path, ...]

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know, the decisive first."""
        return (*self.limits, *self.diagnosis.would_decide, *self.screen)

    def items(self) -> Iterator[Item]:
        """The verdict, the leading effects, notes and tables."""
        found, points = self.diagnosis, self.problem.effective
        where = ""
        if found.residuals:
            most = max(found.residuals, key=lambda cell: cell.excess)
            where = ", most at {} from {:.3g} to {:.3g} Hz".format(most.floor, *most.band_hz)
        named = found.verdict in (NAMED, PARTLY)
        words = on_files("repair", self.files), "adds what is missing"
        command, does = words if named else ("report", "writes the page with the maps")
        yield from first_lines(
            f"Verdict: {found.verdict}. {found.sentence}",
            f"Residuals: {(found.base.chi2 / points) ** 0.5:.2g} times the noise (rms){where}.",
            f"`{typed(command, self.path)}` {does}",
        )
        yield Note(content={"verdict": found.verdict, "sentence": found.sentence})
        yield Note(
            f"  residuals {found.base.chi2:.0f} over {points:.0f} independent points "
            f"by the noise alone; {self.seconds:.1f} s",
            {
                "chi2": found.base.chi2,
                "independent_points": points,
                "p_value": found.p_value,
                "theta": found.base.theta()[0],
                "seconds": self.seconds,
            },
            detail=True,
        )
        yield replace(_effects(found.findings), detail=True)
        told = ""
        if found.unobservable:
            unseen = grouped(found.unobservable, self.problem.reduced.structure)
            told = f"  cannot be seen with these sensors: {unseen}"
        yield Note(told, {"cannot_be_seen": found.unobservable}, detail=True)
        yield Notes(self.notes, f"{self.path.name} in the study")
        high = [cell for cell in found.residuals if cell.p_value < 1e-3]
        keys = "floor", "band_hz", "excess", "data"
        yield Note(
            f"  {self.path}",
            page=False,
            content={
                "together": [
                    {"name": finding.placed.effect.name, "place": finding.placed.place}
                    | {"size": finding.size, "size_sd": finding.size_sd}
                    for finding in found.pair
                ],
                "remaining": found.left.as_dict(),
                "cannot_be_told_from_the_first": found.twins,
                "would_decide": found.would_decide,
                "where": [{key: getattr(cell, key) for key in keys} for cell in high],
                "screen": [*self.limits, *self.screen],
            },
            detail=True,
        )
        titles = ("floor", "from_hz", "to_hz", "excess", "p_value", "data")
        rows = [(c.floor, *c.band_hz, c.excess, c.p_value, c.data) for c in found.residuals]
        columns = [Column([row[k] for row in rows], csv=name) for k, name in enumerate(titles)]
        yield Table(name="residual_map", columns=tuple(columns))

    def figures(self) -> Iterator[Picture]:
        """The maps of residuals and, where anything was fitted, the ranking."""
        from femupdate.report.plot_diagnosis import ranking, residual_pictures

        found = self.diagnosis
        yield from residual_pictures("residual_map", {"Model as it is": found.residuals})
        named = found.verdict in ("named", "partly", "indistinguishable", "nonlinear")
        shown = [
            (finding.placed.in_words, finding.log_evidence, shown_size(finding), named and not k)
            for k, finding in enumerate(found.findings[:8])
        ]
        if shown:
            needed = self.settings.over_none
            yield Picture("effect_ranking", lambda: ranking(shown, needed, found.sentence))


def _effects(findings: Sequence[Finding]) -> Table:
    """The effects that were fitted, the strongest first."""

    def each(value: Callable[[Finding], Any]) -> list[Any]:
        return [value(finding) for finding in findings]

    def sized(value: Callable[[Finding, EffectParameter], Any]) -> list[Any]:
        """Of those that have a size; None of the others."""
        firsts = each(lambda finding: next(iter(finding.placed.effect.parameters), None))
        both = zip(findings, firsts, strict=True)
        return [None if first is None else value(finding, first) for finding, first in both]

    def other_data(finding: Finding) -> str:
        if finding.tested is None:
            return "-"
        held = "holds" if finding.tested.certified else "too little"
        return f"{finding.tested.log_e_value:.1f} ({held})"

    evidence, mass = each(lambda finding: finding.log_evidence), each(lambda finding: finding.mass)
    other = each(lambda finding: finding.tested and finding.tested.log_e_value)
    absorbed = each(lambda finding: finding.score.absorbed)
    certified = each(lambda finding: finding.tested and finding.tested.certified)
    frequency = each(lambda finding: finding.changes.frequency)
    response = each(lambda finding: finding.changes.response)
    key, elsewhere = "log_evidence_over_none", "log_evidence_on_other_data"
    columns = (
        Column(each(lambda finding: finding.placed.label), "effect"),
        Column(each(lambda finding: finding.placed.effect.name), key="name"),
        Column(each(lambda finding: finding.placed.effect.title), csv="effect"),
        Column(each(lambda finding: finding.placed.place), csv="place", key="place"),
        Column(each(lambda finding: finding.in_words), csv="in_words"),
        Column(evidence, "log evidence", [f"{value:.1f}" for value in evidence], key, key),
        Column(other, "on other data", each(other_data), elsewhere, elsewhere),
        Column(certified, csv="certified", key="certified"),
        *(
            Column(values, csv=f"change_of_{what}", key=f"changes_of_{what}")
            for what, values in (("frequency", frequency), ("response", response))
        ),
        Column(each(shown_size), "size"),
        Column(each(size_in_words), key="size_in_words"),
        Column(sized(lambda finding, _: finding.size), csv="size"),
        Column(sized(lambda finding, _: finding.size_sd), csv="size_sd"),
        Column(each(lambda finding: finding.size), key="size"),
        Column(each(lambda finding: finding.size_sd), key="size_sd"),
        Column([unit or "" for unit in sized(lambda _, first: first.unit)], csv="unit", key="unit"),
        Column(sized(lambda _, first: first.text), csv="meaning_of_size"),
        Column(mass, key="added_mass_kg"),
        Column([None if kg is None else 1e-3 * kg for kg in mass], csv="added_mass_t"),
        Column(
            absorbed,
            "hidden by the factors",
            [percent(share) for share in absorbed],
            "hidden_by_stiffness_factors",
            "absorbed_by_theta",
        ),
        Column(each(lambda finding: finding.placed.effect.sentence), key="explains"),
        Column(each(lambda finding: finding.placed.in_words), "in words", key="in_words"),
    )
    return Table(
        name="effects",
        columns=columns,
        caption="Effects that were fitted",
        note="Log evidence over the model as it was: a difference of 5 is strong evidence; one of "
        "1 says little. Factors hide what they could make up for.",
        key="effects",
        words_last=True,
        most=6,
    )


def diagnose_study(
    study: Study,
    model: StudyModel,
    source: ObservationSource,
    settings: DiagnosisSettings | None = None,
    progress: Progress = SILENT,
) -> DiagnosisReport:
    """Find where the study's model fails and rank what it may lack; changes nothing in it.

    Raises:
        MeasurementError: the observation cannot be used.
        BuildingError: an effect of the building's file cannot be.
    """
    started = time.monotonic()
    chosen = settings or DiagnosisSettings()
    source = source.opened()
    given = read_measured_of(study, model, source, progress, apart=True)
    finder = finder_model(study, model, progress)
    data = data_of(given, model.system)
    problem, found = search(finder, data, chosen, progress, given.run)
    base = found.base
    room = torch.minimum(base.z - base.steps.lower, base.steps.upper - base.z)
    ended = (room[: base.steps.stories] < 1e-3).nonzero()[:, 0].tolist()
    names = ", ".join(f"{model.prior.names[k]} ({base.theta()[0][k]:.3g})" for k in ended)
    at_limits = (
        f"Without effects {names} end{'s' if len(ended) == 1 else ''} at the prior's limit: widen "
        "the prior first, or what is named may only make up for it."
    )
    report = DiagnosisReport(
        diagnosis=found,
        problem=problem,
        limits=(at_limits,) if ended else (),
        screen=tuple(_notes(given, data, found)),
        settings=chosen,
        path=study.path("diagnosis.json"),
        seconds=time.monotonic() - started,
        files=source.paths,
    )
    origin = {**model.made_from(), **source.made_from()}
    keep_found(study, "diagnose", report.path, report, origin, source)
    return report


def search(
    finder: FinderModel,
    data: Sequence[Data],
    settings: DiagnosisSettings,
    progress: Progress,
    run: Observation | None = None,
) -> tuple[Likelihood, Diagnosis]:
    """Fit the model as it is, and look for what it lacks.

    Args:
        run: from which the data are, where it is but one.
    """
    problem, base = prepared(finder, data, settings.seed, progress)
    progress.start("Looking for what is missing", 4)
    problem, found = sought(finder, problem, base, settings, progress)
    found, along = with_pair(found, settings, progress), direction_of(finder.building)
    return problem, judged_by_mesh(judged_by_strength(found, run, along, settings), finder.mesh)


def keep_found(
    study: Study,
    command: str,
    path: Path,
    report: Result,
    made_from: Mapping[str, str],
    source: ObservationSource,
    holdout: ObservationSource | None = None,
) -> None:
    """Write what was found as JSON, with what the page shows of it, and record its files."""
    content = {**report.as_dict(), "page": kept_items(report.items())}
    write_text(path, json.dumps(content, indent=2) + "\n")
    files, hashes = source.files_as_settings(), {}
    if holdout is not None:
        files["holdout"] = str(holdout.path)
        hashes["holdout"] = holdout.made_from()["observation"]
    study.record(path.stem, path.name, command, {**made_from, **hashes}, files)


def _notes(given: Measured, data: Sequence[Data], found: Diagnosis) -> Iterator[str]:
    """What else is to be said of the data and their channels."""
    yield from given.notes_of_others
    if len(data) == 1 and not data[0].halves and data[0].name == "modes":
        yield (
            "One table of modes cannot be parted in two, so that a name rests on its evidence"
            " alone; a second test would let each test what the other says."
        )
    if any(isinstance(kind, FrfData) and kind.turns for kind in data):
        names = " and ".join(effect.name for effect in CATALOGUE.values() if effect.turns_base)
        yield f"The base's rotation was measured and is an input, so {names} are not looked for."
    base = found.base
    if given.has_base:
        yield from given.doubts
        leading, run = found.leading, given.run
        if leading is not None and found.verdict in (NAMED, PARTLY) and run and run.histories:
            fitted = (found.pair or (leading,))[-1].fitted
            yield peaks_with(base, fitted, run, direction_of(base.likelihood.building))
    first = found.leading if found.verdict not in (NONE, UNKNOWN) else None
    if first is not None and first.placed.effect.name == "added_mass" and not given.forced:
        others = 1.0 / (1.0 + first.size) - 1.0
        yield (
            "Without a force only ratios of masses show: all other floors "
            f"{percent(abs(others), 1)} {'lighter' if others < 0.0 else 'heavier'} than in the "
            "file, and their stiffness likewise, would look the same."
        )
    for what, used in taken(base):
        yield f"Of the stated tolerance of {what} the model takes {used}."
    # What P-Delta takes from a stick its factors make up for wholly.
    structure, effect = base.likelihood.reduced.structure, CATALOGUE["p_delta"]
    listed = any(placed.effect is effect for placed in base.placed)
    if structure.is_stick and effect.places(structure) and not listed:
        springs = effect.terms(structure, "all").springs
        assert springs is not None
        stiffness = [float(term[k, k]) for k, term in enumerate(structure.stiffness_terms)]
        share = -springs.stiffness / (base.theta()[0] * stiffness)
        if share.max() >= 0.02:
            most = structure.building.story_names[int(share.argmax())]
            yield (
                f"Gravity takes {percent(float(share.max()))} of the stiffness of {most} (P-Delta),"
                " which the factors absorb: stories that are drawn equal come out unequal. List"
                " p_delta at all under [[effects]]."
            )
    if found.verdict == PARTLY and not found.pair:
        yield "The effect explains only a part: `repair` adds it and looks for what is beside it."


def finder_model(study: Study, model: StudyModel, progress: Progress = SILENT) -> FinderModel:
    """Open what serves every observation; the error of a mesh is learned when first needed."""
    model = with_finer_mesh(study, model, progress)
    building, plain = model.building, plain_structure(model.building, model.reduced)
    if plain.structure.operators is None:
        return FinderModel(building, plain, plain.structure)
    structure = finder_structure(building)
    mesh = open_mesh_error(study, model, structure, progress)
    return FinderModel(building, plain, structure, mesh, partial(finder_basis, study, building))


def shown_size(finding: Finding) -> str:
    """Size of an effect with its spread and unit; nothing of one that is there or not."""
    first = next(iter(finding.placed.effect.parameters), None)
    return "" if first is None else with_unit(*first.as_read(*finding.told))


def size_in_words(finding: Finding) -> str:
    """The same with what it means: "15.17 ± 0.49 % (share of the floor's mass, 3.09 t)"."""
    first = next(iter(finding.placed.effect.parameters), None)
    meant = (
        "" if first is None else first.text,
        "" if finding.mass is None else mass_in_words(finding.mass),
    )
    more = ", ".join(part for part in meant if part)
    return f"{shown_size(finding)} ({more})" if more else shown_size(finding)
