"""Processor time and memory of a command with all its workers, by /proc (Linux)."""

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

MOST_MB = 2000.0  # that a command may take
WALL_OVER_PROCESSOR = 4.0  # a busy machine may take so much longer than the limit
_EVERY_S = 0.2  # between two looks at the memory


@dataclass(frozen=True)
class Usage:
    """What a process took with its workers; `ended` is its exit code, None if it was stopped."""

    ended: int | None
    seconds: float
    processor_seconds: float
    peak_mb: float


def measure(
    command: list[str], environment: dict[str, str], folder: Path, log: Path, limit_s: float
) -> Usage:
    """Run a command in a session of its own and watch all its processes."""
    with open(f"{log}.json", "w") as out, open(f"{log}.err", "w") as errors:
        started = time.monotonic()
        process = subprocess.Popen(
            command, stdout=out, stderr=errors, cwd=folder, env=environment, start_new_session=True
        )
        spent: dict[int, float] = {}
        peak, ended = 0.0, 0
        while not ended:
            members = list(_session(process.pid))
            spent |= {pid: seconds for pid, seconds, _ in members}
            peak = max(peak, sum(size for *_, size in members))
            seconds = time.monotonic() - started
            over = sum(spent.values()) > limit_s or seconds > WALL_OVER_PROCESSOR * limit_s
            if over:
                os.killpg(process.pid, signal.SIGKILL)
            else:
                time.sleep(_EVERY_S)
            ended, status, usage = os.wait4(process.pid, 0 if over else os.WNOHANG)
        process.returncode = os.waitstatus_to_exitcode(status)
    waited = usage.ru_utime + usage.ru_stime  # also of workers that it has waited for
    processor = max(waited, sum(spent.values()))
    return Usage(None if over else process.returncode, seconds, processor, peak)


def _session(leader: int) -> Iterator[tuple[int, float, float]]:
    """Processes of a session: number, processor seconds, share of memory in MB."""
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            fields = (entry / "stat").read_text().rsplit(")", 1)[1].split()
            if int(fields[3]) != leader:
                continue
            seconds = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
            sizes = (entry / "smaps_rollup").read_text().split()
            yield int(entry.name), seconds, int(sizes[sizes.index("Pss:") + 1]) / 1024.0
        except (OSError, IndexError, ValueError):
            continue  # it has ended meanwhile
