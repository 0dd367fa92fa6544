"""What every element hands to the assembly."""

from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats


@dataclass(frozen=True)
class ElementMatrices:
    """Element matrices in global axes, six degrees of freedom a node in the order of `DOF_NAMES`.

    Attributes:
        stiffness: (n, d, d) N/m, N and N m.
        mass: (n, d, d) kg, kg m and kg m2.
    """

    stiffness: Floats
    mass: Floats


def symmetric(matrices: Floats) -> Floats:
    """Remove the rounding asymmetry of matrices, (n, d, d) -> (n, d, d)."""
    return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))
