"""Forces of members in a ground motion: the full model at draws of the posterior.

The motion is followed on the shapes that it drives, which are as many as the forces of the members
need up to a frequency; what is stiffer responds statically. Ends of beams and columns and cuts of
walls are rows over the displacements.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from femupdate.arrays import Floats, Integers
from femupdate.building.document import Building
from femupdate.building.kinds import ShearBuilding
from femupdate.building.wall_cuts import WallCut, wall_cut
from femupdate.dynamics.damping import DampingLaw, damping_law
from femupdate.dynamics.equations import SensorRows, driven_system
from femupdate.dynamics.history import displacement_histories
from femupdate.dynamics.summary import Statistics, statistics
from femupdate.dynamics.system import Rows
from femupdate.effects.effect import Placed, Terms
from femupdate.effects.registry import building_effects
from femupdate.effects.structure import Structure, structure_of
from femupdate.errors import BuildingError, StructureError
from femupdate.fe.assembly import AffineOperators
from femupdate.fe.elements.beam import Beams
from femupdate.fe.links import rigid_arms
from femupdate.fe.model import DOF_PER_NODE, FiniteElementModel, group_factors
from femupdate.progress import SILENT, Progress
from femupdate.study import write_text
from femupdate.workers import in_threads

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
        StructureError: there is no such beam.
    """
    beams = model.elements_of(Beams)
    if not 0 <= beam < len(beams):
        raise StructureError(f"there is no beam {beam}; the model has {len(beams)} beam elements")
    piece = beams.taken(np.array([beam]))
    rows = group_factors(piece.group, theta) * piece.force_rows(model.nodes)[0]
    full = np.zeros((len(rows), operators.dof))
    full[:, _dof(piece.nodes.ravel())] = rows
    return operators.gather(full.T).T


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
        StructureError: no element of these kinds rises from the nodes.
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
        for element, touched, matrix in zip(some.nodes, touches[chosen], stiffness, strict=True):
            arms = rigid_arms(model.nodes[element] - point)
            sums = np.zeros((DOF_PER_NODE, DOF_PER_NODE * len(element)))
            for corner in np.flatnonzero(touched):
                block = slice(DOF_PER_NODE * corner, DOF_PER_NODE * (corner + 1))
                sums[:, block] = arms[corner].T
            rows[:, _dof(element)] -= sums @ matrix
    if not found:
        raise StructureError(
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


Place = tuple[float, float, float]

_WITH_COLUMNS = tuple(f"{force}_with_columns" for force in WALL_FORCES)


@dataclass(frozen=True)
class CutMember:
    """A member cut where its forces are read: a beam element at its ends, a wall at its foot."""

    kind: str  # "beam", "column" or "wall"
    name: str  # of a wall, as asked for; where it lies, of a beam element
    ends: Floats  # (2, 3) first and second end, or start and end of the cut, m
    forces: tuple[str, ...]  # names of the k forces, such as "My_start", or "V"
    what: int | WallCut  # index of the beam element, or the cut

    def rows(self, model: FiniteElementModel, operators: AffineOperators, theta: Floats) -> Floats:
        """Rows over the displacements that give the forces, (k, n_free), N and N m."""
        if isinstance(self.what, WallCut):
            return wall_rows(model, operators, theta, self.what)
        return beam_end_rows(model, operators, theta, self.what)


@dataclass(frozen=True, eq=False)
class ChosenMembers:
    """Members with the full model that they belong to."""

    structure: Structure  # the full model
    added: tuple[tuple[Placed, Terms], ...]  # effects on it, each with its terms
    law: DampingLaw  # of its damping
    members: tuple[CutMember, ...]  # those chosen

    def rows(self, theta: Floats) -> tuple[Floats, ...]:
        """Rows (k, n) of every member's forces at stiffness factors theta (p,)."""
        mesh, operators = self.structure.meshed
        return tuple(member.rows(mesh.model, operators, theta) for member in self.members)


@dataclass(frozen=True)
class MemberForces:
    """The forces of one member over the draws; N, N m."""

    member: CutMember  # whose they are
    mean: Floats  # (k, n) histories
    sd: Floats
    peak: Statistics  # (k,) of the largest absolute value of each

    def as_dict(self) -> dict[str, Any]:
        """What `--json` holds."""
        member, peak = self.member, self.peak
        return {
            "kind": member.kind,
            "name": member.name,
            "ends_m": member.ends,
            "peak_n": self.named(peak.mean),
            "peak_q05_n": self.named(peak.q05),
            "peak_q95_n": self.named(peak.q95),
        }

    def named(self, values: Floats) -> dict[str, float]:
        """Values (k,) by the names of the forces."""
        return dict(zip(self.member.forces, values.tolist(), strict=True))


def choose_members(building: Building, wanted: Sequence[Place | str]) -> ChosenMembers:
    """Find members in a building's mesh.

    Args:
        building: a frame, or one with its own mesh. Its effects may move it in another way, but
            leave its members as they are.
        wanted: places, m, that mean the beam element whose axis is nearest, of several that whose
            middle is; and names of walls (see `wall_cut`).

    Raises:
        BuildingError: the building has no such member, or an effect that changes members, makes
            modes complex, or changes with the level of the motion.
    """
    structure = structure_of(building)
    if isinstance(building, ShearBuilding) or structure.mesh is None:
        raise BuildingError(f"{building.name}: a shear building has no members; leave them out")
    if building.has_dashpots:
        raise BuildingError(
            f"{building.name}: forces of members are not found beside dashpots, which make modes "
            "complex; leave members out"
        )
    placed = building_effects(building).placed
    added = tuple((listed, listed.effect.terms(structure, listed.place)) for listed in placed)
    for listed, terms in added:
        changed = bool(terms.stiffness) or terms.hinges is not None or terms.port is not None
        if changed or listed.effect.needs_levels:
            raise BuildingError(
                f"{building.name}: forces of members are not found beside the effect "
                f"{listed.label}, which changes members, makes modes complex or changes with "
                "the level of the motion; leave members out"
            )
    members = []
    for place in wanted:
        if isinstance(place, str):
            cut = wall_cut(building, structure.mesh, place)
            forces = WALL_FORCES + _WITH_COLUMNS if cut.has_columns else WALL_FORCES
            members.append(CutMember("wall", place, cut.ends, forces, cut))
        else:
            members.append(_nearest(building, structure.mesh.model, place))
    return ChosenMembers(structure, added, damping_law(building), tuple(members))


def _nearest(building: Building, model: FiniteElementModel, place: Place) -> CutMember:
    beams = model.elements_of(Beams)
    if not len(beams):
        raise BuildingError(f"{building.name}: there are neither beams nor columns; leave them out")
    start, stop = np.moveaxis(model.nodes[beams.nodes], 1, 0)
    along, since = stop - start, np.array(place) - start
    share = np.clip((since * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
    away = [np.linalg.norm(since - at * along, axis=1).round(6) for at in (0.5, share[:, None])]
    beam = int(np.lexsort(away)[0])
    (x, y, z), (a, b, c) = ends = np.array([start[beam], stop[beam]])
    name = f"({x:g}, {y:g}, {z:g}) to ({a:g}, {b:g}, {c:g}) m"
    return CutMember(str(beams.kind[beam]), name, ends, Beams.force_names, beam)


def member_forces(
    chosen: ChosenMembers,
    parameters: Floats,
    zeta: Floats,
    record: tuple[Floats, float],
    top_hz: float,
    progress: Progress = SILENT,
) -> tuple[MemberForces, ...]:
    """Forces of members at draws of the posterior.

    The full model is solved at every draw. What the motion causes is found, without the weight
    that is there before.

    Args:
        parameters: (S, p + q) stiffness factors, then sizes of the building's effects.
        record: acceleration of the base (n,), m/s2, along the sensors, and its time step, s.
        top_hz: up to where the response must be right; what is stiffer follows statically.
    """
    task = partial(_at_draw, chosen, record, top_hz)
    draws = list(zip(parameters, zeta.tolist(), strict=True))
    histories = np.stack(in_threads(task, draws, progress))
    starts = np.cumsum([len(member.forces) for member in chosen.members])[:-1]
    forces = []
    for member, forces_of in zip(chosen.members, np.split(histories, starts, axis=1), strict=True):
        over, peak = statistics(forces_of), statistics(np.abs(forces_of).max(axis=2))
        forces.append(MemberForces(member, over.mean, over.sd, peak))
    return tuple(forces)


def _at_draw(
    chosen: ChosenMembers, record: tuple[Floats, float], top_hz: float, draw: tuple[Floats, float]
) -> Floats:
    """Histories of all members' forces at one draw, (k, n)."""
    structure, law = chosen.structure, chosen.law
    theta, sizes = np.split(draw[0], [len(structure.stiffness_terms)])
    groups = chosen.rows(theta)
    seen = SensorRows(structure.floors, structure.floor_rows, structure.levels, groups)
    found = driven_system(structure, chosen.added, theta, sizes, top_hz, law, seen)
    shapes = torch.from_numpy(np.concatenate(groups) @ found.shapes)
    # A rigid motion of the base strains no member.
    rows = Rows(shapes, shapes.new_zeros(len(shapes), 3))
    sample = torch.from_numpy(sizes[None]), torch.tensor([draw[1]], dtype=torch.float64)
    return np.asarray(displacement_histories(found.system, sample, rows, *record)[0])


def write_member_forces(members: Sequence[MemberForces], time_step: float, path: Path) -> None:
    """Write mean and standard deviation as CSV: time, then two columns a force, with their units.

    Columns are named by the number of the member and the force: "1:V", "1:V_sd", "2:My_start", ...
    """
    named = [(k, name) for k, m in enumerate(members, 1) for name in m.member.forces]
    columns = [f"{k}:{name}{suffix}" for k, name in named for suffix in ("", "_sd")]
    units = ["N m" if name[0] in "TM" else "N" for _, name in named for _ in range(2)]
    pairs = [np.stack([member.mean, member.sd], axis=1) for member in members]
    values = np.concatenate(pairs).reshape(len(columns), -1).T
    lines = [",".join(["time_s", *columns]), ",".join(["s", *units])]
    lines += [
        ",".join([f"{time_step * n:.6g}", *(f"{value:.6g}" for value in row)])
        for n, row in enumerate(values)
    ]
    write_text(path, "\n".join(lines) + "\n")
