"""report: everything that a study says, on one page to hand on.

Its sections: a summary, the building, what every result tells, how all was made.
"""

import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from femupdate import __version__
from femupdate.building.document import factor_titles, to_document
from femupdate.discrepancy.findings import NAMED, PARTLY
from femupdate.dynamics.tracking import mean_shape, node_displacements
from femupdate.effects.effect import DrawnBuilding, Placed
from femupdate.effects.registry import building_effects
from femupdate.effects.structure import Structure, structure_of
from femupdate.effects.tolerances import tolerances_of
from femupdate.errors import StudyError
from femupdate.progress import SILENT, Progress
from femupdate.report.figure import DOTS_PER_INCH
from femupdate.report.geometry import Geometry, Glyphs, drawn
from femupdate.report.page import (
    DOTS,
    Block,
    Image,
    Scene,
    Section,
    added_section,
    items_of,
    scene_content,
    thinned_geometry,
    write_page,
)
from femupdate.report.prediction import Prediction
from femupdate.report.quantities import heights_of
from femupdate.report.scale import interval_text, mass_scale, plus_minus
from femupdate.result import Item, Note, Notes, Picture, Result, Told
from femupdate.study import BUILDING_FILE, REPAIRED, Artefact, Study, file_hash, study_of
from femupdate.tables import Table
from femupdate.units import capital, percent
from femupdate.workflow.calibration_report import CalibrationReport, kept_calibration, placed_effect
from femupdate.workflow.model import StudyModel, open_study
from femupdate.workflow.modes import StudyMode, find_modes, mode_table, posterior_modes
from femupdate.workflow.observed import direction_of
from femupdate.workflow.predict import kept_prediction
from femupdate.workflow.status import (
    DAMAGED,
    MISSING,
    PAGE,
    STALE,
    StatusReport,
    files_beside_of,
    found,
    lacking,
    sources_of,
    study_status,
)

_DRAWN = ("grid", "effects", "provenance", "prior", "frequency_grid", "observation", "reduction")


