"""Forces inside elements, from displacements."""

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.errors import ModelError
from femupdate.fe.element import Elements, group_factors
from femupdate.fe.model import FiniteElementModel


def element_forces(
    model: FiniteElementModel,
    elements: Elements,
    displacement: Floats,
    theta: Floats,
    chosen: Integers | None = None,
) -> Floats:
    """Forces inside the elements of one block, (n, r), in the order of their `force_names`.

    Args:
        displacement: (6N,) or (N, 6), m and rad.
        theta: (p,) stiffness parameters.
        chosen: (n,) which elements of the block; default all.

    Raises:
        ModelError: the displacement has another size, or elements of this kind give no forces.
    """
    motion = np.asarray(displacement, dtype=float)
    if motion.size != model.dof:
        raise ModelError(
            f"the displacement has {motion.size} values; the model has {model.dof} degrees of "
            "freedom, six per node"
        )
    some = elements if chosen is None else elements.taken(chosen)
    moved = motion.reshape(-1, 6)[some.nodes].reshape(len(some), -1)
    rows = some.force_rows(model.nodes)
    return np.einsum("n,nrd,nd->nr", group_factors(some.group, theta), rows, moved, optimize=True)
