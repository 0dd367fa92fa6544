"""One interruption each, and what may not be left after it."""

import re
import resource
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .commands import Interruptible, environment, run

KINDS = ("killed", "file limit", "disk full")
# Within which workers follow: one that is only starting sees it when its imports are done.
_DEATH_S = 20.0
_PROGRESS = re.compile(
    r" \.\.\.$|^  .*: (\d+ %, about .* left|\d+ of \d+ steps, about .* so far)(, .*)?$"
)
_LEFT = ("*.part*", ".lock", ".lock-owner.json")


@dataclass(frozen=True)
class Reference:
    """An undisturbed run.

    Attributes:
        digest: of its result.
        seconds: that it took.
        largest: size of the largest file that it wrote, bytes.
        total: of all of them.
    """

    digest: str
    seconds: float
    largest: int
    total: int


@dataclass(frozen=True)
class Trial:
    """What came of one interruption.

    Attributes:
        command: that was interrupted.
        kind: of the interruption.
        where: it came: seconds after the start, or bytes.
        interrupted: False where the command had ended before.
        wrong: sentences on what was not as it must be.
    """

    command: str
    kind: str
    where: float
    interrupted: bool
    wrong: tuple[str, ...]


def reference(one: Interruptible, folder: Path) -> Reference:
    """Run a command undisturbed."""
    started = time.monotonic()
    run(one.call(folder))
    seconds = time.monotonic() - started
    sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
    return Reference(one.digest(folder), seconds, max(sizes), sum(sizes))


def interrupt(
    one: Interruptible, kind: str, known: Reference, folder: Path, rng: np.random.Generator
) -> Trial:
    """Interrupt a command once, run it again to its end, and look at what is there."""
    found = _TRIALS[kind](one, known, folder, rng)
    wrong = list(found.wrong)
    again = run(one.call(folder), check=False)
    if again.returncode != 0:
        wrong.append(f"the second run failed: {again.stderr.strip()[-300:]}")
    elif one.digest(folder) != known.digest:
        wrong.append("the second run ended with another result")
    left = [path.name for mark in _LEFT for path in folder.rglob(mark)]
    if left:
        wrong.append(f"left behind: {', '.join(left)}")
    return Trial(one.name, kind, found.where, found.interrupted, tuple(wrong))


def _killed(one: Interruptible, known: Reference, folder: Path, rng: np.random.Generator) -> Trial:
    after = float(rng.uniform(0.1, 1.0) * known.seconds)
    process = subprocess.Popen(
        one.call(folder),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=environment(),
        start_new_session=True,
    )
    try:
        process.wait(after)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    orphans = _survivors(process.pid)
    wrong = (f"{orphans} processes outlived their parent",) if orphans else ()
    interrupted = process.returncode == -signal.SIGKILL
    return Trial(one.name, "killed", after, interrupted, wrong)


def _file_limit(
    one: Interruptible, known: Reference, folder: Path, rng: np.random.Generator
) -> Trial:
    most = int(np.exp(rng.uniform(np.log(200), np.log(known.largest))))

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))

    done = run(one.call(folder), check=False, preexec_fn=limit)
    return Trial(one.name, "file limit", most, done.returncode != 0, _complaints(done))


def _disk_full(
    one: Interruptible, known: Reference, folder: Path, rng: np.random.Generator
) -> Trial:
    """On a disk of its own in memory, whose content is then copied to where the next run is."""
    room = 4096 * int(rng.integers(4, 4 + known.total // 4096))
    disk = folder.with_name(f"{folder.name}-disk")
    disk.mkdir()
    script = (
        f'mount -t tmpfs -o size={room} none "{disk}" && cd "{disk}" && '
        f'"$@"; code=$?; cp -r "{disk}/study" "{folder}" 2>/dev/null; exit $code'
    )
    call = ["unshare", "-rm", "sh", "-c", script, "sh", *one.call(disk / "study")]
    done = run(call, check=False)
    shutil.rmtree(disk, ignore_errors=True)
    return Trial(one.name, "disk full", room, done.returncode != 0, _complaints(done))


_TRIALS: dict[str, Callable[..., Trial]] = dict(
    zip(KINDS, (_killed, _file_limit, _disk_full), strict=True)
)


def can_mount() -> bool:
    """Whether this user may have a small disk in memory."""
    try:
        call = ["unshare", "-rm", "mount", "-t", "tmpfs", "none", "/mnt"]
        return subprocess.run(call, capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        return False


def _complaints(done: subprocess.CompletedProcess[str]) -> tuple[str, ...]:
    """What is wrong with how a command ended: it must do its work, or say one sentence."""
    lines = [line for line in done.stderr.splitlines() if not _PROGRESS.search(line)]
    if done.returncode == 0:
        return ()
    if done.returncode != 1 or len(lines) != 1 or not lines[0].startswith("Error: cannot write"):
        return (f"it ended with {done.returncode}: {' '.join(lines)[-300:]}",)
    return ()


def _survivors(group: int) -> int:
    """Processes of a group that still run some seconds after their leader's end."""
    end = time.monotonic() + _DEATH_S
    while (count := _running(group)) and time.monotonic() < end:
        time.sleep(0.1)
    return count


def _running(group: int) -> int:
    count = 0
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = entry.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        count += int(fields[2]) == group and fields[0] not in "ZX"
    return count
