"""Runs every command of a fixed set, and compares the figures with a reference file."""

import fnmatch
import json
from pathlib import Path
from typing import Any

from femupdate.errors import StudyError
from femupdate.study import write_text

from ..result import Job, Report, markdown_table
from .compare import Row, compare_records
from .runs import ROOT, Folders, Run, all_runs, make_observations, record

NAME = "regression"
REFERENCE = ROOT / "docs" / "results" / f"{NAME}.json"
QUICK = (
    *("model shear_3dof", "model two_story_openings", "model six_story_wall_frame"),
    *("simulate three", "three *", "clean_0 *", "mass *"),
    *(
        "finder *_?",
        "six latent",
        "six predict",
        "six render",
        "six report",
        "six roof",
        "six compare",
        "six inspect",
        "six identify",
        "six status",
    ),
)


def run_regression(job: Job, reference: Path, quick: bool, only: str = "*") -> tuple[Report, int]:
    """Run what is not in the output folder yet; the report, and the lines outside of tolerance."""
    work = (job.folder / NAME).resolve()
    (work / "logs").mkdir(parents=True, exist_ok=True)
    folders = Folders(work, work / "data")
    make_observations(folders.data)
    chosen = [run for run in all_runs(folders) if _asked(run, quick, only)]
    job.progress.start("Runs for the table", len(chosen))
    kept = work / "runs.json"
    runs: dict[str, Any] = json.loads(kept.read_text()) if kept.exists() else {}
    for run in chosen:
        if run.name not in runs:
            runs[run.name] = record(run, folders)
            write_text(kept, json.dumps(runs, indent=1) + "\n")
        job.progress.advance(1, run.name)
    names = [run.name for run in chosen]
    known = {name: one for name, one in _read(reference).items() if name in names}
    rows = list(compare_records(known, {name: runs[name] for name in names}))
    fallen = sum(row.broken for row in rows)
    report = job.write(NAME, {"runs": runs}, _text(rows, reference), answer={"fallen": fallen})
    return report, fallen


def _asked(run: Run, quick: bool, only: str) -> bool:
    patterns = QUICK if quick else ("*",)
    return fnmatch.fnmatch(run.name, only) and any(fnmatch.fnmatch(run.name, p) for p in patterns)


def _read(reference: Path) -> dict[str, Any]:
    try:
        found: dict[str, Any] = json.loads(reference.read_text(encoding="utf-8"))["runs"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise StudyError(
            f"{reference} is no file of reference figures ({error}); this benchmark writes one"
        ) from error
    return found


def _text(rows: list[Row], reference: Path) -> str:
    fallen = sum(row.broken for row in rows)
    cells = [
        (row.figure, row.before, row.after, row.difference, "!" if row.broken else "")
        for row in rows
    ]
    head = ("figure", reference.name, "now", "difference", "outside")
    count = f"{fallen} of {len(rows)} lines are outside of their tolerance."
    return "\n\n".join([count, markdown_table(head, cells)])
