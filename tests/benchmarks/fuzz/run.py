"""The benchmark `fuzz`: mutated files for every reader, and what came of each."""

import multiprocessing
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from femupdate.progress import Progress

from ..result import Job, Report, markdown_table
from .seeds import write_seeds
from .subjects import SUBJECTS, Subject
from .worker import LARGEST_MEMORY, LONGEST_MESSAGE, work

NAME = "fuzz"
LONGEST_S = 5.0  # that a reader may take
_START_S = 180.0  # for a process to import everything and read the good files
_FINE = ("read", "refused")


@dataclass(frozen=True)
class Failure:
    """A file that was neither read nor refused in a sentence."""

    subject: str
    number: int
    kind: str
    why: str


@dataclass
class Tally:
    """What came of the files of one subject."""

    subject: str
    kinds: dict[str, int] = field(default_factory=dict)
    failures: list[Failure] = field(default_factory=list)
    memory: int = 0
    slowest_s: float = 0.0

    def add(self, number: int, found: dict[str, Any], seconds: float) -> None:
        """Count one file."""
        self.kinds[found["kind"]] = self.kinds.get(found["kind"], 0) + 1
        self.memory = max(self.memory, found.get("memory", 0))
        self.slowest_s = max(self.slowest_s, seconds)
        if found["kind"] not in _FINE:
            self.failures.append(Failure(self.subject, number, found["kind"], found["why"]))


@dataclass(frozen=True)
class FuzzPlan:
    """How much is tried.

    Attributes:
        files: mutated files in all.
        processes: at a time.
        subjects: names of those to fuzz; all where empty.
    """

    files: int
    processes: int
    subjects: tuple[str, ...] = ()


def run_fuzz(job: Job, plan: FuzzPlan) -> Report:
    """Run the benchmark and write its results.

    Raises:
        StudyError: a file cannot be written.
    """
    chosen = [one for one in SUBJECTS if not plan.subjects or one.name in plan.subjects]
    total = sum(one.share for one in chosen)
    counts = {one.name: max(1, round(plan.files * one.share / total)) for one in chosen}
    started = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        seeds = Path(folder) / "seeds"
        write_seeds(seeds)
        job.progress.start("Reading mutated files", sum(counts.values()))

        def task(one: Subject) -> Tally:
            return _fuzzed(one, counts[one.name], seeds, job.seed, job.progress)

        with ThreadPoolExecutor(plan.processes) as pool:
            tallies = list(pool.map(task, sorted(chosen, key=lambda one: -one.share)))
    seconds = time.monotonic() - started
    failures = [one for tally in tallies for one in tally.failures]
    return job.write(
        NAME,
        {"plan": plan, "seconds": seconds, "subjects": tallies, "failures": failures},
        _text(tallies, seconds),
        answer={"files": sum(counts.values()), "failures": len(failures)},
    )


def _fuzzed(one: Subject, count: int, seeds: Path, seed: int, progress: Progress) -> Tally:
    tally = Tally(one.name)
    with tempfile.TemporaryDirectory() as scratch:
        remaining = list(range(count))
        while remaining:
            for number, found, seconds in _session(one, remaining, seeds, Path(scratch), seed):
                tally.add(number, found, seconds)
                progress.advance(1)
            remaining = remaining[sum(tally.kinds.values()) - (count - len(remaining)) :]
    return tally


def _session(
    one: Subject, numbers: Sequence[int], seeds: Path, scratch: Path, seed: int
) -> Iterator[tuple[int, dict[str, Any], float]]:
    """Outcomes of the cases, in order, until a process hangs or crashes."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    arguments = (theirs, str(seeds), str(scratch), one.name, seed)
    process = context.Process(target=work, args=arguments, daemon=True)
    process.start()
    theirs.close()
    try:
        if _answer(ours, _START_S) != "ready":
            raise RuntimeError(f"the good files of {one.name} cannot be read")
        for number in numbers:
            ours.send(number)
            started = time.monotonic()
            found = _answer(ours, LONGEST_S)
            yield number, found, time.monotonic() - started
            if found["kind"] in ("hung", "crashed"):
                return
    finally:
        process.kill()
        process.join()


def _answer(pipe: Connection, seconds: float) -> Any:
    try:
        if not pipe.poll(seconds):
            return {"kind": "hung", "why": f"no answer within {seconds:g} s"}
        return pipe.recv()
    except EOFError:
        return {"kind": "crashed", "why": "the process ended"}


def _text(tallies: Sequence[Tally], seconds: float) -> str:
    rows = []
    for one in tallies:
        bad = sum(count for kind, count in one.kinds.items() if kind not in _FINE)
        rows.append(
            (
                one.subject,
                f"{sum(one.kinds.values()):,}",
                f"{one.kinds.get('read', 0):,}",
                f"{one.kinds.get('refused', 0):,}",
                str(bad),
                f"{one.slowest_s:.1f}",
                f"{one.memory / 1e6:.0f}",
            )
        )
    head = (
        "subject",
        "files",
        "read",
        "refused",
        "failures",
        "slowest, s",
        "largest memory, MB",
    )
    intro = (
        f"Mutated files, each read in a process that is watched ({seconds:.0f} s in all). A file "
        f"is read, or refused in one sentence of at most {LONGEST_MESSAGE} characters. Failures "
        f"are other exceptions, warnings of numpy, {LONGEST_S:g} s without an end, more than "
        f"{LARGEST_MEMORY / 1e9:g} GB of memory, crashes, and files that were left behind."
    )
    found = [
        f"- {one.subject} {one.number}: {one.kind}: {one.why}"
        for tally in tallies
        for one in tally.failures
    ]
    listed = "\n".join(found[:50]) if found else "No failures."
    return "\n\n".join((intro, markdown_table(head, rows), listed))
