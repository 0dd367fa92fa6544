"""Finds a wall by its name, such as "X2:S1" or "X2:Y1-Y2:S1", in the mesh of a building."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.building.building_mesh import BuildingMesh
from femupdate.building.entry import unknown
from femupdate.building.kinds import FrameBuilding, MeshBuilding
from femupdate.building.references import resolve, wall_stretch
from femupdate.errors import BuildingError

_KINDS = ("wall", "non_structural_wall")
_NEAR = 1e-4  # m


@dataclass(frozen=True)
class WallCut:
    """A horizontal cut through a straight wall, at the foot of a story."""

    nodes: Integers  # of the wall in the story that is cut
    foot: Integers  # those of them that the cut runs through
    level: float  # of the cut, m
    ends: Floats  # (2, 3) start and end of the wall at that level, m
    has_columns: bool  # whether columns rise from the cut as well

    @property
    def axis(self) -> Floats:
        """(3,) unit vector from start to end."""
        along = self.ends[1] - self.ends[0]
        return np.asarray(along / np.linalg.norm(along))

    @property
    def middle(self) -> Floats:
        """(3,) middle of the wall's length, m."""
        return np.asarray(self.ends.mean(axis=0))


# A wall in one story: its story and nodes, and its ends in plan where the building file has them.
_Wall = tuple[int, Integers, Floats | None]


def wall_cut(building: FrameBuilding | MeshBuilding, mesh: BuildingMesh, name: str) -> WallCut:
    """Return the cut through the foot of a wall.

    Args:
        name: of a frame's wall, the grid line along which it stands, the two lines between which
            it stands (they may be left out where no other wall stands on that line in that story)
            and the story: "X2:Y1-Y2:S1" or "X2:S1". Of a read mesh's wall, the group and the story.

    Raises:
        BuildingError: no wall with stiffness has this name, several have, or it is not straight.
    """
    named = _frame_walls if isinstance(building, FrameBuilding) else _mesh_walls
    walls = dict(named(building, mesh))  # type: ignore[arg-type] # each takes its own kind
    wall = walls.get(name)
    if wall is not None:
        return _cut(mesh, wall, name)
    wanted = name.split(":")
    parts = {full: full.split(":") for full in walls}
    longer = [full for full, p in parts.items() if len(p) == 3 and [p[0], p[2]] == wanted]
    if len(longer) == 1:
        return _cut(mesh, walls[longer[0]], name)
    if longer:
        raise BuildingError(
            f"{building.name}: {len(longer)} walls stand along {wanted[0]} in {wanted[1]}: "
            f"{', '.join(longer)}; write one of them"
        )
    if isinstance(building, FrameBuilding) and any(
        wall.along == wanted[0] and not wall.is_stiff for wall in building.walls
    ):
        raise BuildingError(
            f"{building.name}: the wall {name} only weighs (its stiffness is false), so it carries "
            "nothing; name one with stiffness"
        )
    none = "it has no walls with stiffness; leave walls out"
    raise BuildingError(f"{building.name}: {unknown('wall', name, walls) if walls else none}")


def _cut(mesh: BuildingMesh, wall: _Wall, name: str) -> WallCut:
    story, nodes, corners = wall
    points = mesh.model.nodes[nodes]
    level = float(mesh.foot_level[story])
    foot = nodes[np.abs(points[:, 2] - level) < _NEAR]
    if not len(foot):
        raise BuildingError(
            f"the wall {name} has no nodes at the floor of its story, {level:g} m: it cannot be "
            "cut there"
        )
    plan = points[:, :2] if corners is None else corners
    centre = plan.mean(axis=0)
    _, _, (along, across) = np.linalg.svd(plan - centre, full_matrices=False)
    # The start has the lower x, or y.
    along = along if along[np.abs(along) > 1e-6][0] > 0.0 else -along
    place = (plan - centre) @ along
    # A straight wall bulges by less than a hundredth of its length.
    if np.abs((plan - centre) @ across).max() > 1e-2 * np.ptp(place):
        raise BuildingError(
            f"the wall {name} is not straight in plan, so no direction is in its plane; give each "
            "of its legs a group and a part of its own"
        )
    straight = centre + np.outer([place.min(), place.max()], along)
    ends = np.column_stack([straight, np.full(2, level)])
    columns = [part.nodes[part.kind == "column"] for part in mesh.model.elements]
    rises = any(
        (np.isin(column, foot).any(axis=1) & np.isin(column, nodes).all(axis=1)).any()
        for column in columns
    )
    return WallCut(nodes, foot, level, ends, rises)


def _frame_walls(building: FrameBuilding, mesh: BuildingMesh) -> Iterator[tuple[str, _Wall]]:
    """Yield the walls with stiffness, story by story, with their full names."""
    for number, wall in enumerate(building.walls):
        if not wall.is_stiff:
            continue
        run = wall_stretch(building.grid, wall, f"walls[{number}]")
        ends = np.empty((2, 2))
        ends[:, run.axis] = run.ends(building.grid)
        ends[:, 1 - run.axis] = (building.grid.y if run.axis == 0 else building.grid.x)[run.line]
        for name in resolve(wall.stories, building.story_names, "story", "stories"):
            story = building.story_names.index(name)
            low = np.array([*ends.min(axis=0), mesh.foot_level[story]]) - _NEAR
            high = np.array([*ends.max(axis=0), mesh.floor_level[story]]) + _NEAR
            inside = np.all((mesh.model.nodes > low) & (mesh.model.nodes < high), axis=1)
            chosen = [
                part.nodes[inside[part.nodes].all(axis=1) & np.isin(part.kind, _KINDS)].ravel()
                for part in mesh.model.elements
            ]
            nodes = np.unique(np.concatenate(chosen))
            yield f"{run.line}:{run.start}-{run.end}:{name}", (story, nodes, ends)


def _mesh_walls(building: MeshBuilding, mesh: BuildingMesh) -> Iterator[tuple[str, _Wall]]:
    """Yield the walls of a read mesh, each part in each story under each of its groups' names."""
    if mesh.parts is None:
        raise ValueError("a mesh that was read has parts")
    groups = [part.group for part in building.parts] or [(wall,) for wall in mesh.walls]
    for number, names in enumerate(groups):
        for story, name in enumerate(building.story_names):
            surfaces = [
                block.nodes[(owner == number) & (block.group == story) & (block.kind == "wall")]
                for block, owner in zip(mesh.model.elements, mesh.parts, strict=True)
            ]
            nodes_of_wall = np.unique(np.concatenate([nodes.ravel() for nodes in surfaces]))
            for group in names if len(nodes_of_wall) else ():
                yield f"{group}:{name}", (story, nodes_of_wall, None)
