"""Trees of data sets as netCDF files that are written whole or not at all."""

from pathlib import Path
from typing import Any

from femupdate.atomic import atomic_path


def write_tree(tree: Any, path: Path | str) -> None:
    """Write an xarray DataTree as netCDF.

    Raises:
        StudyError: the file cannot be written.
    """
    # HDF5 brings the whole process down where a disk fills up under an open file (h5py 3.16): the
    # file is made in memory, and what meets the disk is plain bytes.
    content = tree.to_netcdf(engine="h5netcdf")
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)
