"""Members of a frame building cut into blocks of elements on the mesh lines."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femupdate.building.lattice import Integers, Lattice, quadrilaterals, strips
from femupdate.building.members import Material, SectionFigures, Wall
from femupdate.building.references import (
    Run,
    beam_runs,
    intersections,
    resolve,
    slab_lines,
    wall_run,
)
from femupdate.building.schema import BASE, FrameBuilding

# Which way a section's depth points: z is vertical in a beam; in a column z is the global y.
_BEAM_UP = (0.0, 0.0, 1.0)
_COLUMN_UP = (0.0, 1.0, 0.0)


@dataclass(frozen=True)
class Panel:
    """The shells of one wall in one story, or of one slab on one floor.

    Attributes:
        key: the entry of the file it comes from, such as "walls[2]".
        nodes: (n, 4) crossings.
        group: index of the story that owns it.
        kind: "wall", "non_structural_wall" or "slab".
        thickness: m.
    """

    key: str
    nodes: Integers
    group: int
    kind: str
    thickness: float
    material: Material


@dataclass(frozen=True)
class Bar:
    """The beam elements of one column in one story, or of one beam on one floor.

    `kind` is "column" or "beam", `nodes` (n, 2) crossings; the rest as for `Panel`.
    """

    key: str
    nodes: Integers
    group: int
    kind: str
    section: SectionFigures
    material: Material
    up: tuple[float, float, float]


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
    share: NDArray[np.float64]

    @property
    def mass(self) -> float:
        """Mass of the whole wall, kg."""
        return 2.0 * float(self.share.sum())


def _story_levels(building: FrameBuilding, lattice: Lattice, group: int) -> Integers:
    floors = (BASE, *building.floors)
    return lattice.z.between(floors[group], floors[group + 1])


def _wall_kind(wall: Wall) -> str:
    return "wall" if wall.role == "shear" else "non_structural_wall"


def _wall_stories(building: FrameBuilding, *, stiff: bool) -> Iterator[tuple[str, Wall, Run, int]]:
    for number, wall in enumerate(building.walls):
        if wall.is_stiff == stiff:
            key = f"walls[{number}]"
            run = wall_run(building.grid, wall, key)
            for story in resolve(wall.stories, building.story_names, "story", f"{key}.stories"):
                yield key, wall, run, building.story_names.index(story)


def wall_panels(building: FrameBuilding, lattice: Lattice) -> Iterator[Panel]:
    """Yield the walls that have stiffness, one panel a story."""
    for key, wall, run, group in _wall_stories(building, stiff=True):
        sheet = lattice.along(run, _story_levels(building, lattice, group))
        yield Panel(
            key=key,
            nodes=quadrilaterals(sheet),
            group=group,
            kind=_wall_kind(wall),
            thickness=wall.thickness,
            material=building.material(wall.material),
        )


def slab_panels(building: FrameBuilding, lattice: Lattice) -> Iterator[Panel]:
    """Yield the slabs, one panel a floor."""
    for number, slab in enumerate(building.slabs):
        key = f"slabs[{number}]"
        x = slab_lines(slab.x, building.grid.x, f"{key}.x")
        y = slab_lines(slab.y, building.grid.y, f"{key}.y")
        for floor in resolve(slab.floors, building.floors, "floor", f"{key}.floors"):
            yield Panel(
                key=key,
                nodes=quadrilaterals(lattice.rectangle(x, y, floor)),
                group=building.floors.index(floor),
                kind="slab",
                thickness=slab.thickness,
                material=building.material(slab.material),
            )


def column_bars(building: FrameBuilding, lattice: Lattice) -> Iterator[Bar]:
    """Yield the columns, one bar a story and place."""
    for number, columns in enumerate(building.columns):
        key = f"columns[{number}]"
        section = building.sections[columns.section]
        stories = resolve(columns.stories, building.story_names, "story", f"{key}.stories")
        groups = [building.story_names.index(story) for story in stories]
        for point in intersections(building.grid, columns.at, f"{key}.at"):
            for group in groups:
                levels = _story_levels(building, lattice, group)
                yield Bar(
                    key=key,
                    nodes=strips(lattice.upright(point, levels)),
                    group=group,
                    kind="column",
                    section=section.figures(),
                    material=building.material(section.material),
                    up=_COLUMN_UP,
                )


def beam_bars(building: FrameBuilding, lattice: Lattice) -> Iterator[Bar]:
    """Yield the beams, one bar a floor and line."""
    for number, beams in enumerate(building.beams):
        key = f"beams[{number}]"
        section = building.sections[beams.section]
        floors = resolve(beams.floors, building.floors, "floor", f"{key}.floors")
        for run in beam_runs(building.grid, beams, key):
            for floor in floors:
                level = np.array([lattice.z.at[floor]])
                yield Bar(
                    key=key,
                    nodes=strips(lattice.along(run, level)[:, 0]),
                    group=building.floors.index(floor),
                    kind="beam",
                    section=section.figures(),
                    material=building.material(section.material),
                    up=_BEAM_UP,
                )


def dead_walls(building: FrameBuilding, lattice: Lattice) -> Iterator[DeadWall]:
    """Yield the walls whose weight alone counts, one a story."""
    for key, wall, run, group in _wall_stories(building, stiff=False):
        ends = _story_levels(building, lattice, group)[[0, -1]]
        lines = lattice.along(run, ends)
        points = lattice.coordinates(lines[:, 0])[:, run.axis]
        widths = np.diff(points)
        tributary = (np.append(widths, 0.0) + np.append(0.0, widths)) / 2.0
        area_density = building.material(wall.material).density * wall.thickness
        height = building.stories[group].height
        yield DeadWall(
            key=key,
            group=group,
            above=lines[:, 1],
            below=lines[:0, 0] if group == 0 else lines[:, 0],
            share=area_density * height * tributary / 2.0,
        )
