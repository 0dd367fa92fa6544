"""Archives of numpy arrays, never of Python objects."""

from pathlib import Path

from femupdate.measurement.array_file import table_of_arrays
from femupdate.measurement.recording import Recording
from femupdate.measurement.text import TextFile
from femupdate.storage import LARGEST_BYTES, ArchiveError, read_arrays

READS = "archives of numpy arrays"


def recognises(head: str, suffix: str) -> bool:
    return suffix == ".npz"


def read(path: Path) -> Recording:
    """Arrays as the columns of a table."""
    file = TextFile(path, row_name="row")
    try:
        return table_of_arrays(file, read_arrays(path, LARGEST_BYTES))
    except ArchiveError as error:
        raise file.error(f"{error}; save the channels alone with numpy.savez") from None
