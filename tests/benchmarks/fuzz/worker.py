"""Reads mutated files in a process of its own, which may hang, crash or eat memory."""

import contextlib
import io
import resource
import shutil
import traceback
import warnings
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.errors import FemupdateError

from .mutate import mutated
from .subjects import SEED_FILE, Subject, seed_folders, subject, target_of

LARGEST_MEMORY = 2_000_000_000  # bytes that a reader may take beside what Python itself has
LONGEST_MESSAGE = 2000  # characters that a person may be asked to read


def work(pipe: Connection, seeds: str, scratch: str, name: str, seed: int) -> None:
    """Read the cases whose numbers come through a pipe, and send back what came of each."""
    one = subject(name)
    _warm_up(one, Path(seeds), Path(scratch))
    _limit_memory()
    pipe.send("ready")
    while True:
        number = pipe.recv()
        pipe.send(outcome(one, Path(seeds), Path(scratch), seed, number))


def outcome(one: Subject, seeds: Path, scratch: Path, seed: int, number: int) -> dict[str, Any]:
    """What comes of reading one mutated file: read, refused, or something that may not be."""
    path = case(one, seeds, scratch, seed, number)
    before = _listing(path.parent)
    found = _read(one, path)
    if _listing(path.parent) != before:
        found = {"kind": "left a file", "why": str(sorted(_listing(path.parent) - before))}
    return {**found, "memory": _status("VmHWM")}


def case(one: Subject, seeds: Path, scratch: Path, seed: int, number: int) -> Path:
    """Make a mutated file with all that stands beside it, the same for the same numbers."""
    folders = seed_folders(seeds, one.name)
    source = folders[number % len(folders)]
    folder = scratch / one.name
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(source, folder, ignore=shutil.ignore_patterns(SEED_FILE))
    path = folder / target_of(source)
    stream = np.random.SeedSequence([seed, number, *one.name.encode()])
    path.write_bytes(mutated(path.read_bytes(), np.random.default_rng(stream)))
    return path


def _read(one: Subject, path: Path) -> dict[str, Any]:
    try:
        with _quiet():
            one.read(path)
    except FemupdateError as error:
        text = str(error)
        if "\n" in text or len(text) > LONGEST_MESSAGE:
            return {"kind": "no sentence", "why": f"{type(error).__name__}: {text[:300]!r}"}
        return {"kind": "refused", "why": type(error).__name__}
    except BaseException as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        ours = [f for f in traceback.extract_tb(error.__traceback__) if "/femupdate/" in f.filename]
        where = f"{Path(last.filename).name}:{last.lineno}"
        if ours:
            where += f" from {Path(ours[-1].filename).name}:{ours[-1].lineno}"
        return {"kind": "escaped", "why": f"{type(error).__name__}: {str(error)[:200]} ({where})"}
    return {"kind": "read", "why": ""}


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Warnings of numpy would reach the user's screen: they count as errors."""
    with (
        warnings.catch_warnings(),
        contextlib.redirect_stderr(io.StringIO()),
        contextlib.redirect_stdout(io.StringIO()),
    ):
        warnings.simplefilter("error", RuntimeWarning)
        yield


def _listing(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def _warm_up(one: Subject, seeds: Path, scratch: Path) -> None:
    """Read the good files: everything is imported, and none of them may be refused."""
    for source in seed_folders(seeds, one.name):
        folder = scratch / one.name
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(source, folder, ignore=shutil.ignore_patterns(SEED_FILE))
        with _quiet():
            one.read(folder / target_of(source))


def _limit_memory() -> None:
    resource.setrlimit(resource.RLIMIT_DATA, (_status("VmData") + LARGEST_MEMORY,) * 2)


def _status(name: str) -> int:
    """A size that Linux tells of this process, bytes."""
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(name))
