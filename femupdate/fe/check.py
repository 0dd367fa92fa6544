"""Checks of a model's indices and shapes before anything is assembled."""

import numpy as np

from femupdate.arrays import Integers
from femupdate.errors import ModelError
from femupdate.fe.model import (
    DOF_NAMES,
    Beams,
    FiniteElementModel,
    Shells,
    Springs,
    Triangles,
)

_LISTED = 8  # nodes named in a message before "and n more"


def check_model(model: FiniteElementModel) -> None:
    """Refuse a model whose parts do not fit together.

    Raises:
        ModelError: an index is out of range, a value is not finite, a node belongs to no element,
            or no degree of freedom is free.
    """
    _check_nodes(model)
    _check_indices(model)
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


def _check_indices(model: FiniteElementModel) -> None:
    count = len(model.nodes)
    connected = (
        ("shell", model.shells.nodes, 0),
        ("triangle", model.triangles.nodes, 0),
        ("beam", model.beams.nodes, 0),
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
    grouped: tuple[tuple[str, Shells | Triangles | Beams | Springs], ...] = (
        ("shell", model.shells),
        ("triangle", model.triangles),
        ("beam", model.beams),
        ("spring", model.springs),
    )
    for name, elements in grouped:
        bad = elements.group >= model.groups
        if bad.any():
            first = int(bad.argmax())
            raise ModelError(
                f"{name} {first} belongs to parameter {elements.group[first]}, but the model has "
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
    elements = (model.shells, model.triangles, model.beams, model.springs)
    for nodes in [part.nodes for part in elements] + [model.links.master, model.links.slave]:
        lonely[nodes[nodes >= 0]] = False
    if lonely.any():
        raise ModelError(
            f"{_nodes(np.flatnonzero(lonely))} belong to no shell, beam or spring; remove them or "
            "connect them"
        )


def _nodes(indices: Integers) -> str:
    """Nodes by number, the first few of many."""
    named = ", ".join(map(str, indices[:_LISTED].tolist()))
    rest = len(indices) - _LISTED
    return f"node{'s' if len(indices) > 1 else ''} {named}" + (
        f" and {rest} more" if rest > 0 else ""
    )
