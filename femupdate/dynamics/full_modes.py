"""The lowest modes of a full model at factors 1, numbered once and for all, and what they move.

Every other part of the program takes the number of a mode from here: a reduced model lacks the
modes that the base motion does not excite, so its own count would give other numbers.
"""

from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats
from femupdate.dynamics.reduced import ReducedModel
from femupdate.dynamics.tracking import node_displacements, reduced_modes
from femupdate.effects.structure import Structure
from femupdate.fe.assembly import AffineOperators
from femupdate.fe.solve import lowest_modes

X, Y, TORSION, SLABS = "X", "Y", "torsion", "slabs"
_LEAST, _KEPT = 12, 80  # modes of a mesh; 80 of the six-story example fill its frequency grid
_SAME = 0.5  # modal assurance criterion above which two shapes are of one mode
_LEVEL = 1e-3  # of the height: nodes this near to a floor's level belong to it


@dataclass(frozen=True, eq=False)
class FullModes:
    """The k lowest modes; mode number n is entry n - 1.

    Attributes:
        frequency_hz: (k,).
        shapes: (k, d) displacements of the nodes, three a node; of a stick its coordinates.
        effective_mass: (k, 2) share of the mass that a motion along x and along y moves.
        direction: (k,) what moves most: "X", "Y", "torsion" or "slabs".
    """

    frequency_hz: Floats
    shapes: Floats
    effective_mass: Floats
    direction: tuple[str, ...]

    def direction_of(self, number: int | None) -> str:
        """What moves most in a mode; empty where it has no number."""
        return "" if number is None else self.direction[number - 1]

    def numbers_of(self, model: ReducedModel, vectors: Floats) -> list[int | None]:
        """Numbers of reduced modes (r, m), None of one that resembles none of the full ones."""
        shapes = compared_shapes(model, vectors.T)
        product = np.abs(_unit(shapes) @ _unit(self.shapes).T) ** 2
        best = product.argmax(axis=1)
        return [
            int(k) + 1 if value[k] >= _SAME else None
            for k, value in zip(best, product, strict=True)
        ]


def compared_shapes(model: ReducedModel, vectors: Floats) -> Floats:
    """What is compared of reduced modes (m, r): all displacements (m, d)."""
    if model.node_shapes is None:
        return vectors
    return np.asarray(node_displacements(model, vectors).reshape(len(vectors), -1))


def _unit(rows: Floats) -> Floats:
    return np.asarray(rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-300))


def stick_modes(model: ReducedModel, direction: int = 0) -> FullModes:
    """All modes of a stick, which is its own reduced model."""
    found = reduced_modes(model, np.ones((1, model.parameters)))
    vectors = found.vectors[0]
    share = (model.excitation @ vectors) ** 2 / float(model.excitation @ model.excitation)
    mass = np.zeros((len(share), 2))
    mass[:, direction] = share
    names = ((X, Y)[direction],) * len(share)
    return FullModes(found.frequency_hz[0], vectors.T, mass, names)


def mesh_modes(structure: Structure) -> FullModes:
    """The lowest modes of a structure that has a mesh.

    Raises:
        ModelError: it is a mechanism.
    """
    mesh, operators = structure.mesh, structure.operators
    assert mesh is not None
    assert operators is not None
    count = max(_LEAST, min(_KEPT, len(operators.free) // 8))
    modes = lowest_modes(operators, np.ones(operators.parameters), count)
    full = operators.expand(modes.shapes).reshape(len(operators.nodes), 6, -1)[:, :3]
    shapes = np.moveaxis(full, 2, 0)
    mass = np.column_stack([_effective(operators, modes.shapes, axis) for axis in (0, 1)])
    levels = operators.nodes[:, 2].min() + np.asarray(structure.levels)
    nodal = (operators.mass_full @ operators.rigid_translation(0)).reshape(-1, 6)[:, 0]
    return FullModes(
        modes.frequency_hz,
        shapes.reshape(len(shapes), -1),
        mass,
        tuple(_direction(shape, operators.nodes, nodal, levels) for shape in shapes),
    )


def _effective(operators: AffineOperators, shapes: Floats, axis: int) -> Floats:
    """Share (k,) of the whole mass, that of the supports included, in each mode."""
    rigid = operators.rigid_translation(axis)
    total = float(rigid @ (operators.mass_full @ rigid))
    return np.asarray((shapes.T @ operators.inertia(axis)) ** 2 / total)


def _direction(shape: Floats, nodes: Floats, mass: Floats, levels: Floats) -> str:
    """What most of the floors' kinetic energy is: of floors as rigid plates, or of their bending.

    Args:
        shape: (N, 3) displacement of the nodes.
        nodes: (N, 3) m.
        mass: (N,) kg.
        levels: (f,) heights of the floors, m.
    """
    near = _LEVEL * max(float(np.ptp(nodes[:, 2])), 1e-9)
    energy = np.zeros(4)
    for level in levels:
        on = (np.abs(nodes[:, 2] - level) < near) & (mass > 0.0)
        if on.any():
            energy += _plate(shape[on], nodes[on, :2], mass[on])
    return (X, Y, TORSION, SLABS)[int(energy.argmax())]


def _plate(moved: Floats, plan: Floats, mass: Floats) -> Floats:
    """Twice the kinetic energy along x, along y, about z, and of the rest, at unit frequency."""
    total = mass.sum()
    arm = plan - mass @ plan / total
    mean = mass @ moved[:, :2] / total
    inertia = float(mass @ (arm**2).sum(axis=1))
    moment = float(mass @ (arm[:, 0] * moved[:, 1] - arm[:, 1] * moved[:, 0]))
    turned = moment**2 / inertia if inertia > 0.0 else 0.0
    rigid = np.array([total * mean[0] ** 2, total * mean[1] ** 2, turned])
    everything = float(mass @ (moved**2).sum(axis=1))
    return np.append(rigid, max(everything - rigid.sum(), 0.0))
