"""Trees of data sets as netCDF files that are written whole or not at all."""

from pathlib import Path
from typing import Any

from femupdate.atomic import write_bytes


def write_tree(tree: Any, path: Path | str) -> None:
    """Write an xarray DataTree as netCDF, made in memory.

    Raises:
        StudyError: the file cannot be written.
    """
    # As bytes, not as a view of a BytesIO: where the traceback of a failed write keeps one, Python
    # 3.12.1 and 3.13.0 come down while they collect garbage.
    write_bytes(path, bytes(tree.to_netcdf(engine="h5netcdf")))
