"""Member forces in a ground motion: the full model at the posterior's mean, mode by mode."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from femupdate.building.mesh import mesh_building
from femupdate.building.schema import Building, ShearBuilding
from femupdate.dynamics.member_forces import BEAM_FORCES, beam_end_rows
from femupdate.dynamics.superposition import BaseMotion, displacement_history, superpose
from femupdate.errors import BuildingError
from femupdate.fe.assembly import assemble
from femupdate.fe.model import FiniteElementModel
from femupdate.study import write_text

Floats = NDArray[np.float64]
_UNITS = ("N", "N", "N", "N m", "N m", "N m")
_ENDS = ("start", "end")


@dataclass(frozen=True)
class MemberForces:
    """The end forces of one beam element.

    Attributes:
        kind: "beam" or "column".
        ends: (2, 3) where they are, m.
        peak: (12,) largest absolute value of each, first end and then second, in the order of
            `BEAM_FORCES`, N and N m.
        history: (12, n).
    """

    kind: str
    ends: Floats
    peak: Floats
    history: Floats

    def named_peaks(self) -> dict[str, float]:
        """Peaks by name, such as "My_start"."""
        names = [f"{force}_{end}" for end in _ENDS for force in BEAM_FORCES]
        return dict(zip(names, self.peak.tolist(), strict=True))


def member_forces(
    building: Building,
    theta: Floats,
    zeta: float | None,
    places: Sequence[tuple[float, float, float]],
    motion: BaseMotion,
    top_hz: float,
) -> tuple[MemberForces, ...]:
    """Forces at the ends of the beam elements nearest to some places.

    Args:
        building: a frame, or one with its own mesh.
        theta: (p,) stiffness factors.
        zeta: damping ratio of all modes; None for the building's own law.
        places: m; the element whose middle is nearest to a place is taken.
        motion: of the base, along the direction of the sensors.
        top_hz: modes below it are followed in time, the others statically.

    Raises:
        BuildingError: the building has no beams or columns.
        ModelError: the structure is a mechanism.
    """
    if isinstance(building, ShearBuilding):
        raise BuildingError(f"{building.name}: a shear building has no members; leave them out")
    mesh = mesh_building(building)
    model, operators = mesh.model, assemble(mesh.model)
    if not len(model.beams):
        raise BuildingError(f"{building.name}: there are neither beams nor columns; leave them out")
    structure = superpose(operators, theta, "xy"[mesh.direction], top_hz)
    beams = [_nearest(model, place) for place in places]
    rows = np.concatenate([beam_end_rows(model, operators, theta, beam) for beam in beams])
    ratio = building.damping.modal_ratio(structure.omega / (2.0 * np.pi)) if zeta is None else zeta
    history = displacement_history(structure, rows, ratio, motion).reshape(len(beams), 12, -1)
    return tuple(
        MemberForces(
            str(model.beams.kind[beam]),
            model.nodes[model.beams.nodes[beam]],
            np.abs(own).max(axis=1),
            own,
        )
        for beam, own in zip(beams, history, strict=True)
    )


def _nearest(model: FiniteElementModel, place: tuple[float, float, float]) -> int:
    middle = model.nodes[model.beams.nodes].mean(axis=1)
    return int(np.linalg.norm(middle - np.array(place), axis=1).argmin())


def write_member_forces(members: Sequence[MemberForces], time_step: float, path: Path) -> None:
    """Write histories as CSV: time, then the twelve forces of each member, with a row of units."""
    columns = [f"{k}:{name}" for k, m in enumerate(members, 1) for name in m.named_peaks()]
    units = list(_UNITS) * 2 * len(members)
    values = np.concatenate([member.history for member in members]).T
    lines = [",".join(["time_s", *columns]), ",".join(["s", *units])]
    lines += [
        ",".join([f"{time_step * n:.6g}", *(f"{value:.6g}" for value in row)])
        for n, row in enumerate(values)
    ]
    write_text(path, "\n".join(lines) + "\n")
