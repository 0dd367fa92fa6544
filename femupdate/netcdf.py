"""Trees of data sets as netCDF files that are written whole or not at all, and read with care."""

import mmap
import struct
from pathlib import Path
from typing import Any

from femupdate.atomic import write_bytes

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
        at = data.find(_HEAP)
        while at >= 0:
            _check_heap(data, at)
            at = data.find(_HEAP, at + len(_HEAP))


def _check_heap(data: mmap.mmap, at: int) -> None:
    head = _OBJECT.size
    end = min(at + int.from_bytes(data[at + 8 : at + head], "little"), len(data))
    place = at + head
    while place + head <= end:
        number, size = _OBJECT.unpack_from(data, place)
        # The size of the free space holds its own head; others are filled up to eight bytes.
        step = head + -(-size // 8) * 8 if number else size
        if not head <= step <= end - place:
            raise ValueError("a heap of texts in it is damaged")
        place += step
