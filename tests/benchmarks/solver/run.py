"""The benchmark `solver`: element tests, and speed beside OpenSees."""

from collections.abc import Sequence

from ..result import Job, Report
from .elements import element_scores, score_markdown, score_record
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
    return solver_report(job, scores, speed, _NO_OPENSEES if alone else "")


def solver_report(
    job: Job,
    scores: Sequence[Score],
    speed: Sequence[SpeedRow],
    note: str = "",
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
        answer={**content, "elements_reached": sum(score.reached for score in scores)},
    )