@dataclass(frozen=True)
class BuildingDescription(Result):
    """A building as its file says it, with the `sensors` of these floors."""

    model: StudyModel
    sensors: tuple[str, ...] = ()

    def items(self) -> Iterator[Item]:
        """Stories, the tables of the file, and what is assumed."""
        building = self.model.building
        yield Note(f"{building.title or building.name}: {len(building.story_names)} stories.")
        yield from (Note(" ".join(part.split())) for part in building.description.split("\n\n"))
        heights, above = heights_of(building), self.model.reduced.story_mass
        scale = mass_scale(above)
        nominal = "nominal " if building.forces_are_relative else ""
        rows = [
            (
                name,
                floor,
                "not given" if heights is None else f"{heights[k]:.3g}",
                f"{above[k] / scale.factor:.4g}",
            )
            for k, (name, floor) in enumerate(
                zip(building.story_names, building.floors, strict=True)
            )
        ]
        head = (
            "story",
            "floor above",
            "height, m",
            f"{nominal}mass above its middle, {scale.unit}",
        )
        yield Table.of(head, rows, name="stories", caption="Stories, from the bottom")
        yield Note("As the building file says it, where * stands for all:")
        yield from self._members()
        listed = building_effects(building).placed
        yield Notes(tuple(f"The building file lists: {placed.in_words}." for placed in listed))
        yield Note("What is assumed:")
        yield Notes(tuple(self._assumptions()))

    def _members(self) -> Iterator[Table]:
        """Materials, sections, members and masses, in the units of the file."""
        building = self.model.building
        document = tomllib.loads(building.source) if building.source else to_document(building)
        single = [
            (f"{key}, {name}".replace("_", " "), _cell(entry))
            for key, value in document.items()
            if isinstance(value, dict) and key not in _DRAWN
            for name, entry in value.items()
            if not isinstance(entry, dict)
        ]
        for key, value in document.items():
            entries = value
            if isinstance(value, dict) and all(isinstance(each, dict) for each in value.values()):
                entries = [{"name": name, **entry} for name, entry in value.items()]
            tables = isinstance(entries, list) and entries and isinstance(entries[0], dict)
            if key in _DRAWN or not tables:
                continue
            keys = list(dict.fromkeys(name for entry in entries for name in entry))
            if key == "stories" and set(keys) <= {"name", "height"}:
                continue
            yield Table.of(
                [name.replace("_", " ") for name in keys],
                [[_cell(entry.get(name, "")) for name in keys] for entry in entries],
                name=f"file_{key}",
                caption=capital(key.replace("_", " ")),
            )

        yield Table.of(("setting", ""), single, name="file_settings", caption="Settings")

    def _assumptions(self) -> Iterator[str]:
        building, axis = self.model.building, direction_of(self.model.building)
        yield "The response is linear within a record: nothing yields, cracks or slides in it."
        yield f"The base moves along {axis}, and floors are measured along {axis}."
        base = "fixed" if building.supports is None else building.supports.base
        yield f"The foot of the building: {base}."
        damping, prior = building.damping, building.prior
        if getattr(building, "springs", ()):
            beside = " with dashpots" if building.has_dashpots else ""
            yield f"Springs{beside} stand between it and the ground, linear and not calibrated."
        if damping.ratios is not None:
            pairs = zip(damping.ratios, damping.anchors or (), strict=True)
            listed = ", ".join(f"{ratio:g} at {hz:g} Hz" for ratio, hz in pairs)
            yield f"Every mode has a damping ratio of its own: {listed}."
        elif damping.anchors is not None:
            low, high = damping.anchors
            yield f"Damping is Rayleigh's: a ratio of {damping.ratio:g} at {low:g} and {high:g} Hz."
        elif prior.zeta is not None:
            yield (
                f"All modes have one damping ratio, anything from {prior.zeta.lower:g} to "
                f"{prior.zeta.upper:g} before the data; predictions without data use "
                f"{damping.ratio:g}."
            )
        else:
            yield f"All modes have the damping ratio {damping.ratio:g}."
        yield (
            "A stiffness factor multiplies Young's modulus of everything that its story owns, "
            "alike. Before the data it may be anything from "
            f"{prior.theta.lower:.3g} to {prior.theta.upper:.3g}."
        )
        if not tolerances_of(building):
            yield "Masses, gains of the sensors and clocks are taken to be exact."

    def figures(self) -> Iterator[Picture]:
        """The model at rest, and plans where it has a mesh."""
        from femupdate.report.plot_building import building_view, story_plans

        building = self.model.building
        drawing = DrawnBuilding(structure_of(building))
        floors = list(
            zip(("base", *building.floors), (drawing.levels - drawing.low[2]).tolist(), strict=True)
        )
        grid = getattr(building, "grid", None)
        lines = () if grid is None else (grid.x, grid.y)
        signs = drawn(drawing.sensors(",".join(self.sensors)))
        shape = Geometry.of_building(drawing)
        yield Picture("model", lambda: building_view(shape, signs, floors, lines))
        mesh = drawing.structure.mesh
        if mesh is not None:
            yield Picture("plans", lambda: story_plans(mesh, building.story_names, lines))


def _cell(value: Any) -> str:
    """An entry of the file as text."""
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_cell(each)}" for name, each in value.items())
    if isinstance(value, list):
        named = value and isinstance(value[0], dict)
        return f"{len(value)}" if named else ", ".join(map(_cell, value))
    return {True: "yes", False: "no"}[value] if isinstance(value, bool) else str(value)


_MODES = 6
_SHORT = 16  # figures of a hash


@dataclass(frozen=True, eq=False)
class PageStudy:
    """A study as the page sees it; results that it does not hold are None."""

    study: Study
    model: StudyModel
    status: StatusReport
    calibration: CalibrationReport | None
    prediction: Prediction | None

    @cached_property
    def modes(self) -> tuple[StudyMode, ...]:
        """Some modes over the posterior."""
        if self.calibration is None:
            return ()
        full = find_modes(self.study, self.model)
        return posterior_modes(self.model, self.calibration.posterior, full, _MODES)

    @cached_property
    def description(self) -> BuildingDescription:
        """The building, with the sensors that were used."""
        seen = () if self.calibration is None else self.calibration.posterior.observation.floors
        return BuildingDescription(self.model, tuple(seen))


