"""Reads files that a user names, which may be anything; TOML among them."""

import os
import re
import stat
import tomllib
from pathlib import Path
from typing import Any

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


_TOO_DEEP = "its lists or tables are nested too deeply; take them apart"
# Fifty names with dots between them, where a key may begin.
_DEEP_KEY = re.compile(r"""(?:^|[{,\[])[ \t]*(?:[\w"'-]+[ \t]*\.[ \t]*){50}""", re.MULTILINE)


def toml_content(text: str) -> dict[str, Any]:
    """Return what a text in TOML says.

    Raises:
        ValueError: it is not TOML, it is nested too deeply, or a number has too many digits; the
            message says what to do.
    """
    if _DEEP_KEY.search(text):  # tomllib's time grows with the square of their number
        raise ValueError(_TOO_DEEP)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"this is not valid TOML: {error}; correct that line") from None
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    except ValueError as error:  # such as a number of more digits than Python reads
        raise ValueError(f"a value cannot be read ({error}); write a shorter one") from None
