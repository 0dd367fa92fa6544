"""A building's modes by OpenSees, as a truth for simulations."""

import contextlib
import importlib.util
import io
import threading
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.building import FrameBuilding, mesh_building
from femupdate.dynamics import ReducedModel
from femupdate.errors import ReportError
from femupdate.fe import FiniteElementModel, opensees_script

SHELLS = ("ASDShellQ4", "ShellMITC4")
_ONE_AT_A_TIME = threading.Lock()  # OpenSees knows one model in a process
_MODES = 160  # five times the top of the grid: with 70 a floor is off by 2 %


def opensees_model(
    building: FrameBuilding, theta: Floats, mesh_size: float, shell: str
) -> ReducedModel:
    """A model without parameters: the lowest modes that OpenSees finds, and its floors."""
    mesh = mesh_building(building, mesh_size)
    floors = [(floor, [int(node) for node in nodes]) for floor, nodes in mesh.floor_nodes.items()]
    return opensees_modes(mesh.model, theta, shell, mesh.direction, floors)


def opensees_modes(
    model: FiniteElementModel,
    theta: Floats,
    shell: str,
    direction: int,
    seen: Sequence[tuple[str, Sequence[int]]],
) -> ReducedModel:
    """The lowest modes that OpenSees finds of a model, as one without parameters."""
    if importlib.util.find_spec("openseespy") is None:
        raise ReportError("OpenSees makes this truth, and openseespy is missing; pip install it")
    script = opensees_script(model, theta, types={"shell": shell})
    names: dict[str, Any] = {"__name__": "opensees_model"}
    with _ONE_AT_A_TIME:
        exec(compile(script, "opensees_model.py", "exec"), names)
        names["build"]()
        frequency = np.array(names["frequencies"](_MODES, "SparseGeneral"))
        return _from_modes(names["ops"], direction, seen, frequency)


def _from_modes(
    ops: Any, direction: int, seen: Sequence[tuple[str, Sequence[int]]], frequency: Floats
) -> ReducedModel:
    axis, count = direction + 1, len(frequency)
    with contextlib.redirect_stdout(io.StringIO()):
        found: Mapping[str, Any] = ops.modalProperties("-return")
    share = np.array(found["partiFactorMX" if direction == 0 else "partiFactorMY"])
    floors = np.array(
        [
            [
                np.mean([ops.nodeEigenvector(node + 1, mode, axis) for node in nodes])
                for mode in range(1, count + 1)
            ]
            for _, nodes in seen
        ]
    )
    return ReducedModel(
        stiffness_terms=np.zeros((0, count, count)),
        stiffness_constant=np.diag((2.0 * np.pi * frequency) ** 2),
        excitation=share,
        floor_shapes=floors,
        floors=tuple(name for name, _ in seen),
        story_inertia=np.zeros((0, count)),
        story_mass=np.zeros(0),
        story_drift=np.zeros((0, count)),
    )
