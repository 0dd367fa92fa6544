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
from femupdate.report.curves import Curve
from femupdate.report.figure import save_figure
from femupdate.report.plot_diagnosis import Ranked, ResidualMap, ranking, residual_map
from femupdate.report.plot_repair import gap_story, repair_headline
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
    problem, done = report.problem, report.repair
    added = [one.finding.placed for one in done.rounds]
    cells = [("Before", residual_cells(problem, done.before))]
    draws = [report.theta_before]
    if added:
        cells.append(("After", residual_cells(problem, done.after)))
        draws.append(report.theta_after)
    first = cells[0][1][0].data
    story = gap_story(
        [ResidualMap.of(own, first) for _, own in cells],
        DrawnBuilding(problem.reduced.structure),
        added,
        _curves(report),
        tuple(factor_titles(report.building).values()),
        draws,
        report.held,
    )
    return (
        *_draw_maps(study, "gap_residuals", cells, repair_headline(added)),
        save_figure(story, study.path("pictures", "gap_before_after.png")),
    )


def _draw_maps(
    study: Study, name: str, models: Sequence[tuple[str, tuple[Cell, ...]]], title: str = _MAP_TITLE
) -> Iterator[Path]:
    """Draw the residuals of one model or several, one picture a kind of data."""
    for kind in dict.fromkeys(cell.data for cell in models[0][1]):
        of_kind = f", {kind}" if kind else ""
        maps = [(f"{model}{of_kind}", ResidualMap.of(cells, kind)) for model, cells in models]
        file = "_".join([name, *kind.split()])
        figure = residual_map(maps, title=title)
        yield save_figure(figure, study.path("pictures", f"{file}.png"))


def _curves(report: RepairReport) -> tuple[Curve, ...]:
    """The first record's FRFs, the top floor first, measured and as the models give them."""
    done = report.repair
    data = next((one for one in report.problem.data if isinstance(one, FrfData)), None)
    if data is None:
        return ()
    first = slice(data.blocks[0].points)
    measured = np.where(data.valid.numpy(), data.log_frf.numpy(), np.nan)[:, first]
    before = _log_frf(data, done.before)
    after = _log_frf(data, done.after) if done.rounds else None
    return tuple(
        Curve(
            title=name,
            across="frequency, Hz",
            up=f"{name}, ln|H|",
            x=data.frequency_hz.numpy()[first],
            mean=before[row],
            measured=measured[row],
            beside=None if after is None else after[row],
        )
        for row, name in reversed(list(enumerate(data.names)))
    )


def _log_frf(data: FrfData, fitted: Fit) -> Floats:
    return np.asarray(data.drawn(fitted.system, *fitted.split).abs().log().numpy())