def page_sections(page: PageStudy) -> Iterator[Section]:
    """From what a reader with one minute should know to the hashes of files."""
    view, *plans = page.description.figures()
    yield Section("summary", "In short", tuple(_summary(page, view)))
    blocks: list[Block] = [*page.description.items(), *plans]
    if page.modes:
        made = page.study.result("posterior.nc")
        blocks += [mode_table(page.modes), *_kept_pictures(page.study, made, ("mode_", "modes"))]
    yield Section("building", "The building", (*blocks, _scene(page)))
    yield Section("posterior", "Posterior", tuple(_told(page.calibration)))
    blocks = [*_told(page.prediction)]
    if page.prediction is not None:
        blocks += _kept_pictures(page.study, page.prediction.path, ("story_shear", "member_forces"))
    yield Section("prediction", "Prediction", tuple(blocks))
    yield Section("finder", "What the model lacks", tuple(_finder(page)))


def _told(result: Result | None) -> Iterator[Block]:
    """What a result tells and draws; nothing of none."""
    if result is None:
        return
    # The summary has all warnings.
    yield from (item for item in result.items() if not getattr(item, "warning", False))
    yield from result.figures()


def _kept_pictures(study: Study, made: Path, names: Sequence[str]) -> list[Image]:
    """Pictures that were drawn when a file was made, and cannot be drawn from what it holds."""
    folder = study.result("pictures")
    found = (sorted(folder.glob(f"{name}*.png"), key=lambda p: (len(p.name), p)) for name in names)
    paths = [path for of_name in found for path in of_name]
    larger = DOTS_PER_INCH / DOTS
    return [Image(path, larger) for path in paths if path.stat().st_mtime >= made.stat().st_mtime]


def _summary(page: PageStudy, view: Picture) -> Iterator[Block]:
    """The verdict, main figures, the model, and what limits all that."""
    yield Notes(page.status.stale, warning=True)
    none = ("Nothing was calibrated yet.",)
    verdict, *told = none if page.calibration is None else page.calibration.first
    yield Note(verdict)
    yield view
    yield from map(Note, told)
    if page.prediction is not None:
        motion = page.prediction.motion.title
        yield Note(f"Under {motion}, with 90 % probability: {page.prediction.largest}.")
    yield from map(Note, lacking(page.study))
    warned = [] if page.calibration is None else [*page.calibration.posterior.warnings]
    warned += () if page.prediction is None else page.prediction.warnings
    yield Notes(tuple(dict.fromkeys(warned)), warning=True)
    if page.calibration is not None:
        yield Note(
            "All figures hold for motion like that measured, in which the building responds "
            "linearly. They say nothing of its strength."
        )
        yield _stiffness(page, page.calibration)
    if page.modes:
        shares = np.sort([mode.effective_mass for mode in page.modes])[::-1]
        # The fewest that move 90 % of the mass, as codes ask of a modal analysis.
        least = shares[min(int(np.searchsorted(shares.cumsum(), 0.9)), len(shares) - 1)]
        rows = [
            (
                mode.label,
                mode.direction,
                plus_minus(mode.tracked.frequency_mean, mode.tracked.frequency_sd),
                percent(mode.effective_mass, 1),
            )
            for mode in page.modes
            if mode.effective_mass >= least
        ]
        head = ("mode", "direction", "frequency, Hz", "share of the mass")
        yield Table.of(head, rows, name="frequencies", caption="Modes that move most of the mass")


def _stiffness(page: PageStudy, calibration: CalibrationReport) -> Table:
    """Stiffness factors, and stiffnesses of the stories where they are known."""
    posterior = calibration.posterior
    factors, titles = posterior.of("stiffness"), factor_titles(page.model.building)
    known = calibration.story_stiffness
    if known is None and page.prediction is not None:
        known = page.prediction.quantities.get("stiffness")
    rows: list[tuple[str, ...]] = [
        (titles[name], interval_text(draws.mean(), draws.std(), *np.quantile(draws, [0.05, 0.95])))
        for name, draws in zip(factors.names, factors.samples.T, strict=True)
    ]
    head = ["factor of", "times the building file"]
    if known is not None and len(known.places) == len(rows):
        head.append(known.heading)
        rows = [(*row, cell) for row, cell in zip(rows, known.cells(), strict=True)]
    note = "Mean, and 5 to 95 % in brackets."
    return Table.of(head, rows, name="main_figures", caption="Stiffness", note=note)


