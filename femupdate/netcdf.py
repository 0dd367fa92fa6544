"""Trees of data sets as netCDF files that are written whole or not at all."""

from pathlib import Path
from typing import Any

from femupdate.atomic import write_bytes


def write_tree(tree: Any, path: Path | str) -> None:
    """Write an xarray DataTree as netCDF, made in memory.

    Raises:
        StudyError: the file cannot be written.
    """
    write_bytes(path, tree.to_netcdf(engine="h5netcdf"))
