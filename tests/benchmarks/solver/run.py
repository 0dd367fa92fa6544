"""The benchmark `solver`: element tests, and speed beside OpenSees."""

from collections.abc import Sequence
from pathlib import Path

from femupdate.report.figure import save_figure

from ..result import Job, Report
from .elements import OURS, convergence_panels, element_scores, score_markdown, score_record
from .plot_convergence import convergence_figure
from .score import Score
from .speed import SpeedRow, compare_speed, opensees_is_there, speed_markdown, speed_record

NAME = "solver"
_NO_OPENSEES = (
    "OpenSeesPy is not installed, so the speed of femupdate stands alone; "
    "`pip install openseespy` brings it."
)


def run_solver(job: Job, sizes: Sequence[str] = ()) -> Report:
    """Run the benchmark and write its results; nothing in it is random."""
    speed = compare_speed(sizes, job.progress)
    alone = bool(sizes) and not opensees_is_there()
    scores = element_scores(job.progress)
    picture = draw_convergence(scores, job.folder / "convergence.png")
    return solver_report(job, scores, speed, _NO_OPENSEES if alone else "", [picture])


def solver_report(
    job: Job,
    scores: Sequence[Score],
    speed: Sequence[SpeedRow],
    note: str = "",
    pictures: Sequence[Path] = (),
) -> Report:
    """Write what was found."""
    parts = [score_markdown(scores)]
    if speed:
        parts.append(speed_markdown(speed))
    if note:
        parts.append(note)
    content = {
        "elements": [score_record(score) for score in scores],
        "speed": [speed_record(row) for row in speed],
    }
    return job.write(
        NAME,
        content,
        "\n\n".join(parts),
        packages=("openseespy",),
        pictures=pictures,
        answer={**content, "elements_reached": sum(score.reached for score in scores)},
    )


def draw_convergence(scores: Sequence[Score], path: Path) -> Path:
    """Draw how the errors fall with the mesh."""
    title = "Element tests: error against mesh (grey band: within 2 %)"
    return save_figure(convergence_figure(convergence_panels(scores), OURS, title), path)