def _scene(page: PageStudy) -> Scene:
    """The model that turns, with factors, modes, sensors and effects."""
    building, reduced = page.model.building, page.model.reduced
    drawing = DrawnBuilding(structure_of(building))
    full = Geometry.of_building(drawing)
    thin = thinned_geometry(full)
    signs: list[tuple[Glyphs, bool]] = []
    if page.calibration is not None:
        floors = ",".join(page.calibration.posterior.observation.floors)
        signs.append((drawn(drawing.sensors(floors)), False))
    for placed in (*building_effects(building).placed, *_named(page)):
        signs.append((drawn(placed.effect.glyphs(drawing, placed.place)), True))
    moving = []
    for mode in page.modes:
        if reduced.node_shapes is not None:
            shapes = node_displacements(reduced, mode.tracked.recognised)
        else:
            floors_moved = mode.at_floors(page.model)
            levels = np.column_stack([np.zeros(len(floors_moved)), floors_moved])
            shapes = np.zeros((len(levels), 4 * levels.shape[1], 3))
            shapes[:, :, drawing.structure.direction] = np.repeat(levels, 4, axis=1)
        mean, spread = mean_shape(shapes)
        hertz = "" if mode.number is None else f", {mode.tracked.frequency_mean:.2f} Hz"
        moving.append((f"{mode.name}{hertz}", mean, 100.0 * spread))
    heights = list(zip(("base", *building.floors), drawing.levels.tolist(), strict=True))
    fields = list(_fields(page, drawing.structure, full))
    shown, every = len(thin[0].shells) + len(thin[0].beams), len(full.shells) + len(full.beams)
    size = f"All {every} elements are drawn."
    if shown < every:
        size = f"Thinned for the screen: {shown} of {every} elements are drawn."
    note = "Drag or use the arrow keys to turn it. Displacements are enlarged."
    content = scene_content(thin, fields, moving, signs, heights)
    return Scene(caption="The model", content=content, note=f"{size} {note}")


def _fields(page: PageStudy, structure: Structure, full: Geometry) -> Iterator[dict[str, Any]]:
    """Mean and spread of the stiffness factor of every element."""
    if page.calibration is None:
        return
    draws = page.calibration.posterior.of("stiffness").samples
    # The factor of every face and line; NaN where none scales it.
    groups = [np.full(len(full.shells), -1), np.tile(np.arange(draws.shape[1]), 4)]
    if structure.mesh is not None:
        none, elements = np.zeros(0, dtype=np.int64), structure.mesh.model.elements
        groups = [
            np.concatenate([none, *(each.group for each in elements if each.dimension() == size)])
            for size in (2, 1)
        ]
    mean, spread = draws.mean(axis=0), 100.0 * draws.std(axis=0) / draws.mean(axis=0)
    named = (("stiffness factor", "", mean, "factor"), ("its spread", "%", spread, "spread"))
    for name, unit, values, colors in named:
        faces, lines = (np.append(values, np.nan)[group] for group in groups)
        yield {"name": name, "unit": unit, "map": colors, "faces": faces, "lines": lines}


def _named(page: PageStudy) -> list[Placed]:
    """The effect that a diagnosis of this study named, whole or partly, if any."""
    if page.status.state("diagnosis") is None:
        return []
    with found(page.study, "diagnosis") as (_, kept):
        if kept["verdict"] not in (NAMED, PARTLY):
            return []
        first = kept["effects"][0]
        placed = placed_effect(f"{first['name']}@{first['place']}")
    return [] if placed is None else [placed]


def _finder(page: PageStudy) -> Iterator[Block]:
    """Diagnosis and repair of this study; of a repaired one, the repair that made it."""
    yield from map(Note, lacking(page.study))
    pictures = {
        "diagnosis": ("residual_map", "effect_ranking"),
        # Maps of one kind of data alone are in the first.
        "repair": ("gap_before_after", "gap_residuals_"),
    }
    for name, drawn_then in pictures.items():
        with found(page.study, name) as (path, kept):
            if kept:
                yield from items_of(kept.get("page", ()))  # an older one has none
                yield from _kept_pictures(Study(path.parent), path, drawn_then)


