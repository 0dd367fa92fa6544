"""The benchmark `mutations`: each changed module under its own tests, in a process of its own."""

import importlib
import os
import resource
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femupdate.errors import StudyError

from ..result import Job, Report, markdown_table
from .mutants import Mutant, mutants_of

NAME = "mutations"
ROOT = Path(__file__).resolve().parents[3]
# Modules by the tests that are theirs.
TESTS = {
    "femupdate.fe.plate": ("tests/fe/test_shell_patch.py", "tests/fe/test_shell_element.py"),
    "femupdate.dynamics.damping": ("tests/dynamics/test_damping.py",),
    "femupdate.dynamics.recurrence": ("tests/dynamics/test_history.py",),
    "femupdate.measurement.welch": ("tests/measurement/test_frf.py",),
    "femupdate.measurement.pooled": ("tests/measurement/test_pooled.py",),
    "femupdate.inference.diagnostics": ("tests/inference/test_diagnostics.py",),
    "femupdate.inference.importance": ("tests/inference/test_importance.py",),
    "femupdate.discrepancy.evidence": (
        "tests/discrepancy/test_evidence_terms.py",
        "tests/discrepancy/test_evidence.py",
    ),
}


@dataclass(frozen=True)
class Survivor:
    """A change that no test noticed."""

    module: str
    function: str
    line: int
    before: str
    after: str


@dataclass(frozen=True)
class Score:
    """What came of the changes of one module."""

    module: str
    possible: int
    tried: int
    noticed: int
    seconds: float


def run_mutations(job: Job, each: int, modules: Sequence[str]) -> Report:
    """Run the benchmark and write its results.

    Raises:
        StudyError: a module is not among those that have tests here, its tests fail without any
            change, or a file cannot be written.
    """
    unknown = [one for one in modules if one not in TESTS]
    if unknown:
        raise StudyError(f"{unknown[0]} is none of {', '.join(TESTS)}; choose among these")
    chosen = list(modules or TESTS)
    job.progress.start("Changing modules", each * len(chosen))
    rng = np.random.default_rng(job.seed)
    scores, survivors = [], []
    for module in chosen:
        score, left = _module(job, module, each, rng)
        scores.append(score)
        survivors += left
    return job.write(
        NAME,
        {"scores": scores, "survivors": survivors},
        _text(scores, survivors),
        answer={"tried": sum(s.tried for s in scores), "noticed": sum(s.noticed for s in scores)},
    )


def _module(
    job: Job, module: str, each: int, rng: np.random.Generator
) -> tuple[Score, list[Survivor]]:
    path = Path(str(importlib.import_module(module).__file__))
    mutants = list(mutants_of(path))
    picked = rng.choice(len(mutants), min(each, len(mutants)), replace=False)
    started = time.monotonic()
    if not passes(None, TESTS[module], 600):
        raise StudyError(f"the tests of {module} fail without any change; mend them first")
    limit = 20 + int(5 * (time.monotonic() - started))
    left = []
    for one in (mutants[k] for k in sorted(picked)):
        if passes(one, TESTS[module], limit):
            left.append(Survivor(module, one.function, one.line, one.before, one.after))
        job.progress.advance(1, module)
    job.progress.advance(each - len(picked))
    tried = len(picked)
    seconds = time.monotonic() - started
    return Score(module, len(mutants), tried, tried - len(left), seconds), left


def passes(mutant: Mutant | None, tests: Sequence[str], limit_s: int) -> bool:
    """Whether tests pass with a change; those that take more processor time do not."""
    child = os.fork()
    if child == 0:
        try:
            resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s))
            _test(mutant, tests)
        finally:
            os._exit(1)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def _test(mutant: Mutant | None, tests: Sequence[str]) -> None:
    """In the child: ends the process with the exit code of pytest."""
    import pytest

    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    if mutant is not None:
        mutant.install()
    os.chdir(ROOT)
    os._exit(pytest.main(["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *tests]))


def _text(scores: Sequence[Score], survivors: Sequence[Survivor]) -> str:
    rows = [
        (
            one.module.removeprefix("femupdate."),
            str(one.possible),
            str(one.tried),
            str(one.noticed),
            f"{100.0 * one.noticed / max(one.tried, 1):.0f}",
            f"{one.seconds:.0f}",
        )
        for one in scores
    ]
    head = ("module", "possible changes", "tried", "noticed", "noticed, %", "seconds")
    listed = [
        f"- {one.module.removeprefix('femupdate.')}, line {one.line}, {one.function}: "
        f"`{one.before}` became `{one.after}`"
        for one in survivors
    ]
    intro = (
        "One operator, comparison, sign or number of a function was changed at a time, and the "
        "module's own tests were run. Texts, defaults of arguments and constants outside of "
        "functions were left alone. A change that makes no difference cannot be noticed."
    )
    parts = [intro, markdown_table(head, rows), "Not noticed:", "\n".join(listed) or "none"]
    return "\n\n".join(parts)
