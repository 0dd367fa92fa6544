"""Pictures of what is missing in a model, and of its repair."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.parameters import factor_titles
from femupdate.discrepancy.fit import Fit
from femupdate.discrepancy.residual_map import Cell, residual_cells
from femupdate.effects.drawn_building import DrawnBuilding
from femupdate.inference.frf_data import FrfData
from femupdate.report.figure import save_figure
from femupdate.report.geometry import Geometry
from femupdate.report.glyphs import drawn
from femupdate.report.plot_diagnosis import Columns, Ranked, ranking, residual_map
from femupdate.report.plot_repair import Curves, GapStory, Scene, gap_story
from femupdate.study import Study
from femupdate.workflow.diagnose import DiagnosisReport, shown_size
from femupdate.workflow.repair import RepairReport

_SHOWN = 8
_MAP_TITLE = "Where model and measurement disagree"


def draw_diagnosis(study: Study, report: DiagnosisReport) -> tuple[Path, ...]:
    """Draw the maps of residuals and, where anything was fitted, the ranking."""

    found = report.diagnosis
    needed = report.settings.over_none
    paths = list(_draw_maps(study, "residual_map", (("Model as it is", found.residuals),)))
    if found.findings:
        shown = [
            Ranked(
                one.placed.in_words,
                one.evidence.log_evidence,
                shown_size(one),
                number == 0 and found.verdict in ("named", "partly", "indistinguishable"),
            )
            for number, one in enumerate(found.findings[:_SHOWN])
        ]
        figure = ranking(shown, needed, found.sentence)
        paths.append(save_figure(figure, study.path("pictures", "effect_ranking.png")))
    return tuple(paths)


def draw_repair(study: Study, report: RepairReport) -> tuple[Path, ...]:
    """Draw the maps of residuals before and after, and the picture that tells the whole story."""

    problem, done, held = report.problem, report.repair, report.held
    maps = [("Before", residual_cells(problem, done.before))]
    if done.rounds:
        maps.append(("After", residual_cells(problem, done.after)))
    placed = [one.finding.placed for one in done.rounds]
    headline = "Nothing was added"
    if placed:
        words = (one.in_words for one in placed)
        headline = f"Added: {'; '.join(one[0].lower() + one[1:] for one in words)}"
    curves = next((one for one in problem.data if isinstance(one, FrfData)), None)
    story = gap_story(
        GapStory(
            headline,
            _scene(report, maps) if placed else None,
            None if curves is None else _curves(report, curves),
            tuple(factor_titles(report.building).values()),
            report.theta_before,
            report.theta_after if placed else None,
            None if held is None or held.time is None else held,
        )
    )
    return (
        *_draw_maps(study, "gap_residuals", maps, headline),
        save_figure(story, study.path("pictures", "gap_before_after.png")),
    )


def _draw_maps(
    study: Study, name: str, models: Sequence[tuple[str, tuple[Cell, ...]]], title: str = _MAP_TITLE
) -> Iterator[Path]:
    """Draw the residuals of one model or several, one picture a kind of data."""

    for kind in dict.fromkeys(cell.data for cell in models[0][1]):
        maps = [(model, _map_of(cells, kind)) for model, cells in models]
        rows, columns, _ = maps[0][1]
        of_kind = f", {kind}" if kind else ""
        figure = residual_map(
            rows,
            columns,
            [(f"{model}{of_kind}", grid) for model, (_, _, grid) in maps],
            title=title,
        )
        file = "_".join([name, *kind.split()])
        yield save_figure(figure, study.path("pictures", f"{file}.png"))


def _scene(report: RepairReport, maps: list[tuple[str, tuple[Cell, ...]]]) -> Scene:
    """The building with what was added drawn where it sits, beside the first maps of residuals."""

    structure = report.problem.reduced.structure
    building = DrawnBuilding(structure)
    placed = [one.finding.placed for one in report.repair.rounds]
    glyphs = drawn(sign for one in placed for sign in one.effect.glyphs(building, one.place))
    levels = list(zip(structure.floors, structure.levels.tolist(), strict=True))
    caption = "\n".join(one.in_words for one in placed)
    kind = maps[0][1][0].data
    (rows, columns, before), (_, _, after) = (_map_of(cells, kind) for _, cells in maps)
    return Scene(
        rows, columns, before, after, Geometry.of_building(building), glyphs, levels, caption
    )


def _curves(report: RepairReport, data: FrfData) -> Curves:
    """The first record's FRFs, measured and as the models give them."""

    done = report.repair
    first_record = slice(data.blocks[0].points)
    measured = np.where(data.valid.numpy(), data.log_frf.numpy(), np.nan)
    return Curves(
        data.frequency_hz.numpy()[first_record],
        data.names,
        measured[:, first_record],
        _log_frf(data, done.before),
        _log_frf(data, done.after) if done.rounds else None,
    )


def _log_frf(data: FrfData, fitted: Fit) -> Floats:
    return np.asarray(data.drawn(fitted.system, *fitted.split).abs().log().numpy())


def _map_of(cells: Sequence[Cell], kind: str) -> tuple[tuple[str, ...], Columns, Floats]:
    """Rows, columns, and rms residual over noise (f, b), of one kind of data."""

    own = [cell for cell in cells if cell.data == kind]
    rows = tuple(dict.fromkeys(cell.floor for cell in own))
    bands = tuple(dict.fromkeys(cell.band_hz for cell in own))
    grid = np.full((len(rows), len(bands)), np.nan)
    for cell in own:
        value = np.sqrt(max(cell.excess + 1.0, 0.0))
        empty = cell.excess == 0.0 and cell.p_value == 1.0
        grid[rows.index(cell.floor), bands.index(cell.band_hz)] = np.nan if empty else value
    if all(low == high for low, high in bands):
        names = [f"{low:.3g} Hz" for low, _ in bands]
        return rows, Columns.named(names, "Identified mode"), grid
    return rows, Columns(np.array([bands[0][0], *(band[1] for band in bands)])), grid
