"""Whether the elements of a MATLAB file of version 5 are whole, before scipy reads them.

After "MAT-File Format" of The MathWorks. scipy takes the type of an element for the place of a
pointer, so that one that does not exist ends the process.
"""

import struct
import zlib

from femupdate.measurement.thresholds import FILES

_HEADER, _ORDER = 128, slice(126, 128)  # bytes
_MATRIX, _PACKED = 14, 15
_TYPES = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13, _MATRIX, _PACKED, 16, 17, 18))
_SMALL = 4  # bytes of data that fit into a tag


def require_whole(content: bytes, most: int) -> None:
    """Walk through all elements of a file.

    Args:
        content: of the file; one of version 4 has no such elements and is left to scipy.
        most: bytes that packed elements may unpack to.

    Raises:
        ValueError: one is cut short, of no known type, nested too deep, or unpacks to too much.
    """
    order = {b"IM": "<", b"MI": ">"}.get(content[_ORDER])
    if order is not None:
        _Elements(order, most).check(content[_HEADER:], 0)


class _Elements:
    def __init__(self, order: str, most: int) -> None:
        self._order, self._left = order, most

    def check(self, data: bytes, depth: int) -> None:
        """All elements of a stretch, one after the other."""
        if depth > FILES.nested:
            raise ValueError("its structures are nested too deep")
        at = 0
        while at < len(data):
            if len(data) - at < 8:
                raise ValueError("an element is cut short")
            kind, size = struct.unpack_from(f"{self._order}II", data, at)
            small = kind >> 16
            kind &= 0xFFFF
            if kind not in _TYPES:
                raise ValueError(f"it holds data of a type that does not exist, {kind}")
            if small:
                size = small
            if (small and size > _SMALL) or (not small and at + 8 + size > len(data)):
                raise ValueError("an element is cut short")
            body = data[at + 8 : at + 8 + size]
            if kind == _PACKED:
                body = self._unpacked(body)
            if kind in (_MATRIX, _PACKED) and not small:
                self.check(body, depth + 1)
            # Elements begin at multiples of eight bytes, but for what follows a packed one.
            at += 8 if small else 8 + size + (0 if kind == _PACKED else -size % 8)

    def _unpacked(self, data: bytes) -> bytes:
        found = zlib.decompressobj().decompress(data, self._left + 1)
        self._left -= len(found)
        if self._left < 0:
            raise ValueError("its arrays unpack to more than a building's record needs")
        return found
