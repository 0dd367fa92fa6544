"""Forces of members as rows over the displacements: ends of beams and columns, cuts of walls."""

from collections.abc import Iterable

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.building.wall_cuts import WallCut
from femupdate.errors import ModelError
from femupdate.fe.assembly import AffineOperators
from femupdate.fe.element import group_factors
from femupdate.fe.elements.beam import Beams
from femupdate.fe.links import rigid_arms
from femupdate.fe.model import DOF_PER_NODE, FiniteElementModel

_LEVEL = 1e-6  # m
WALL_FORCES = ("N", "V", "M")


def beam_end_rows(
    model: FiniteElementModel, operators: AffineOperators, theta: Floats, beam: int
) -> Floats:
    """Rows that give a beam element's end forces in its local axes, (12, n_free), N and N m.

    They are the forces that the joints put on the two ends (first end, then second end), each in
    the order of `Beams.force_names`; tension is negative at the first end and positive at the
    second. Inertia inside the element is left out, as in the equivalent static forces of any
    program.

    Raises:
        ModelError: there is no such beam.
    """
    beams = model.elements_of(Beams)
    if not 0 <= beam < len(beams):
        raise ModelError(f"there is no beam {beam}; the model has {len(beams)} beam elements")
    one = beams.taken(np.array([beam]))
    rows = group_factors(one.group, theta) * one.force_rows(model.nodes)[0]
    return _gathered(operators, rows, one.nodes)


def cut_rows(
    model: FiniteElementModel,
    operators: AffineOperators,
    theta: Floats,
    nodes: Integers,
    point: Floats,
    *,
    kinds: Iterable[str],
    below: float,
    within: Integers | None = None,
) -> Floats:
    """Rows that give the force through a horizontal cut, (6, n_free), N and N m in global axes.

    The cut runs through nodes of one level. What elements above it put on these nodes is summed
    up: it is what the part below carries, Fx, Fy, Fz, Mx, My and Mz, moments about a point.
    Inertia inside these elements is left out.

    Args:
        nodes: of the cut, such as those of a wall at a floor.
        point: (3,) m, such as the middle of the wall.
        kinds: of elements that count, such as ("wall",) or ("wall", "column").
        below: level of the cut, m: elements that rise from it count.
        within: nodes of the part that is cut: only elements that have no other node count. All
            where None.

    Raises:
        ModelError: no element of these kinds rises from the nodes.
    """
    wanted, rows = list(kinds), np.zeros((DOF_PER_NODE, operators.dof))
    found = False
    for elements in model.elements:
        corners = model.nodes[elements.nodes]
        rises = np.abs(corners[:, :, 2].min(axis=1) - below) < _LEVEL
        rises &= corners[:, :, 2].max(axis=1) > below + _LEVEL
        if within is not None:
            rises &= np.isin(elements.nodes, within).all(axis=1)
        touches = np.isin(elements.nodes, nodes)
        chosen = np.flatnonzero(rises & touches.any(axis=1) & np.isin(elements.kind, wanted))
        if not len(chosen):
            continue
        found = True
        some = elements.taken(chosen)
        stiffness = some.matrices(model.nodes).stiffness
        stiffness = group_factors(some.group, theta)[:, None, None] * stiffness
        for own, touched, matrix in zip(some.nodes, touches[chosen], stiffness, strict=True):
            arms = rigid_arms(model.nodes[own] - point)
            sums = np.zeros((DOF_PER_NODE, DOF_PER_NODE * len(own)))
            for corner in np.flatnonzero(touched):
                block = slice(DOF_PER_NODE * corner, DOF_PER_NODE * (corner + 1))
                sums[:, block] = arms[corner].T
            rows[:, _dof(own)] -= sums @ matrix
    if not found:
        raise ModelError(
            f"no element of kind {', '.join(wanted)} rises from the nodes of the cut at {below:g} m"
        )
    return operators.gather(rows.T).T


def wall_rows(
    model: FiniteElementModel, operators: AffineOperators, theta: Floats, cut: WallCut
) -> Floats:
    """Rows that give what a wall's part below a cut carries, (3 or 6, n_free), N and N m.

    In the order of `WALL_FORCES`, of the wall alone and, where columns stand in it or at its ends,
    of the wall together with them. N is positive in tension, V along the wall from its start to
    its end, and M about the middle of the wall where it stretches the start.
    """
    walls = ("wall", "non_structural_wall")
    parts = (walls, (*walls, "column")) if cut.has_columns else (walls,)
    upright = np.array([0.0, 0.0, 1.0])
    about = np.cross(upright, cut.axis)
    rows = []
    for kinds in parts:
        force, moment = np.split(
            cut_rows(
                model,
                operators,
                theta,
                cut.foot,
                cut.middle,
                kinds=kinds,
                below=cut.level,
                within=cut.nodes,
            ),
            2,
        )
        rows += [upright @ force, cut.axis @ force, about @ moment]
    return np.array(rows)


def _dof(nodes: Integers) -> Integers:
    return (DOF_PER_NODE * nodes[:, None] + np.arange(DOF_PER_NODE)).ravel()


def _gathered(operators: AffineOperators, rows: Floats, nodes: Integers) -> Floats:
    full = np.zeros((len(rows), operators.dof))
    full[:, _dof(nodes.ravel())] = rows
    return operators.gather(full.T).T
