"""Speed beside OpenSees: the same building, one after the other, each in a process of its own."""

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.errors import StructureError
from femupdate.fe import opensees_script
from femupdate.progress import SILENT, Progress

from ..result import markdown_table
from .tower import SIZES, tower

MODES = 20
OPENSEES_SHELL = "ShellMITC4"  # the fastest of its shells; stiffer in walls
OPENSEES_SOLVER = "SparseGeneral"  # SuperLU: the fastest of its solvers that is right here
_WORKER = "femupdate.benchmarks.solver.speed_worker"
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True, kw_only=True)
class Run:
    """One program on one mesh."""

    program: str  # its name, with element and solver
    frequencies_hz: tuple[float, ...]  # (20,) Hz
    cpu_seconds: float  # of mesh (or reading it), assembly and modes, one thread
    seconds: float  # the same on the clock
    peak_memory_gb: float  # of the whole process, Python included; nan where no one can say
    steps: Mapping[str, float]  # CPU seconds of single steps, where known


@dataclass(frozen=True, kw_only=True)
class SpeedRow:
    """Both programs on one mesh."""

    size: str  # its name
    # shells, beams, dof: how large it is
    shells: int
    beams: int
    dof: int
    ours: Run
    theirs: Run | None  # OpenSees's, None where it was not run

    @property
    def ratio(self) -> float | None:
        """CPU seconds of OpenSees over ours."""
        return self.theirs.cpu_seconds / self.ours.cpu_seconds if self.theirs else None

    @property
    def largest_difference(self) -> float | None:
        """Of the first six frequencies, relative."""
        if self.theirs is None:
            return None
        pair = np.array([self.ours.frequencies_hz[:6], self.theirs.frequencies_hz[:6]])
        return float(np.abs(pair[1] / pair[0] - 1.0).max())


def opensees_is_there() -> bool:
    """Whether OpenSeesPy is installed; it is not imported."""
    return importlib.util.find_spec("openseespy") is not None


def compare_speed(sizes: Sequence[str], progress: Progress = SILENT) -> tuple[SpeedRow, ...]:
    """Run femupdate, and OpenSees where it is installed, on the building of several sizes."""
    unknown = [size for size in sizes if size not in SIZES]
    if unknown:
        raise StructureError(f"there is no size {unknown[0]!r}; choose from {', '.join(SIZES)}")
    progress.start("Speed", len(sizes) * (1 + opensees_is_there()))
    return tuple(_speed_row(size, progress) for size in sizes)


def _speed_row(size: str, progress: Progress) -> SpeedRow:
    structure = tower(SIZES[size])
    with tempfile.TemporaryDirectory() as folder:
        ours, dof = _run_ours(SIZES[size], Path(folder))
        progress.advance(note=f"femupdate, {size}")
        theirs = None
        if opensees_is_there():
            script = Path(folder) / "tower.py"
            text = opensees_script(
                structure, np.ones(1), name=size, types={"shell": OPENSEES_SHELL}
            )
            script.write_text(text, encoding="utf-8")
            theirs = _run_theirs(script)
            progress.advance(note=f"OpenSees, {size}")
    return SpeedRow(
        size=size,
        shells=len(structure.faces),
        beams=len(structure.lines),
        dof=dof,
        ours=ours,
        theirs=theirs,
    )


def _run_ours(per_bay: int, folder: Path) -> tuple[Run, int]:
    target = folder / "ours.json"
    command = [sys.executable, "-m", _WORKER, str(per_bay), str(MODES), str(target)]
    _, memory = _process(command)
    found = json.loads(target.read_text(encoding="utf-8"))
    return _run_of("femupdate", found, memory), found["dof"]


def _run_theirs(script: Path) -> Run:
    options = ["--json", "--modes", str(MODES), "--solver", OPENSEES_SOLVER]
    text, memory = _process([sys.executable, str(script), *options])
    found = json.loads(text.strip().splitlines()[-1])
    return _run_of(f"OpenSees, {OPENSEES_SHELL}, {OPENSEES_SOLVER}", found, memory)


def _run_of(program: str, found: Mapping[str, Any], memory: float) -> Run:
    return Run(
        program=program,
        frequencies_hz=tuple(found["frequencies_hz"]),
        cpu_seconds=found["cpu_seconds"],
        seconds=found["seconds"],
        peak_memory_gb=memory,
        steps=found.get("cpu_steps", {}),
    )


def _process(command: Sequence[str]) -> tuple[str, float]:
    """Run a program with one thread: what it printed, and its peak memory in GB."""
    environment = {**os.environ, **dict.fromkeys(_ONE_THREAD, "1")}
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as complaints:
        started = subprocess.Popen(command, stdout=out, stderr=complaints, env=environment)
        memory = float("nan")
        if hasattr(os, "wait4"):  # not on Windows
            _, status, usage = os.wait4(started.pid, 0)
            started.returncode = os.waitstatus_to_exitcode(status)
            unit = 1e9 if sys.platform == "darwin" else 1e6  # bytes there, kilobytes elsewhere
            memory = usage.ru_maxrss / unit
        if started.wait() != 0:
            complaints.seek(0)
            said = complaints.read().decode(errors="replace").strip().splitlines() or ["nothing"]
            raise StructureError(f"{command[0]} {command[1]} failed; its last words: {said[-1]}")
        out.seek(0)
        return out.read().decode(errors="replace"), memory


def speed_record(row: SpeedRow) -> dict[str, Any]:
    """A row with its ratio, for the JSON file."""
    return {**asdict(row), "ratio": row.ratio, "largest_difference": row.largest_difference}


_FREQUENCIES = ("f1 Hz", "f2 Hz", "f3 Hz", "f20 Hz")
_COSTS = ("CPU s", "clock s", "peak GB", "CPU over ours")
SPEED_HEAD = ("program", "mesh", *_FREQUENCIES, *_COSTS)


def speed_rows(rows: Sequence[SpeedRow]) -> list[tuple[str, ...]]:
    """One line a program and mesh."""
    lines = []
    for row in rows:
        mesh = f"{row.shells} shells, {row.beams} beams, {row.dof} dof"
        for run in (row.ours, row.theirs):
            if run is None:
                continue
            first = [f"{run.frequencies_hz[k]:.4f}" for k in (0, 1, 2, -1)]
            times = [f"{run.cpu_seconds:.2f}", f"{run.seconds:.2f}", f"{run.peak_memory_gb:.2f}"]
            ratio = f"{run.cpu_seconds / row.ours.cpu_seconds:.2f}"
            lines.append((run.program, mesh, *first, *times, ratio))
    return lines


def speed_markdown(rows: Sequence[SpeedRow]) -> str:
    """The table with what to make of it."""
    text = (
        "## Speed beside OpenSees\n\n"
        f"A building of 5 x 3 bays of 6 m and six stories, its {MODES} lowest modes. Both programs "
        "ran one after the other on the same model, each in a process of its own with one thread; "
        "seconds are those of the processor, mesh (or reading it) and assembly included.\n\n"
    )
    text += markdown_table(SPEED_HEAD, speed_rows(rows))
    if any(row.theirs is None for row in rows):
        text += "\n\nOpenSees was not run on every mesh."
    return text
