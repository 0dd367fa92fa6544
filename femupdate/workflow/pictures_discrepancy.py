"""Pictures of what is missing in a model, and of its repair."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femupdate.arrays import Floats
from femupdate.discrepancy.diagnose import Finding
from femupdate.discrepancy.fit import Fit
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.residual_map import Cell, residual_cells
from femupdate.effects.drawn_building import DrawnBuilding
from femupdate.study import Study
from femupdate.workflow.diagnose import DiagnosisReport
from femupdate.workflow.repair import RepairReport

if TYPE_CHECKING:
    from femupdate.report.plot_repair import Curves, Scene

_SHOWN = 8


def draw_diagnosis(study: Study, report: DiagnosisReport) -> tuple[Path, ...]:
    """Draw the map of residuals and, where anything was fitted, the ranking."""
    from femupdate.report.figure import save_figure
    from femupdate.report.plot_diagnosis import Ranked, ranking, residual_map

    found = report.diagnosis
    needed = report.settings.over_none
    floors, edges, grid = _cells_as_grid(found.residuals)
    paths = [
        save_figure(
            residual_map(floors, edges, [("Model as it is", grid)]),
            study.path("pictures", "residual_map.png"),
        )
    ]
    if found.findings:
        shown = [
            Ranked(
                f"{one.placed.effect.title}, {one.placed.place}",
                one.evidence.log_evidence,
                _size(one),
                number == 0 and found.verdict in ("named", "indistinguishable"),
            )
            for number, one in enumerate(found.findings[:_SHOWN])
        ]
        figure = ranking(shown, needed, found.sentence)
        paths.append(save_figure(figure, study.path("pictures", "effect_ranking.png")))
    return tuple(paths)


def _size(one: Finding) -> str:
    """Size of an effect with its spread and unit; nothing of one that is there or not."""
    first = next(iter(one.placed.effect.parameters), None)
    return "" if first is None else f"{first.shown(one.size)} {first.scatter(one.size_sd)}"


def draw_repair(study: Study, report: RepairReport) -> tuple[Path, ...]:
    """Draw the maps of residuals before and after, and the picture that tells the whole story."""
    from femupdate.report.figure import save_figure
    from femupdate.report.plot_diagnosis import residual_map
    from femupdate.report.plot_repair import GapStory, gap_story

    problem, done, held = report.problem, report.repair, report.held
    floors, edges, first = _cells_as_grid(residual_cells(problem, done.before))
    maps = [("Before", first)]
    if done.rounds:
        maps.append(("After", _cells_as_grid(residual_cells(problem, done.after))[2]))
    placed = [one.finding.placed for one in done.rounds]
    headline = "Nothing was added"
    if placed:
        words = "; ".join(one.in_words for one in placed)
        headline = f"Added: {words[0].lower()}{words[1:]}"
    residuals = residual_map(floors, edges, maps, title=headline)
    story = gap_story(
        GapStory(
            headline,
            _scene(report, edges, maps) if placed else None,
            _curves(report, floors),
            [f"θ{k + 1}" for k in range(report.theta_before.shape[1])],
            report.theta_before,
            report.theta_after if placed else None,
            None if held is None or held.time is None else held,
        )
    )
    return (
        save_figure(residuals, study.path("pictures", "gap_residuals.png")),
        save_figure(story, study.path("pictures", "gap_before_after.png")),
    )


def _scene(report: RepairReport, edges: Floats, maps: list[tuple[str, Floats]]) -> "Scene":
    """The building with what was added drawn where it sits, beside the maps of residuals."""
    from femupdate.report.geometry import Geometry
    from femupdate.report.glyphs import drawn
    from femupdate.report.plot_repair import Scene

    structure = report.problem.reduced.structure
    building = DrawnBuilding(structure)
    placed = [one.finding.placed for one in report.repair.rounds]
    glyphs = drawn(sign for one in placed for sign in one.effect.glyphs(building, one.place))
    levels = list(zip(structure.floors, structure.levels.tolist(), strict=True))
    caption = "\n".join(f"{one.effect.title}, {one.place}" for one in placed)
    (_, before), (_, after) = maps
    return Scene(edges, before, after, Geometry.of_building(building), glyphs, levels, caption)


def _curves(report: RepairReport, floors: tuple[str, ...]) -> "Curves":
    """The first record's FRFs, measured and as the models give them."""
    from femupdate.report.plot_repair import Curves

    problem, done = report.problem, report.repair
    first_record = slice(problem.blocks[0].points)
    measured = np.where(np.isfinite(problem.sd.numpy()), problem.log_frf.numpy(), np.nan)
    return Curves(
        problem.frequency_hz.numpy()[first_record],
        floors,
        measured[:, first_record],
        _log_frf(problem, done.before),
        _log_frf(problem, done.after) if done.rounds else None,
    )


def _log_frf(problem: Problem, fitted: Fit) -> Floats:
    theta, zeta, sizes = fitted.coordinates.split(fitted.z[None], problem.fixed_zeta)
    frequency = problem.frequency_hz[: problem.blocks[0].points]
    frf = fitted.system.frf(theta, zeta, sizes, frequency)[0, list(problem.rows)]
    return np.asarray(frf.abs().log().numpy())


def _cells_as_grid(cells: tuple[Cell, ...]) -> tuple[tuple[str, ...], Floats, Floats]:
    """Floors, edges of the bands (b + 1,), and rms residual over noise (f, b)."""
    floors = tuple(dict.fromkeys(cell.floor for cell in cells))
    bands = tuple(dict.fromkeys(cell.band_hz for cell in cells))
    grid = np.full((len(floors), len(bands)), np.nan)
    for cell in cells:
        value = np.sqrt(max(cell.excess + 1.0, 0.0))
        empty = cell.excess == 0.0 and cell.p_value == 1.0
        grid[floors.index(cell.floor), bands.index(cell.band_hz)] = np.nan if empty else value
    edges = np.array([bands[0][0], *(band[1] for band in bands)])
    return floors, edges, grid
