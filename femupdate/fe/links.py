"""Rigid links: slaves are eliminated from the equations by a transformation (no penalty)."""

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, identity

from femupdate.arrays import Floats, Integers
from femupdate.errors import StructureError
from femupdate.fe.model import DOF_NAMES, DOF_PER_NODE, FiniteElementModel, RigidLinks


def slave_dof(links: RigidLinks) -> Integers:
    """Degrees of freedom that follow a master, (m,) indices into 6N."""
    return (DOF_PER_NODE * links.slave[:, None] + np.arange(DOF_PER_NODE))[links.tied]


def rigid_arms(arm: Floats) -> Floats:
    """Motion at the end of rigid arms per unit motion of their foot, (n, 3) m -> (n, 6, 6).

    u' = u + r cross arm, r' = r.
    """
    matrix = np.tile(np.eye(DOF_PER_NODE), (len(arm), 1, 1))
    x, y, z = arm.T
    matrix[:, 0, 4], matrix[:, 0, 5] = z, -y
    matrix[:, 1, 5], matrix[:, 1, 3] = x, -z
    matrix[:, 2, 3], matrix[:, 2, 4] = y, -x
    return matrix


def link_expansion(model: FiniteElementModel) -> csr_matrix | None:
    """Motion of all degrees of freedom per unit of those that are no slaves, (6N, 6N).

    Columns of slaves are empty. None where there are no links.

    Raises:
        StructureError: a slave is held by a support or follows two masters, or links form a ring.
    """
    links = model.links
    if not len(links):
        return None
    if links.tied.shape != (len(links), DOF_PER_NODE) or links.slave.shape != links.master.shape:
        raise StructureError("rigid links need one master, one slave and a row of six flags each")
    slaves = slave_dof(links)
    distinct, times = np.unique(slaves, return_counts=True)
    _refuse(model, distinct[times > 1], "follows two masters; remove one of the rigid links")
    held = distinct[model.fixed.ravel()[distinct]]
    _refuse(model, held, "follows a master and is held by a support; remove one of the two")
    itself = DOF_PER_NODE * links.slave[links.slave == links.master]
    _refuse(model, itself, "follows itself; give the rigid link two nodes")
    arms = rigid_arms(model.nodes[links.slave] - model.nodes[links.master])
    link, row, column = np.nonzero(arms * links.tied[:, :, None])
    follow = coo_matrix(
        (
            arms[link, row, column],
            (DOF_PER_NODE * links.slave[link] + row, DOF_PER_NODE * links.master[link] + column),
        ),
        shape=(model.dof, model.dof),
    ).tocsr()
    free = np.ones(model.dof)
    free[slaves] = 0.0
    expansion = (identity(model.dof, format="csr").multiply(free) + follow).tocsr()
    # Masters may be slaves of masters; a real building has three of them at most.
    for _ in range(16):
        if not expansion[:, slaves].nnz:
            return expansion
        expansion = (expansion @ expansion).tocsr()
        expansion.eliminate_zeros()
    raise StructureError(
        f"the rigid links form a ring through node {slaves[0] // DOF_PER_NODE}; let every chain of "
        "links end in a node that follows no other"
    )


def _refuse(model: FiniteElementModel, dof: Integers, complaint: str) -> None:
    if len(dof):
        node, direction = divmod(int(dof[0]), DOF_PER_NODE)
        name = ("" if model.names is None else model.names[node]) or f"node {node}"
        raise StructureError(f"{DOF_NAMES[direction]} of {name} {complaint}")
