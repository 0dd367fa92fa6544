"""The benchmark `interruptions`: kills, full disks and limits, and what was lost."""

import shutil
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femupdate import __version__

from ..log import ResumableLog
from ..result import Job, Report, markdown_table
from .commands import Interruptible, interruptible
from .trials import KINDS, Reference, Trial, can_mount, interrupt, reference

NAME = "interruptions"


@dataclass(frozen=True)
class InterruptionPlan:
    """How much is tried.

    Attributes:
        each: interruptions of each kind of each command.
        processes: commands at a time.
        commands: names of those to try; all where empty.
        kinds: of interruptions; all that this machine can make where empty.
    """

    each: int
    processes: int
    commands: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()


def run_interruptions(job: Job, plan: InterruptionPlan) -> Report:
    """Run the benchmark and write its results; trials in the output folder are not made again.

    Raises:
        StudyError: a file cannot be written.
    """
    possible = KINDS if can_mount() else KINDS[:-1]
    kinds = [one for one in possible if not plan.kinds or one in plan.kinds]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        commands = [
            one for one in interruptible(folder) if not plan.commands or one.name in plan.commands
        ]
        job.progress.start("Interrupting commands", len(commands) * (1 + len(kinds) * plan.each))

        log = ResumableLog(job.folder / f"{NAME}.jsonl", [__version__, job.seed])

        def undisturbed(one: Interruptible) -> Reference:
            place = folder / f"reference {one.name}"
            found = log.get_or_make(one.name, Reference, lambda: reference(one, place))
            job.progress.advance(1)
            return found

        def task(asked: tuple[int, int, str]) -> Trial:
            number, command, kind = asked
            one, known = commands[command], references[command]
            rng = np.random.default_rng([job.seed, number, command, KINDS.index(kind)])
            place = folder / f"{number}-{command}-{KINDS.index(kind)}"
            key = f"{one.name}, {kind} {number}"
            found = log.get_or_make(key, Trial, lambda: interrupt(one, kind, known, place, rng))
            shutil.rmtree(place, ignore_errors=True)
            job.progress.advance(1)
            return found

        with ThreadPoolExecutor(plan.processes) as pool:
            references = list(pool.map(undisturbed, commands))
            asked = [
                (number, command, kind)
                for number in range(plan.each)
                for command in range(len(commands))
                for kind in kinds
            ]
            trials = list(pool.map(task, asked))
    wrong = [one for one in trials if one.wrong]
    return job.write(
        NAME,
        {"plan": plan, "references": references, "trials": trials},
        _text(commands, references, trials),
        answer={"interruptions": sum(one.interrupted for one in trials), "failures": len(wrong)},
    )


def _text(
    commands: Sequence[Interruptible], references: Sequence[Reference], trials: Sequence[Trial]
) -> str:
    rows = []
    for one, known in zip(commands, references, strict=True):
        own = [trial for trial in trials if trial.command == one.name]
        counts = [sum(t.interrupted for t in own if t.kind == kind) for kind in KINDS]
        lost = sum(bool(trial.wrong) for trial in own)
        rows.append((one.name, f"{known.seconds:.0f}", str(len(own)), *map(str, counts), str(lost)))
    head = ("command", "alone, s", "trials", *KINDS, "failures")
    intro = (
        "Commands ended with SIGKILL at a random moment, given a random limit on the size of "
        "files, or a random small disk, and then run again. The counts are those that met the "
        "command at work. A failure is anything but one sentence, a process that outlives its "
        "parent, a file that is left behind, a second run that fails, or one whose result is not "
        "that of an undisturbed run to the last digit."
    )
    listed = [
        f"- {t.command}, {t.kind} at {t.where:.4g}: {'; '.join(t.wrong)}" for t in trials if t.wrong
    ]
    return "\n\n".join((intro, markdown_table(head, rows), "\n".join(listed) or "No failures."))
