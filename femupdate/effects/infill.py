"""Stiffness of walls that count as weight alone, on the existing nodes of the model.

The walls are meshed as if they were stiff. Their own nodes, inside and along free edges, are
condensed statically onto the nodes that they share with the model (Guyan, 1965).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve
from scipy.sparse import coo_matrix, csc_matrix
from scipy.spatial import cKDTree

from femupdate.building.building_mesh import BuildingMesh
from femupdate.building.kinds import FrameBuilding
from femupdate.building.mesh import mesh_building
from femupdate.building.references import resolve
from femupdate.fe.assembly import AffineOperators
from femupdate.fe.elements.shell import Shells
from femupdate.fe.model import DOF_PER_NODE, FiniteElementModel

_KIND = "non_structural_wall"
_SAME = 1e-6  # m, between nodes of the two meshes


@dataclass(frozen=True, eq=False)
class Infill:
    """A wall of one line and story: its stiffness (n_free, n_free) on free degrees of freedom."""

    line: str
    story: int
    stiffness: csc_matrix


def infill_lines(building: object) -> dict[str, tuple[int, ...]]:
    """Lines with walls that count as weight alone, each with its stories."""
    if not isinstance(building, FrameBuilding):
        return {}
    names = building.story_names
    lines: dict[str, set[int]] = {}
    for wall in building.walls:
        if not wall.is_stiff:
            chosen = resolve(wall.stories, names, "story", "walls.stories")
            lines.setdefault(wall.along, set()).update(names.index(story) for story in chosen)
    return {line: tuple(sorted(stories)) for line, stories in lines.items()}


def infills(
    building: FrameBuilding, mesh: BuildingMesh, operators: AffineOperators, mesh_size: float | None
) -> tuple[Infill, ...]:
    """All walls that count as weight alone, one for each line and story.

    Args:
        mesh, operators: of the building as it is.
        mesh_size: of that mesh, m; the building's own where None.
    """
    changed = tuple(wall.model_copy(update={"stiffness": True}) for wall in building.walls)
    stiff = mesh_building(building.model_copy(update={"walls": changed}), mesh_size).model
    known = cKDTree(mesh.model.nodes)
    shells, there, found = stiff.elements_of(Shells), mesh.model.elements_of(Shells), []
    corners, grid, new = shells.corners(stiff.nodes), building.grid, shells.kind == _KIND
    middles = mesh.model.nodes[there.nodes[there.kind == _KIND]].mean(axis=1)
    if len(middles):  # walls that the present model does not have
        new = new & (cKDTree(middles).query(corners.mean(axis=1))[0] > _SAME)
    for line, stories in infill_lines(building).items():
        axis, at = (1, grid.y[line]) if line in grid.y else (0, grid.x[line])
        here = new & (np.abs(corners[:, :, axis] - at) < _SAME).all(axis=1)
        for story in stories:
            walls = shells.taken(np.flatnonzero(here & (shells.group == story)))
            if len(walls):
                found.append(Infill(line, story, _condensed(stiff, walls, known, operators)))
    return tuple(found)


def _condensed(
    stiff: FiniteElementModel, walls: Shells, known: cKDTree, operators: AffineOperators
) -> csc_matrix:
    """Stiffness (n_free, n_free) of walls on the nodes that the present model has."""
    nodes, corners = np.unique(walls.nodes, return_inverse=True)
    corners = corners.reshape(len(walls), -1)
    elements = walls.matrices(stiff.nodes).stiffness
    dofs = (DOF_PER_NODE * corners[:, :, None] + np.arange(DOF_PER_NODE)).reshape(len(walls), -1)
    stiffness = np.zeros((DOF_PER_NODE * len(nodes),) * 2)
    np.add.at(stiffness, (dofs[:, :, None], dofs[:, None, :]), elements)
    distance, place = known.query(stiff.nodes[nodes])
    shared = np.repeat(distance < _SAME, DOF_PER_NODE)
    alone = ~shared & ~stiff.fixed[nodes].ravel()
    inner = stiffness[np.ix_(alone, alone)]
    coupling = stiffness[np.ix_(alone, shared)]
    rest = stiffness[np.ix_(shared, shared)]
    if alone.any():
        rest = rest - coupling.T @ solve(inner, coupling, assume_a="pos")
    number = DOF_PER_NODE * place[:, None] + np.arange(DOF_PER_NODE)
    rows, columns = np.meshgrid(*[number.ravel()[shared]] * 2, indexing="ij")
    entries = (0.5 * (rest + rest.T)).ravel(), (rows.ravel(), columns.ravel())
    return onto_free(csc_matrix(coo_matrix(entries, shape=(operators.dof,) * 2)), operators)


def onto_free(full: csc_matrix, operators: AffineOperators) -> csc_matrix:
    """A matrix (6N, 6N) on the independent degrees of freedom."""
    if operators.expansion is None:
        return csc_matrix(full[operators.free][:, operators.free])
    return csc_matrix(operators.expansion.T @ full @ operators.expansion)