def appendix(page: PageStudy) -> Section:
    """How it was made: steps with version, time and files."""
    intervals = Note(
        "Intervals are those of the posterior: with the model, the priors and the noise as stated, "
        "the value lies inside with the probability given. They do not cover errors that the notes "
        "name and that nothing on this page accounts for."
    )
    recorded = page.study.artefacts()
    steps = [
        (
            item.name,
            f"femupdate {item.command}",
            item.version,
            item.created.replace("T", " ")[:16],
            item.state,
            item.file,
            recorded[item.name].sha256[:_SHORT],
        )
        for item in page.status.holds
    ]
    made = Table.of(
        ("result", "by", "version", "time (UTC)", "state", "file", "SHA-256"),
        steps,
        name="what_was_done",
        caption="Steps, in the order in which they were made",
        note=f"The first {_SHORT} figures of each hash; the whole ones are in study.json.",
    )
    building = (BUILDING_FILE, file_hash(page.study.path(BUILDING_FILE))[:_SHORT])
    used: dict[tuple[str, str], list[str]] = {building: ["the building, as the study keeps it"]}
    makers = [(item.name, recorded[item.name]) for item in page.status.holds]
    if page.study.folder.name == REPAIRED:
        above = Study(page.study.folder.parent).artefacts()
        makers += [
            (f"{name} that made this model", above[name])
            for name in ("diagnosis", "repair")
            if name in above
        ]
    for name, artefact in makers:
        for file in _sources(artefact):
            used.setdefault(file, []).append(name)
    files = Table.of(
        ("file", "for", "SHA-256 when used"),
        [(file, ", ".join(names), digest) for (file, digest), names in used.items()],
        name="files_used",
        caption="Files that were used",
    )
    return Section("done", "How it was made", (intervals, made, files))


def _sources(artefact: Artefact) -> list[tuple[str, str]]:
    """Files outside the study, each with the hash that it had."""
    sources, recorded = sources_of(artefact), artefact.made_from
    hashes = [recorded[key] for key in recorded if key.startswith(("observation", "record"))]
    hashes += [""] * (len(sources) - len(hashes))
    beside = files_beside_of(artefact)
    hashes += [recorded.get(option, "") for option in beside]
    pairs = zip((*sources, *beside.values()), hashes, strict=True)
    return [(Path(name).name, digest[:_SHORT]) for name, digest in pairs]


def write_report(
    study: Study | Path | str,
    path: Path | str | None = None,
    *,
    title: str | None = None,
    author: str | None = None,
    client: str | None = None,
    logo: Path | str | None = None,
    add: Sequence[Path | str] = (),
    progress: Progress = SILENT,
) -> Told:
    """Write everything that a study says on one HTML page; nothing else in it changes.

    Args:
        study: with a building at least.
        path: of the page; by default `report.html` in the study.
        title: of the page; by default that of the building.
        author, client: who stand below the title.
        logo: PNG or JPEG file beside it.
        add: pictures (PNG, JPEG) and texts (.md, .txt), a section of the page each.

    Raises:
        StudyError: the study holds no building, or what the page shows is damaged.
        ReportError: the page cannot be written or is too large, or a file cannot stand on it.
    """
    started, study = time.monotonic(), study_of(study)
    if not study.path(BUILDING_FILE).exists():
        raise StudyError(
            f"the study {study.folder} holds no building; run `{study.made_by('calibrate')}` first"
        )
    status = study_status(study)
    model = open_study(study, None, progress)
    whole = status.state(study.key("posterior")) not in (None, MISSING, DAMAGED)
    page = PageStudy(
        study,
        model,
        status,
        kept_calibration(study, model) if whole else None,
        None if status.state(study.key("prediction")) is None else kept_prediction(study, model),
    )
    names = {"Client": client, "Author": author}
    credits = tuple(f"{role}: {name}" for role, name in names.items() if name)
    picture = None if logo is None else Image.of(Path(logo))
    extra = [added_section(Path(file), f"added-{k}") for k, file in enumerate(add, 1)]
    progress.start("Writing the page", 2)
    sections = (*page_sections(page), *extra, appendix(page))
    progress.advance()
    building = model.building
    written = write_page(
        Path(path or study.result(PAGE)),
        sections,
        title=title or building.title or building.name,
        subtitle="Stiffness from measured vibration, with its uncertainty",
        made=f"femupdate {__version__}, {datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        credits=credits,
        logo=picture,
    )
    size, seconds = written.stat().st_size, time.monotonic() - started
    shown = tuple(section.title for section in sections if section.blocks)
    stale = tuple(f"{held.name}: {held.state}" for held in status.holds if held.state == STALE)
    text = f"Report of {len(shown)} sections, {size / 1e6:.1f} MB, {seconds:.1f} s"
    return Told(
        (
            Note(text, {"bytes": size, "sections": shown, "seconds": seconds}),
            Notes(stale, key="stale"),
            Note(f"  {written}", {"report": written}),
        )
    )
