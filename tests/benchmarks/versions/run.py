"""Environments with the lowest and the highest dependencies, and whether the tests pass in them."""

import os
import re
import shutil
import subprocess
import tempfile
import time
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from femupdate.errors import StudyError

from ..result import Job, Report, markdown_table

NAME = "versions"
ROOT = Path(__file__).resolve().parents[3]
FAST = ("tests/fe", "tests/dynamics", "tests/surrogate/test_dataset.py", "tests/inference",
        "tests/test_study.py", "tests/measurement", "tests/cli/test_commands.py")  # fmt: skip
_LOWEST, _HIGHEST = "lowest", "highest"
_SHOWN = ("numpy", "scipy", "torch", "pydantic", "xarray", "h5py")
_COPIED = ("femupdate", "cli", "models", "examples", "tests", "docs", "pyproject.toml", "README.md",
           "LICENSE")  # fmt: skip
_TESTED_BY = ("pytest>=8", "hypothesis>=6.100")
_COUNT = re.compile(r"(\d+) (passed|failed|error|skipped)")


@dataclass(frozen=True, kw_only=True)
class Environment:
    """What came of one environment.

    Attributes:
        python: its version; the command where it could not be started.
        choice: "lowest" or "highest".
        packages: versions of some of them.
        passed, failed, skipped: tests.
        seconds: of the tests.
        trouble: what could not be installed, or the tests that failed.
    """

    python: str
    choice: str
    packages: dict[str, str]
    passed: int = 0
    failed: int = 0
    skipped: int = 0
    seconds: float = 0.0
    trouble: str = ""


def run_versions(job: Job, pythons: Sequence[str], tests: Sequence[str]) -> Report:
    """Run the benchmark and write its results.

    Raises:
        StudyError: none of the interpreters is there, or a file cannot be written.
    """
    found = [path for path in map(shutil.which, pythons) if path and _starts(path)]
    if not found:
        raise StudyError(f"none of {', '.join(pythons)} is there; name others by --pythons")
    asked = [(found[0], _LOWEST), *((python, _HIGHEST) for python in found)]
    job.progress.start("Testing with other versions", len(asked))
    done = []
    for python, choice in asked:
        done.append(_tested(python, choice, tests))
        job.progress.advance(1, f"{done[-1].python}, {choice}: {done[-1].failed} failed")
    return job.write(
        NAME,
        {"tests": tests, "environments": done},
        _text(done, tests),
        answer={"environments": len(done), "failures": sum(bool(one.trouble) for one in done)},
    )


def lowest(requirements: Sequence[str]) -> list[str]:
    """The lower bounds of requirements as constraints, such as numpy==1.26."""
    found = (re.match(r"([\w.-]+)>=([\w.]+)", one) for one in requirements)
    return [f"{one[1]}=={one[2]}" for one in found if one]


def crash(output: str) -> str:
    """Where the interpreter came down, from what pytest has written, or its last words."""
    found = re.search(
        r"Fatal Python error: .*\n\n(?:Current )?[Tt]hread .*\n(?:  File .*\n){1,8}", output
    )
    return " ".join((found[0] if found else output[-300:]).split())


def _starts(python: str) -> bool:
    return subprocess.run([python, "-c", ""], capture_output=True, check=False).returncode == 0


def _tested(python: str, choice: str, tests: Sequence[str]) -> Environment:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        copy = folder / "femupdate"
        for one in _COPIED:
            source = ROOT / one
            copied = shutil.copytree if source.is_dir() else shutil.copy2
            copy.mkdir(exist_ok=True)
            copied(source, copy / one)
        own = folder / "environment"
        _run([python, "-m", "venv", str(own)], folder)
        inside = str(own / "bin" / "python")
        version = _run([inside, "-c", "import platform; print(platform.python_version())"], folder)
        label = version.stdout.strip()
        installed = _installed(inside, copy, choice)
        packages = _packages(inside, folder)
        if installed.returncode:
            why = (installed.stderr.strip().splitlines() or ["pip failed"])[-1]
            return Environment(python=label, choice=choice, packages=packages, trouble=why)
        started = time.monotonic()
        command = [inside, "-m", "pytest", "-p", "no:cacheprovider", "--tb=line", *tests]
        result = _run(command, copy)
        seconds = time.monotonic() - started
        counts = {kind: int(count) for count, kind in _COUNT.findall(result.stdout[-300:])}
        lines = result.stdout.splitlines()
        wrong = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
        ended = [] if result.returncode in (0, 1) else [crash(result.stdout + result.stderr)]
        return Environment(
            python=label,
            choice=choice,
            packages=packages,
            passed=counts.get("passed", 0),
            failed=counts.get("failed", 0) + counts.get("error", 0),
            skipped=counts.get("skipped", 0),
            seconds=seconds,
            trouble="; ".join([*wrong, *ended]),
        )


def _installed(python: str, copy: Path, choice: str) -> subprocess.CompletedProcess[str]:
    project = tomllib.loads((copy / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    constraints = copy.with_name("constraints.txt")
    bounds = lowest(project["dependencies"]) if choice == _LOWEST else []
    constraints.write_text("\n".join(bounds) + "\n", encoding="utf-8")
    pip = [python, "-m", "pip", "install", "-q", "-c", str(constraints)]
    return _run([*pip, "-e", str(copy), *_TESTED_BY], copy.parent)


def _packages(python: str, folder: Path) -> dict[str, str]:
    listed = _run([python, "-m", "pip", "list", "--format=freeze"], folder).stdout
    pairs = (line.split("==") for line in listed.splitlines() if "==" in line)
    return {name: version for name, version in pairs if name in _SHOWN}


def _run(call: Sequence[str], folder: Path) -> subprocess.CompletedProcess[str]:
    kept = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
    return subprocess.run(
        call,
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
        env={**kept, "OMP_NUM_THREADS": "1"},
    )


def _text(done: Sequence[Environment], tests: Sequence[str]) -> str:
    rows = [
        (
            one.python,
            one.choice,
            ", ".join(f"{name} {version}" for name, version in one.packages.items()),
            str(one.passed),
            str(one.skipped),
            str(one.failed),
            f"{one.seconds:.0f}",
        )
        for one in done
    ]
    head = ("Python", "versions", "among them", "passed", "skipped", "failed", "seconds")
    wrong = [f"- {one.python}, {one.choice}: {one.trouble}" for one in done if one.trouble]
    intro = f"New environments, and the tests in {', '.join(tests)}."
    return "\n\n".join([intro, markdown_table(head, rows), "\n".join(wrong) or "No failures."])
