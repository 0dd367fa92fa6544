"""Names of the numpy arrays that the package passes around."""

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
