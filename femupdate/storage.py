"""Files: written whole or not at all, read without trust. Archives of arrays and netCDF among them.

Nothing heavy is imported here before it is used, so that commands start at once.
"""

import contextlib
import errno
import io
import math
import mmap
import os
import re
import secrets
import stat
import struct
import tomllib
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femupdate.errors import FemupdateError, StudyError

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Of arrays, archives and meshes: a million nodes and as many shells take a fifth of it, a station
# archive some tens of MB; a table of arrays takes three times as much memory.
LARGEST_BYTES = 500_000_000


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
        mend = "correct that line"
        if any(word in str(error) for word in ("Unescaped", "hex value", "Escaped")):
            mend = "in double quotes a backslash starts a special character: write / in its place"
        raise ValueError(f"this is not valid TOML: {error}; {mend}") from None
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    except ValueError as error:  # such as a number of more digits than Python reads
        raise ValueError(f"a value cannot be read ({error}); write a shorter one") from None


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
    except OSError as error:
        raise failure(write_failure(path, error)) from error
    except FemupdateError:
        raise
    except Exception as error:
        number = _NUMBER.search(str(error))
        if number is None:
            raise
        reported = OSError(int(number[1]), os.strerror(int(number[1])))
        raise failure(write_failure(path, reported)) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_bytes(path: Path | str, content: bytes) -> None:
    """Write a binary file atomically.

    Libraries that write their own formats should do so in memory, and leave the disk to this: HDF5
    brings the process down where a disk fills up under an open file (h5py 3.16).

    Raises:
        StudyError: the file cannot be written.
    """
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def write_text(path: Path | str, text: str, failure: type[FemupdateError] = StudyError) -> Path:
    """Write a UTF-8 text file atomically, and return its path.

    Raises:
        FemupdateError: of that kind, where it cannot be written.
    """
    with atomic_path(path, failure) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return Path(path)


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


class ArchiveError(ValueError):
    """A file is no archive of arrays of numbers and text, or claims more than it may hold."""


def write_arrays(path: Path | str, **arrays: Any) -> None:
    """Write arrays by their names, without compression.

    Raises:
        StudyError: the file cannot be written.
    """
    import numpy as np

    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    write_bytes(path, buffer.getvalue())


def read_arrays(path: Path | str, largest_bytes: float = math.inf) -> "dict[str, NDArray[Any]]":
    """Read arrays by their names.

    Nothing is unpacked before the headers of all arrays have been checked, and no Python object is
    ever made of what the file says.

    Args:
        largest_bytes: that all arrays may have together.

    Raises:
        ArchiveError: the file is missing or damaged, or an array is of objects, claims more than
            the file holds, or makes all of them too large; the message names the array.
    """
    import numpy as np
    from numpy.lib import format as npy

    headers = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
    try:
        with open(path, "rb") as file:
            with zipfile.ZipFile(file) as archive:
                total = 0
                for member in archive.infolist():
                    with archive.open(member) as stream:
                        shape, _, kind = headers[npy.read_magic(stream)](stream)
                    if kind.hasobject:
                        raise ArchiveError(
                            f"{member.filename} holds Python objects, which could run a program "
                            "when they are read"
                        )
                    size = math.prod(shape) * kind.itemsize
                    total += max(size, member.file_size)
                    if size > member.file_size or total > largest_bytes:
                        raise ArchiveError(
                            f"{member.filename} claims {size / 1e9:.3g} GB and holds "
                            f"{member.file_size / 1e9:.3g}, too much or not what it claims"
                        )
            file.seek(0)
            with np.load(file, allow_pickle=False) as content:
                return {name: content[name] for name in content.files}
    except ArchiveError:
        raise
    except Exception as error:  # a damaged file makes zipfile and numpy raise nearly anything
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise ArchiveError(f"this is no archive of numpy arrays ({reason})") from error


def check_shapes(arrays: "Mapping[str, NDArray[Any]]", shapes: Mapping[str, str]) -> None:
    """Make sure that arrays are there, finite and of shapes that go together.

    Args:
        shapes: of those that must be there, a letter an axis: axes of one letter have one length.

    Raises:
        ArchiveError: they are not; the message names the array.
    """
    import numpy as np

    lengths: dict[str, int] = {}
    for name, axes in shapes.items():
        if name not in arrays:
            raise ArchiveError(f"{name} is missing")
        array = arrays[name]
        fits = array.ndim == len(axes) and array.dtype.kind in "fiub"
        if not fits or any(
            lengths.setdefault(axis, length) != length
            for axis, length in zip(axes, array.shape, strict=True)
        ):
            raise ArchiveError(f"{name} has the shape {array.shape}")
        if not np.isfinite(array).all():
            raise ArchiveError(f"{name} holds a value that is no number")


_HEAP = b"GCOL\x01\0\0\0"  # begins a heap of HDF5, in which it keeps texts
_OBJECT = struct.Struct("<H6xQ")  # number and size of what is in it; 0 is the free space


def write_tree(tree: Any, path: Path | str) -> None:
    """Write an xarray DataTree as netCDF, made in memory.

    Raises:
        StudyError: the file cannot be written.
    """
    # As bytes, not as a view of a BytesIO: where the traceback of a failed write keeps one, Python
    # 3.12.1 and 3.13.0 come down while they collect garbage.
    write_bytes(path, bytes(tree.to_netcdf(engine="h5netcdf")))


def read_tree(path: Path) -> Any:
    """Read an xarray DataTree into memory.

    Raises:
        Exception: of any kind, as damaged bytes make HDF5 and its layers raise.
    """
    import h5py
    import xarray as xr

    refuse_endless(path)
    # h5netcdf complains on stderr about files that HDF5 refuses: let HDF5 see them first.
    with h5py.File(path, "r") as file:
        list(file.attrs.items())
    with xr.open_datatree(path, engine="h5netcdf") as tree:
        return tree.load()


def refuse_endless(path: Path) -> None:
    """Refuse a file of HDF5 in which free space of a heap has no size: HDF5 would read for ever.

    Raises:
        ValueError: what is in a heap does not add up.
    """
    if not path.stat().st_size:
        return
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        at, head = data.find(_HEAP), _OBJECT.size
        while at >= 0:
            end = min(at + int.from_bytes(data[at + 8 : at + head], "little"), len(data))
            place = at + head
            while place + head <= end:
                number, size = _OBJECT.unpack_from(data, place)
                # The size of the free space holds its own head; others are filled up to eight.
                step = head + -(-size // 8) * 8 if number else size
                if not head <= step <= end - place:
                    raise ValueError("a heap of texts in it is damaged")
                place += step
            at = data.find(_HEAP, at + len(_HEAP))
