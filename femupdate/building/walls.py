"""Walls of a frame building, one piece a story, and slabs: blocks of shells, or weight alone."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Flags, Floats, Integers
from femupdate.building.blocks import ElementBlock
from femupdate.building.entry import Complaint
from femupdate.building.frame import FrameBuilding
from femupdate.building.lattice import ExtraLines, Lattice, quadrilaterals
from femupdate.building.members import Wall
from femupdate.building.references import Stretch, resolve, slab_lines, wall_stretch
from femupdate.fe.elements.shell import Shells


@dataclass(frozen=True)
class DeadWall:
    """A wall of one story that only weighs.

    Attributes:
        above, below: (n,) crossings along the wall on the floor above and below (below is empty
            on the ground).
        share: (n,) mass for each of those, kg: half of the wall's in all.
    """

    key: str
    group: int
    above: Integers
    below: Integers
    share: Floats

    @property
    def mass(self) -> float:
        """Mass of the whole wall, kg."""
        return 2.0 * float(self.share.sum())


@dataclass(frozen=True)
class _WallStory:
    """A wall in one story.

    Attributes:
        key: the entry of the file it comes from.
        wall: that entry.
        run: the stretch of the grid line under it.
        group: index of the story.
        openings: (n, 4) sides of each opening, m: along the wall from and to, up from and to.
    """

    key: str
    wall: Wall
    run: Stretch
    group: int
    openings: Floats

    def sheet(self, lattice: Lattice) -> Integers:
        """Crossings (points along the wall, levels)."""
        return lattice.along(self.run, lattice.story(self.group))

    def is_open(self, lattice: Lattice, nodes: Integers) -> Flags:
        """Which elements (n, 4) lie in an opening."""
        middle = lattice.coordinates(nodes.ravel()).reshape(-1, 4, 3).mean(axis=1)
        along, up = middle[:, [self.run.axis]], middle[:, [2]]
        left, right, bottom, top = self.openings.T
        inside = (along > left) & (along < right) & (up > bottom) & (up < top)
        return np.asarray(inside.any(axis=1))


def _wall_stories(building: FrameBuilding) -> Iterator[_WallStory]:
    bottom = building.floor_levels - [story.height for story in building.stories]
    for number, wall in enumerate(building.walls):
        key = f"walls[{number}]"
        run = wall_stretch(building.grid, wall, key)
        start, _ = run.ends(building.grid)
        stories = resolve(wall.stories, building.story_names, "story", f"{key}.stories")
        for story in stories:
            group = building.story_names.index(story)
            sides = [
                (o.left + start, o.left + start + o.width, low, low + o.height)
                for o in wall.openings
                if story in resolve(o.stories, stories, "story", "stories")
                for low in [float(bottom[group]) + o.bottom]
            ]
            openings = np.array(sides).reshape(-1, 4)
            yield _WallStory(key, wall, run, group, openings)


def wall_blocks(building: FrameBuilding, lattice: Lattice) -> Iterator[ElementBlock]:
    """Yield the walls that have stiffness, one block a story, without what is open.

    Raises:
        Complaint: the openings leave nothing of a wall.
    """
    for part in _wall_stories(building):
        if not part.wall.is_stiff:
            continue
        nodes = quadrilaterals(part.sheet(lattice))
        open_ = part.is_open(lattice, nodes)
        if open_.all():
            story = building.story_names[part.group]
            text = f"the openings leave nothing of the wall in story {story}; make them smaller"
            raise Complaint(f"{part.key}.openings", text)
        yield ElementBlock(
            key=part.key,
            element=Shells,
            nodes=nodes[~open_],
            group=part.group,
            kind="wall" if part.wall.role == "shear" else "non_structural_wall",
            thickness=part.wall.thickness,
            material=building.material(part.wall.material),
        )


def opening_lines(building: FrameBuilding) -> ExtraLines:
    """Return the mesh lines through the sides of openings."""
    lines = ExtraLines()
    for part in _wall_stories(building):
        for left, right, bottom, top in part.openings.tolist():
            along = {"xy"[part.run.axis]: (left, right)}
            lines += ExtraLines(**along, z=(bottom, top))
    return lines


def dead_walls(building: FrameBuilding, lattice: Lattice) -> Iterator[DeadWall]:
    """Yield the walls whose weight alone counts, one a story."""
    for part in _wall_stories(building):
        if part.wall.is_stiff:
            continue
        sheet = part.sheet(lattice)
        widths = np.diff(lattice.coordinates(sheet[:, 0])[:, part.run.axis])
        tributary = (np.append(widths, 0.0) + np.append(0.0, widths)) / 2.0
        area_density = building.material(part.wall.material).density * part.wall.thickness
        height = building.stories[part.group].height * _closed_share(part, lattice, sheet)
        yield DeadWall(
            key=part.key,
            group=part.group,
            above=sheet[:, -1],
            below=sheet[:0, 0] if part.group == 0 else sheet[:, 0],
            share=area_density * height * tributary / 2.0,
        )


def _closed_share(part: _WallStory, lattice: Lattice, sheet: Integers) -> float:
    """Return how much of a wall's area no opening takes."""
    nodes = quadrilaterals(sheet)
    corners = lattice.coordinates(nodes.ravel()).reshape(-1, 4, 3)
    area = np.ptp(corners[:, :, part.run.axis], axis=1) * np.ptp(corners[:, :, 2], axis=1)
    return float(area[~part.is_open(lattice, nodes)].sum() / area.sum())


def slab_blocks(building: FrameBuilding, lattice: Lattice) -> Iterator[ElementBlock]:
    """Yield the slabs, one block a floor."""
    for number, slab in enumerate(building.slabs):
        key = f"slabs[{number}]"
        x = slab_lines(slab.x, building.grid.x, f"{key}.x")
        y = slab_lines(slab.y, building.grid.y, f"{key}.y")
        for floor in resolve(slab.floors, building.floors, "floor", f"{key}.floors"):
            yield ElementBlock(
                key=key,
                element=Shells,
                nodes=quadrilaterals(lattice.rectangle(x, y, floor)),
                group=building.floors.index(floor),
                kind="slab",
                thickness=slab.thickness,
                material=building.material(slab.material),
            )
