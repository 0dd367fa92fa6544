"""Files that are written whole or not at all."""

import contextlib
import errno
import os
import re
import secrets
from collections.abc import Iterator
from pathlib import Path

from femupdate.errors import FemupdateError, StudyError

# HDF5 and safetensors report a full disk by errors of their own, with the system's number inside.
_NUMBER = re.compile(r"(?:errno = |os error )(\d+)")


@contextlib.contextmanager
def atomic_path(path: Path | str, failure: type[FemupdateError] = StudyError) -> Iterator[Path]:
    """Yield a temporary path beside `path`; move it there when the block ends without error.

    A reader never sees half a file, and a failed write leaves the old file as it was.

    Args:
        path: of the file; folders that are missing are made.
        failure: kind of error to raise.

    Raises:
        FemupdateError: of that kind, where the folder cannot be written or the disk is full.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.stem}-{secrets.token_hex(4)}.part{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.touch(exist_ok=False)
    except OSError as error:
        raise failure(_write_failure(path, error)) from error
    try:
        yield temporary
        os.replace(temporary, path)
    except Exception as error:
        reported = _system_error(error)
        if reported is None:
            raise
        raise failure(_write_failure(path, reported)) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def _system_error(error: Exception) -> OSError | None:
    """The operating system's error behind an exception, if there is one."""
    if isinstance(error, OSError):
        return error
    if isinstance(error, FemupdateError):
        return None
    found = _NUMBER.search(str(error))
    return OSError(int(found[1]), os.strerror(int(found[1]))) if found else None


def _write_failure(path: Path, error: OSError) -> str:
    if error.errno == errno.ENOSPC:
        return f"cannot write {path}: the disk is full; free some space and run the command again"
    return f"cannot write {path}: {error.strerror or error}; check the folder and its permissions"
