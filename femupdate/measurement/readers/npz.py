"""Archives of numpy arrays, never of Python objects."""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.errors import MeasurementError
from femupdate.measurement.array_file import LARGEST_BYTES, table_of_arrays
from femupdate.measurement.reader import Reader
from femupdate.measurement.recording import Recording
from femupdate.measurement.text import TextFile

_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


def _recognises(head: str, suffix: str) -> bool:
    return suffix == ".npz"


def _read(path: Path) -> Recording:
    """Arrays as the columns of a table.

    Raises:
        MeasurementError: the file is damaged, too large or holds objects, or see
            `table_of_arrays`.
    """
    file = TextFile(path, row_name="row")
    try:
        with zipfile.ZipFile(path) as archive:
            for member in archive.infolist():
                _check(file, archive, member)
        with np.load(path, allow_pickle=False) as content:
            arrays: dict[str, Any] = {name: content[name] for name in content.files}
    except MeasurementError:
        raise
    except Exception as error:  # a damaged file makes zipfile and numpy raise nearly anything
        raise file.error(
            f"this is no archive of numpy arrays ({error}); save it again with numpy.savez"
        ) from None
    return table_of_arrays(file, arrays)


def _check(file: TextFile, archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> None:
    """Refuse, before anything is unpacked, an array that is too large or of objects."""
    with archive.open(member) as stream:
        shape, _, kind = _HEADERS[np.lib.format.read_magic(stream)](stream)
    size = int(np.prod(shape, dtype=object)) * kind.itemsize
    if kind.hasobject:
        raise file.error(
            f"{member.filename} holds Python objects, which could run a program when they are"
            " read; save plain arrays of numbers"
        )
    if max(size, member.file_size) > LARGEST_BYTES or size > member.file_size:
        raise file.error(
            f"{member.filename} claims {size / 1e9:.3g} GB and holds {member.file_size / 1e9:.3g};"
            " save the channels alone"
        )


READER = Reader("npz", "archives of numpy arrays", _recognises, _read)
