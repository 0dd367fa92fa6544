"""MATLAB files: arrays of numbers, of version 5 by scipy, of version 7.3 (HDF5) by h5py."""

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.errors import MeasurementError
from femupdate.measurement.array_file import table_of_arrays
from femupdate.measurement.recording import Recording
from femupdate.measurement.text import TextFile
from femupdate.storage import LARGEST_BYTES, read_file

READS = "MATLAB files"


def recognises(head: str, suffix: str) -> bool:
    return head.startswith("MATLAB ") or suffix == ".mat"


def read(path: Path) -> Recording:
    """Arrays, also in structures, as the columns of a table."""
    from scipy.io import loadmat, whosmat

    file = TextFile(path, row_name="row")
    with path.open("rb") as stream:
        hdf = stream.read(10) == b"MATLAB 7.3"
    if hdf:
        return table_of_arrays(file, _version_7_3(path))
    require_whole(read_file(path, LARGEST_BYTES, MeasurementError), LARGEST_BYTES)
    _require_moderate(path, [shape for _, shape, _ in whosmat(path)])
    content = loadmat(path, squeeze_me=True, struct_as_record=False)
    parts = [_flat(name, content[name]) for name in content if not name.startswith("__")]
    return table_of_arrays(file, {key: item for part in parts for key, item in part.items()})


def _flat(name: str, value: Any) -> dict[str, Any]:
    """A variable, or the fields of a structure by `name.field`."""
    fields = getattr(value, "_fieldnames", None)
    objects = isinstance(value, np.ndarray) and value.dtype.kind == "O"
    several = list(value.ravel()) if objects else []
    fields = getattr(several[0], "_fieldnames", None) if several else fields
    if several and fields:  # an array of structures: one field of all together
        try:
            stacked = {f: np.stack([getattr(e, f) for e in several], axis=-1) for f in fields}
        except (AttributeError, ValueError):  # of unlike shapes
            return {}
        return {f"{name}.{field}": array for field, array in stacked.items()}
    if fields is None:
        return {name: value}
    parts = [_flat(f"{name}.{field}", getattr(value, field)) for field in fields]
    return {key: item for part in parts for key, item in part.items()}


def _version_7_3(path: Path) -> dict[str, Any]:
    import h5py

    found: dict[str, Any] = {}

    def keep(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu" and item.size:
            found[name.replace("/", ".")] = item

    with h5py.File(path, "r") as content:
        content.visititems(keep)
        numbers = {name: item for name, item in found.items() if not name.startswith("#")}
        _require_moderate(path, [item.shape for item in numbers.values()])
        return {name: item[()] for name, item in numbers.items()}


def _require_moderate(path: Path, shapes: list[tuple[int, ...]]) -> None:
    # 16 bytes are those of a complex number.
    size = sum(int(np.prod(shape, dtype=object)) * 16 for shape in shapes)
    if size > LARGEST_BYTES:
        raise MeasurementError(
            f"{path}: the file holds {size / 1e9:.3g} GB of numbers; save the channels alone"
        )


_MATRIX, _PACKED = 14, 15
_TYPES = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13, _MATRIX, _PACKED, 16, 17, 18))


def require_whole(content: bytes, most: int) -> None:
    """Walk through all elements of a file: ValueError where one is damaged.

    Args:
        content: of the file; one of version 4 has no such elements and is left to scipy.
        most: bytes that packed elements may unpack to.
    """
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    left = most

    def check(data: bytes, depth: int) -> None:
        """All elements of a stretch, one after the other."""
        nonlocal left
        # Parts within parts are at most 50 levels deep.
        if depth > 50:
            raise ValueError("its structures are nested too deep")
        at = 0
        while at < len(data):
            if len(data) - at < 8:
                raise ValueError("an element is cut short")
            kind, size = struct.unpack_from(f"{order}II", data, at)
            small = kind >> 16  # bytes of data that stand in the tag itself, up to four
            kind &= 0xFFFF
            if kind not in _TYPES:
                raise ValueError(f"it holds data of a type that does not exist, {kind}")
            size = small or size
            if small > 4 or (not small and at + 8 + size > len(data)):
                raise ValueError("an element is cut short")
            body = data[at + 8 : at + 8 + size]
            if kind == _PACKED:
                body = zlib.decompressobj().decompress(body, left + 1)
                left -= len(body)
                if left < 0:
                    raise ValueError("its arrays unpack to more than a building's record needs")
            if kind in (_MATRIX, _PACKED) and not small:
                check(body, depth + 1)
            # Elements begin at multiples of eight bytes, but for what follows a packed one.
            at += 8 if small else 8 + size + (0 if kind == _PACKED else -size % 8)

    if order is not None:
        check(content[128:], 0)
