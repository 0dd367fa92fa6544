"""The benchmark `solver`: element tests, and speed beside OpenSees."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from femupdate.progress import Progress
from femupdate.report.figure import save_figure

from ..machine import Machine, this_machine
from ..result import ResultFiles, write_result
from .elements import (
    OURS,
    convergence_panels,
    element_scores,
    score_markdown,
    score_record,
)
from .plot_convergence import convergence_figure
from .score import Score
from .speed import SpeedRow, compare_speed, opensees_is_there, speed_markdown

NAME = "solver"
_NO_OPENSEES = (
    "OpenSeesPy is not installed, so the speed of femupdate stands alone; "
    "`pip install openseespy` brings it."
)


@dataclass(frozen=True)
class SolverReport:
    """What the benchmark found.

    Attributes:
        machine: it ran on.
        scores: element tests.
        speed: beside OpenSees, one a size.
        notes: what the reader should know, a sentence each.
        files: written.
        pictures: drawn.
    """

    machine: Machine
    scores: tuple[Score, ...]
    speed: tuple[SpeedRow, ...]
    notes: tuple[str, ...]
    files: ResultFiles
    pictures: tuple[Path, ...]


def run_solver_benchmark(
    folder: Path, sizes: Sequence[str] = (), seed: int = 0, progress: Progress | None = None
) -> SolverReport:
    """Run the benchmark and write its results.

    Args:
        folder: for the results.
        sizes: of the building of the speed comparison, none for the element tests alone.
        seed: nothing here is random; it is noted in the result.
        progress: told what is done.

    Raises:
        StudyError, ReportError: a file cannot be written.
        ModelError: an unknown size, or a program that fails.
    """
    machine = this_machine("openseespy", "cvxopt")
    scores = element_scores(progress)
    speed = compare_speed(sizes, progress)
    notes = () if opensees_is_there() or not sizes else (_NO_OPENSEES,)
    picture = draw_convergence(scores, folder / "convergence.png")
    content = {
        "elements": [score_record(score) for score in scores],
        "speed": [speed_record(row) for row in speed],
    }
    text = "\n\n".join(
        [score_markdown(scores), *([speed_markdown(speed)] if speed else []), *notes]
    )
    files = write_result(folder, NAME, machine, seed, content, text)
    return SolverReport(machine, scores, speed, notes, files, (picture,))


def speed_record(row: SpeedRow) -> dict[str, Any]:
    """A row with its ratio, for the JSON file."""
    return {**asdict(row), "ratio": row.ratio, "largest_difference": row.largest_difference}


def draw_convergence(scores: Sequence[Score], path: Path) -> Path:
    """Draw how the errors fall with the mesh."""
    title = "Element tests: error against mesh (grey band: within 2 %)"
    return save_figure(convergence_figure(convergence_panels(scores), OURS, title), path)
