"""Names of the numpy arrays that the package passes around, and a repr of what holds them."""

from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Complexes = NDArray[np.complex128]
Integers = NDArray[np.int64]
Indices = NDArray[np.int32]  # sparse matrices: half the memory to move; 3e8 nodes are enough
Flags = NDArray[np.bool_]
Strings = NDArray[np.str_]
Pixels = NDArray[np.uint8]


def brief(self: Any) -> str:
    """A `__repr__` of a line or two: the fields that say something, arrays by their shape."""

    def told(value: Any) -> str:
        if hasattr(value, "shape"):
            return f"<{' x '.join(map(str, value.shape))}>"
        short = isinstance(value, tuple) and all(isinstance(each, str | float) for each in value)
        if short or isinstance(value, str | int | float | PurePath):
            return repr(value) if len(str(value)) < 60 else f"{str(value)[:56]!r}..."
        return type(value).__name__ + (f" of {len(value)}" if hasattr(value, "__len__") else "")

    fields = {k: v for k, v in vars(self).items() if k[0] != "_" and v is not None}
    said = [f"{key}={told(value)}" for key, value in fields.items()]
    return f"{type(self).__name__}({', '.join(said)})"
