"""The open benchmark: this program and its rivals on twenty-four frozen tasks."""

from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from ..result import Job, Report, markdown_table
from .entries import ENTRIES, enter
from .score import FIGURES, figures, score, task_numbers


@dataclass(frozen=True, kw_only=True)
class OpenPlan:
    """Which entries answer which tasks, and folders of other programs' answers beside them."""

    entries: tuple[str, ...] = tuple(ENTRIES)
    only: str = "*"
    others: tuple[Path, ...] = ()


def run_open(job: Job, plan: OpenPlan) -> Report:
    """Answer the tasks, score the answers, and write both; answers that are there are kept."""
    folder = job.folder / "missing_effects"
    numbers = [number for number in task_numbers() if fnmatch(number, plan.only)]
    left = [
        (name, number, folder / name.replace(" ", "_"))
        for name in plan.entries
        for number in numbers
        if not any((folder / name.replace(" ", "_")).glob(f"{number}.[jf]*"))
    ]
    job.progress.start("Open tasks", len(left))
    for name, number, place in left:
        enter(name, number, place)
        job.progress.advance(1, f"{name} {number}")
    scores = {name: score(folder / name.replace(" ", "_")) for name in plan.entries}
    scores |= {other.name: score(other) for other in plan.others}
    totals = {name: figures(tasks) for name, tasks in scores.items()}
    text = f"{_totals(totals)}\n\n{_by_task(scores)}"
    return job.write("missing_effects", {"figures": totals, "tasks": scores}, text)


def _totals(totals: dict[str, dict[str, tuple[float, float]]]) -> str:
    """A table of entries, a column each."""
    rows = []
    for key, title in FIGURES.items():
        cells = [_cell(key, *values[key]) for values in totals.values()]
        rows.append([title, *cells])
    return markdown_table(["", *totals], rows)


def _cell(key: str, value: float, cases: float) -> str:
    if not cases:
        return ""
    return f"{value:.3g}" if key in ("factors", "forecast") else f"{value:.0f} of {cases:.0f}"


def _by_task(scores: dict[str, dict[str, dict[str, Any]]]) -> str:
    """A table of tasks: what is told right, and errors of the next event."""
    rows = []
    for number in task_numbers():
        tasks = [tasks.get(number, {}) for tasks in scores.values()]
        words = next((task["words"] for task in tasks if task), "")
        told = next((task for task in tasks if "verdict" in task), None)
        verdict = "" if told is None else f"{told['verdict']}{'' if told['right'] else ' (wrong)'}"
        errors = [f"{task['forecast']:.3f}" if "forecast" in task else "" for task in tasks]
        rows.append([f"{number} {words}", verdict, *errors])
    return markdown_table(["task", "verdict", *scores], [row for row in rows if any(row[1:])])
