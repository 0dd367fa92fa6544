"""Files that are written whole or not at all."""

import contextlib
import errno
import os
import re
import secrets
from collections.abc import Iterator
from pathlib import Path

from femupdate.errors import FemupdateError, StudyError

# Libraries report a full disk by errors of their own, with the system's number inside.
_NUMBER = re.compile(r"(?:errno = |os error )(\d+)")
_FULL = (errno.ENOSPC, errno.EDQUOT)
# The name of a file that is being written: that of the file, eight digits of chance, an ending.
_PART = re.compile(r"\..+-[0-9a-f]{8}\.part(\.[^.]*)?")


@contextlib.contextmanager
def atomic_path(path: Path | str, failure: type[FemupdateError] = StudyError) -> Iterator[Path]:
    """Yield a temporary path beside `path`; move it there when the block ends without error.

    A reader never sees half a file, and a failed write leaves the old file as it was.

    Args:
        path: of the file; folders that are missing are made.

    Raises:
        FemupdateError: of that kind, where the folder cannot be written or the disk is full.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.stem}-{secrets.token_hex(4)}.part{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.touch(exist_ok=False)
    except OSError as error:
        raise failure(write_failure(path, error)) from error
    try:
        yield temporary
        os.replace(temporary, path)
    except Exception as error:
        reported = _system_error(error)
        if reported is None:
            raise
        raise failure(write_failure(path, reported)) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_bytes(
    path: Path | str, content: bytes, failure: type[FemupdateError] = StudyError
) -> None:
    """Write a binary file atomically.

    Libraries that write their own formats should do so in memory, and leave the disk to this: HDF5
    brings the process down where a disk fills up under an open file (h5py 3.16).

    Raises:
        FemupdateError: of the kind `failure`, where the file cannot be written.
    """
    with atomic_path(path, failure) as temporary:
        temporary.write_bytes(content)


def remove_parts(folder: Path) -> None:
    """Remove what killed processes have left of files that they were writing into a folder.

    No other process may be writing there now.
    """
    for path in folder.glob(".*.part*"):
        if _PART.fullmatch(path.name):
            with contextlib.suppress(OSError):
                path.unlink()


def write_failure(path: Path, error: OSError) -> str:
    """A sentence for a file that the system would not write."""
    if error.errno in _FULL:
        return f"cannot write {path}: the disk is full; free some space and run the command again"
    if error.errno == errno.EFBIG:
        return (
            f"cannot write {path}: files may not grow that large here; raise the limit (ulimit -f) "
            "and run the command again"
        )
    return f"cannot write {path}: {error.strerror or error}; check the folder and its permissions"


def _system_error(error: Exception) -> OSError | None:
    """The operating system's error behind an exception, if there is one."""
    if isinstance(error, OSError):
        return error
    if isinstance(error, FemupdateError):
        return None
    found = _NUMBER.search(str(error))
    return OSError(int(found[1]), os.strerror(int(found[1]))) if found else None
