"""Reads files that a user names, which may be anything."""

import os
import stat
from pathlib import Path

from femupdate.errors import FemupdateError


def read_file(
    path: Path | str, largest: int, failure: type[FemupdateError], limit: int = -1
) -> bytes:
    """Bytes of a regular file, at most `limit` of them.

    Args:
        largest: size that is refused above, bytes.
        limit: bytes to read; all where negative, and then only is the size looked at.

    Raises:
        FemupdateError: of that kind: the file is missing, a folder, a pipe or a device, larger
            than `largest`, or cannot be read.
    """
    try:
        check_regular(path, failure)
        with open(path, "rb") as stream:
            size = os.fstat(stream.fileno()).st_size
            if limit < 0 and size > largest:
                raise failure(
                    f"{path} has {size / 1e6:.0f} MB, more than the {largest / 1e6:.0f} MB that "
                    "such a file may have; split it, or name the right one"
                )
            return stream.read(limit)
    except FileNotFoundError:
        raise failure(f"{path}: no such file; check the name and the folder") from None
    except OSError as error:
        raise failure(f"{path}: cannot be read ({error.strerror}); check its permissions") from None


def check_regular(path: Path | str, failure: type[FemupdateError]) -> None:
    """Refuse what never ends or is no file, before it is opened.

    Raises:
        FemupdateError: of the kind `failure`: a folder, a pipe or a device.
        OSError: the file is missing or cannot be reached.
    """
    kind = os.stat(path).st_mode
    if stat.S_ISDIR(kind):
        raise failure(f"{path} is a folder; name the file in it")
    if not stat.S_ISREG(kind):
        raise failure(f"{path} is a pipe or a device; save its content as a file and name that")
