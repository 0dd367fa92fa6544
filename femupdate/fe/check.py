"""Checks of a model's indices and shapes before anything is assembled."""

import numpy as np
from numpy.typing import ArrayLike

from femupdate.arrays import Integers
from femupdate.errors import ModelError
from femupdate.fe.element import Elements
from femupdate.fe.model import DOF_NAMES, FiniteElementModel, Springs

_LISTED = 8  # nodes named in a message before "and n more"


def check_model(model: FiniteElementModel) -> None:
    """Refuse a model whose parts do not fit together.

    Raises:
        ModelError: an index is out of range, a value is not finite, a node belongs to no element,
            a kind has two blocks, or no degree of freedom is free.
    """
    _check_nodes(model)
    _check_indices(model)
    _check_blocks(model)
    _check_springs_and_masses(model)
    _check_connected(model)


def _check_nodes(model: FiniteElementModel) -> None:
    bad = ~np.isfinite(model.nodes).all(axis=1)
    if bad.any():
        raise ModelError(f"{_nodes(np.flatnonzero(bad))} must have finite coordinates")
    if model.fixed.shape != (len(model.nodes), len(DOF_NAMES)):
        raise ModelError(
            f"`fixed` has shape {model.fixed.shape}; it needs one row of 6 flags for each of the "
            f"{len(model.nodes)} nodes"
        )
    if model.fixed.all():
        raise ModelError("every degree of freedom is held; free those that should move")


def _check_blocks(model: FiniteElementModel) -> None:
    names = [block.name for block in model.elements]
    double = [name for name in names if names.count(name) > 1]
    if double:
        raise ModelError(f"the model has {len(double)} blocks of {double[0]} elements; join them")
    grouped: tuple[Elements | Springs, ...] = (*model.elements, model.springs)
    for block in grouped:
        complaint = "belongs to parameter {}, but the model has {}, numbered from 0"
        groups = block.group
        _refuse(block.name, groups >= model.groups, complaint, groups, model.groups)


def _check_indices(model: FiniteElementModel) -> None:
    last = len(model.nodes) - 1
    springs, links = model.springs, model.links
    connected = (
        *((block.name, block.nodes, 0) for block in model.elements),
        ("point mass", model.masses.node[:, None], 0),
        (springs.name, springs.nodes[:, :1], 0),
        (springs.name, springs.nodes[:, 1:], -1),
        ("rigid link", np.stack([links.master, links.slave], axis=1), 0),
    )
    for name, nodes, lowest in connected:
        wrong = (nodes < lowest) | (nodes > last)
        named = nodes[np.arange(len(nodes)), wrong.argmax(axis=1)]
        complaint = "names node {}, but there are only nodes 0 to {}"
        _refuse(name, wrong.any(axis=1), complaint, named, last)


def _check_springs_and_masses(model: FiniteElementModel) -> None:
    springs, masses = model.springs, model.masses
    way = springs.direction
    directions = f"directions are 0 to 5 ({', '.join(DOF_NAMES)})"
    _refuse("spring", (way < 0) | (way >= len(DOF_NAMES)), f"acts along {{}}; {directions}", way)
    _refuse("spring", ~np.isfinite(springs.stiffness), "must have a finite stiffness")
    alone = springs.nodes[:, 0] == springs.nodes[:, 1]
    _refuse("spring", alone, "joins a node to itself; give two nodes")
    values = np.column_stack([masses.mass, masses.inertia])
    fine = ((values >= 0.0) & np.isfinite(values)).all(axis=1)
    _refuse("point mass", ~fine, "must have a finite mass and inertia, zero or positive")


def _refuse(name: str, bad: ArrayLike, complaint: str, *values: Integers | int) -> None:
    """Raise ModelError with the first that is bad (n,), and what the complaint says of it."""
    if np.any(bad):
        first = int(np.argmax(bad))
        shown = (value if isinstance(value, int) else value[first] for value in values)
        raise ModelError(f"{name} {first} {complaint.format(*shown)}")


def _check_connected(model: FiniteElementModel) -> None:
    lonely = np.ones(len(model.nodes), dtype=bool)
    connected = [block.nodes for block in model.elements]
    for nodes in [*connected, model.springs.nodes, model.links.master, model.links.slave]:
        lonely[nodes[nodes >= 0]] = False
    if lonely.any():
        raise ModelError(
            f"{_nodes(np.flatnonzero(lonely))} belong to no element, spring or link; remove them "
            "or connect them"
        )


def _nodes(indices: Integers) -> str:
    """Nodes by number, the first few of many."""
    named = ", ".join(map(str, indices[:_LISTED].tolist()))
    rest = len(indices) - _LISTED
    more = f" and {rest} more" if rest > 0 else ""
    return f"node{'s' if len(indices) > 1 else ''} {named}{more}"
