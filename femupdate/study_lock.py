"""A lock on a study: one process at a time writes into it."""

import contextlib
import json
import os
import socket
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from femupdate.atomic import remove_parts, write_failure
from femupdate.errors import StudyError

_LOCK = ".lock"
_OWNER = ".lock-owner.json"
# Folders inside a study into which files are written.
_WRITTEN = ("", "pictures", "tables")
_INNER = (
    *(f"{study}{inner}" for study in ("", "repaired/", "posteriors/*/") for inner in _WRITTEN),
    *("dataset/*", "sampling", "posteriors/*/sampling"),
)


@contextlib.contextmanager
def locked(folder: Path, what: str) -> Iterator[None]:
    """Hold a study for this process; the system frees it whenever and however the process ends.

    What killed processes have left of unfinished files is removed first. Folders that were made
    for the lock and hold nothing at the end are removed.

    Args:
        folder: of the study, made where it is missing.
        what: is being done, such as "calibrate", for the message to others.

    Raises:
        StudyError: another process holds it, which is named; or the folder cannot be written.
    """
    from filelock import FileLock, Timeout

    made = [path for path in (folder, *folder.absolute().parents) if not path.exists()]
    lock = FileLock(folder / _LOCK)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock.acquire(blocking=False)
    except Timeout:
        raise StudyError(_taken(folder)) from None
    except OSError as error:
        raise StudyError(write_failure(folder / _LOCK, error)) from error
    try:
        _write_owner(folder, what)
        for inner in _INNER:
            for place in folder.glob(inner) if inner else (folder,):
                remove_parts(place)
        yield
    finally:
        for name in (_OWNER, _LOCK):
            with contextlib.suppress(OSError):
                (folder / name).unlink()
        lock.release()
        with contextlib.suppress(OSError):
            for path in made:
                path.rmdir()


def _write_owner(folder: Path, what: str) -> None:
    owner = {
        "command": what,
        "process": os.getpid(),
        "machine": socket.gethostname(),
        "since": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    with contextlib.suppress(OSError):  # the name is a courtesy, the lock is held without it
        (folder / _OWNER).write_text(json.dumps(owner) + "\n", encoding="utf-8")


def _taken(folder: Path) -> str:
    try:
        owner = json.loads((folder / _OWNER).read_text(encoding="utf-8"))
        who = (
            f"`femupdate {owner['command']}` (process {owner['process']} on {owner['machine']}, "
            f"since {owner['since']})"
        )
    except (OSError, ValueError, KeyError, TypeError):
        who = "another process"
    return (
        f"{who} is writing into the study {folder}; wait until it has ended, or choose another "
        "folder with --study"
    )
