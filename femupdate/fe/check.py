"""Checks of a model's indices and shapes before anything is assembled."""

import numpy as np

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
    _check_blocks(model)
    _check_indices(model)
    _check_groups(model)
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


def _check_indices(model: FiniteElementModel) -> None:
    count = len(model.nodes)
    connected = (
        *((block.name, block.nodes, 0) for block in model.elements),
        ("point mass", model.masses.node[:, None], 0),
        ("spring", model.springs.nodes[:, :1], 0),
        ("spring", model.springs.nodes[:, 1:], -1),
        ("rigid link", np.stack([model.links.master, model.links.slave], axis=1), 0),
    )
    for name, nodes, lowest in connected:
        bad = (nodes < lowest) | (nodes >= count)
        if bad.any():
            first, column = np.argwhere(bad)[0]
            raise ModelError(
                f"{name} {first} names node {nodes[first, column]}, but there are only nodes 0 to "
                f"{count - 1}"
            )


def _check_groups(model: FiniteElementModel) -> None:
    grouped: list[tuple[str, Elements | Springs]] = [
        *((block.name, block) for block in model.elements),
        ("spring", model.springs),
    ]
    for name, block in grouped:
        bad = block.group >= model.groups
        if bad.any():
            first = int(bad.argmax())
            raise ModelError(
                f"{name} {first} belongs to parameter {block.group[first]}, but the model has "
                f"{model.groups}, numbered from 0"
            )


def _check_springs_and_masses(model: FiniteElementModel) -> None:
    springs, masses = model.springs, model.masses
    bad = (springs.direction < 0) | (springs.direction >= len(DOF_NAMES))
    if bad.any():
        first = int(bad.argmax())
        raise ModelError(
            f"spring {first} acts along {springs.direction[first]}; directions are 0 to 5 "
            f"({', '.join(DOF_NAMES)})"
        )
    bad = ~np.isfinite(springs.stiffness)
    if bad.any():
        raise ModelError(f"spring {int(bad.argmax())} must have a finite stiffness")
    bad = springs.nodes[:, 0] == springs.nodes[:, 1]
    if bad.any():
        raise ModelError(f"spring {int(bad.argmax())} joins a node to itself; give two nodes")
    fine = (masses.mass >= 0.0) & np.isfinite(masses.mass)
    fine &= ((masses.inertia >= 0.0) & np.isfinite(masses.inertia)).all(axis=1)
    if not fine.all():
        raise ModelError(
            f"point mass {int((~fine).argmax())} must have a finite mass and "
            "inertia, zero or positive"
        )


def _check_connected(model: FiniteElementModel) -> None:
    lonely = np.ones(len(model.nodes), dtype=bool)
    own = [block.nodes for block in model.elements]
    for nodes in [*own, model.springs.nodes, model.links.master, model.links.slave]:
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
    return f"node{'s' if len(indices) > 1 else ''} {named}" + (
        f" and {rest} more" if rest > 0 else ""
    )
