"""Archives of numpy arrays (npz): written whole or not at all, read without trust."""

import io
import math
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femupdate.atomic import write_bytes

_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


class ArchiveError(ValueError):
    """A file is no archive of arrays of numbers and text, or claims more than it may hold."""


def write_arrays(path: Path | str, **arrays: Any) -> None:
    """Write arrays by their names, without compression.

    Raises:
        StudyError: the file cannot be written.
    """
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    write_bytes(path, buffer.getvalue())


def read_arrays(path: Path | str, largest_bytes: float = math.inf) -> dict[str, NDArray[Any]]:
    """Read arrays by their names.

    Nothing is unpacked before the headers of all arrays have been checked, and no Python object is
    ever made of what the file says.

    Args:
        largest_bytes: that all arrays may have together.

    Raises:
        ArchiveError: the file is missing or damaged, or an array is of objects, claims more than
            the file holds, or makes all of them too large; the message names the array.
    """
    try:
        with open(path, "rb") as file:
            with zipfile.ZipFile(file) as archive:
                _check(archive, largest_bytes)
            file.seek(0)
            with np.load(file, allow_pickle=False) as content:
                return {name: content[name] for name in content.files}
    except ArchiveError:
        raise
    except Exception as error:  # a damaged file makes zipfile and numpy raise nearly anything
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise ArchiveError(f"this is no archive of numpy arrays ({reason})") from error


def _check(archive: zipfile.ZipFile, largest_bytes: float) -> None:
    """Refuse, before anything is unpacked, arrays that are too large or of objects."""
    total = 0
    for member in archive.infolist():
        with archive.open(member) as stream:
            shape, _, kind = _HEADERS[np.lib.format.read_magic(stream)](stream)
        if kind.hasobject:
            raise ArchiveError(
                f"{member.filename} holds Python objects, which could run a program when they are "
                "read"
            )
        size = math.prod(shape) * kind.itemsize
        total += max(size, member.file_size)
        if size > member.file_size or total > largest_bytes:
            raise ArchiveError(
                f"{member.filename} claims {size / 1e9:.3g} GB and holds "
                f"{member.file_size / 1e9:.3g}, too much or not what it claims"
            )


def check_shapes(arrays: Mapping[str, NDArray[Any]], shapes: Mapping[str, str]) -> None:
    """Make sure that arrays are there, finite and of shapes that go together.

    Args:
        shapes: of those that must be there, a letter an axis: axes of one letter have one length.

    Raises:
        ArchiveError: they are not; the message names the array.
    """
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
