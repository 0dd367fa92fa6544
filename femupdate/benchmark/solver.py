"""The benchmark `solver`: element tests, and speed beside OpenSees."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from femupdate.benchmark.elements import (
    OURS,
    convergence_panels,
    element_scores,
    score_markdown,
    score_record,
)
from femupdate.benchmark.machine import Machine, this_machine
from femupdate.benchmark.result import ResultFiles, write_result
from femupdate.benchmark.score import Score
from femupdate.report.figure import save_figure
from femupdate.report.plot_convergence import convergence_figure
from femupdate.workflow.progress import Progress

NAME = "solver"


@dataclass(frozen=True)
class SolverReport:
    """What the benchmark found.

    Attributes:
        machine: it ran on.
        scores: element tests.
        files: written.
        pictures: drawn.
    """

    machine: Machine
    scores: tuple[Score, ...]
    files: ResultFiles
    pictures: tuple[Path, ...]


def run_solver_benchmark(
    folder: Path, seed: int = 0, progress: Progress | None = None
) -> SolverReport:
    """Run the benchmark and write its results.

    Raises:
        StudyError, ReportError: a file cannot be written.
    """
    machine = this_machine("openseespy")
    scores = element_scores(progress)
    picture = draw_convergence(scores, folder / "convergence.png")
    content = {"elements": [score_record(score) for score in scores]}
    files = write_result(folder, NAME, machine, seed, content, score_markdown(scores))
    return SolverReport(machine, scores, files, (picture,))


def draw_convergence(scores: Sequence[Score], path: Path) -> Path:
    """Draw how the errors fall with the mesh."""
    title = "Element tests: error against mesh (grey band: within 2 %)"
    return save_figure(convergence_figure(convergence_panels(scores), OURS, title), path)
