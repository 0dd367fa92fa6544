"""The benchmark `memory`: every command on one study, watched with its workers (Linux)."""

import fnmatch
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from femupdate import __version__
from femupdate.errors import StudyError

from ..log import ResumableLog
from ..result import Job, Report, markdown_table
from ..usage import MOST_MB, Usage, measure

NAME = "memory"
ROOT = Path(__file__).resolve().parents[3]
_MAIN = "from femupdate.cli.main import main; main()"
_BUILDING = "six_story_wall_frame"
_LIMIT_S = 3600.0  # of processor time


@dataclass(frozen=True)
class Measured:
    """One command line.

    Attributes:
        name: in the table; the same words may come twice, as a second run finds more on the disk.
        words: of the command, which may use what those before it have left.
    """

    name: str
    words: tuple[str, ...]


def commands(folder: Path) -> Iterator[Measured]:
    """All commands, in an order in which each finds what it needs; all work in one folder."""
    record = str(ROOT / "examples/records/ridgecrest_2019_clc_90.csv")
    file = str(ROOT / "examples/six_story_white_noise.csv")
    heavier = str(folder / "heavier.csv")
    study, effect = ("--study", "study"), ("--effect", "added_mass@4F=0.12")
    yield Measured("list", ("list",))
    yield Measured("inspect", ("inspect", file))
    yield Measured("identify", ("identify", file, "-o", str(folder / "modes.csv"), "--force"))
    yield Measured("build-model", ("build-model", _BUILDING, *study))
    simulated = ("simulate", "--building", _BUILDING, *effect, "-o", heavier, "--force")
    yield Measured("simulate", simulated)
    yield Measured("calibrate", ("calibrate", file, *study))
    second = ("calibrate", heavier, *study, "--name", "heavier", "--anyway")
    yield Measured("calibrate, second file", second)
    yield Measured("predict", ("predict", "--record", record, "--scale", "0.1", *study))
    yield Measured("render", ("render", *study))
    yield Measured("compare", ("compare", "posterior", "heavier", *study))
    yield Measured("report", ("report", *study, "-o", str(folder / "page.html")))
    yield Measured("status", ("status", *study))
    yield Measured("diagnose, first run", ("diagnose", file, *study))
    yield Measured("diagnose, again", ("diagnose", file, *study))
    yield Measured("repair", ("repair", heavier, *study))
    yield Measured("calibrate --exact", ("calibrate", file, "--exact", *study))
    # The usual data set, and one pass over it: memory does not depend on the number of passes.
    yield Measured("train", ("train", "--fresh", "--epochs", "1", *study))
    yield Measured("demo", ("demo", "--study", "demo"))


def run_memory(job: Job, only: str = "*") -> tuple[Report, int]:
    """Run what is not in the output folder yet; the report, and the commands over the limit.

    Args:
        job: its folder keeps the study and what was measured.
        only: names of commands, as a shell's pattern.

    Raises:
        StudyError: a command fails, or a file cannot be written.
    """
    work = (job.folder / NAME).resolve()
    work.mkdir(parents=True, exist_ok=True)
    chosen = [one for one in commands(work) if fnmatch.fnmatch(one.name, only)]
    log = ResumableLog(work / "measured.jsonl", __version__)
    job.progress.start("Measuring memory", len(chosen))
    found = []
    for one in chosen:
        usage = log.get(one.name, Usage) or _measured(one, work)
        log.add(one.name, usage)
        found.append(usage)
        job.progress.advance(1, f"{one.name}: {usage.peak_mb:.0f} MB")
    over = sum(usage.peak_mb > MOST_MB for usage in found)
    content = {one.name: usage for one, usage in zip(chosen, found, strict=True)}
    report = job.write(
        NAME, {"commands": content}, _text(chosen, found), answer={"over the limit": over}
    )
    return report, over


def _measured(one: Measured, work: Path) -> Usage:
    """What a command takes that does its work to the end."""
    log = work / one.name.replace(" ", "_")
    command = [sys.executable, "-c", _MAIN, *one.words]
    variables = {**os.environ, "PYTHONPATH": str(ROOT)}
    usage = measure(command, variables, work, log, _LIMIT_S)
    if usage.ended != 0:
        message = Path(f"{log}.err").read_text().strip()[-300:]
        raise StudyError(f"{one.name} did not end well: {message}")
    return usage


def _text(chosen: Sequence[Measured], found: Sequence[Usage]) -> str:
    rows = [
        (
            one.name,
            f"{usage.peak_mb:,.0f}",
            f"{usage.seconds:.0f}",
            f"{usage.processor_seconds:.0f}",
            "!" if usage.peak_mb > MOST_MB else "",
        )
        for one, usage in zip(chosen, found, strict=True)
    ]
    intro = (
        "Commands on the six-story study, one after the other, each in a process of its own. The "
        "memory is the largest sum of the proportional shares (PSS) of the process and its "
        f"workers, looked at five times a second. More than {MOST_MB:,.0f} MB is marked."
    )
    head = ("command", "largest memory, MB", "seconds", "processor seconds", "over")
    return "\n\n".join((intro, markdown_table(head, rows)))
