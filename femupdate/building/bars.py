"""Columns, beams and braces of a frame building as blocks of beam elements on the mesh lines."""

from collections.abc import Iterator
from itertools import product

import numpy as np

from femupdate.arrays import Flags, Floats, Integers
from femupdate.building.blocks import ElementBlock
from femupdate.building.frame import FrameBuilding
from femupdate.building.lattice import ExtraLines, Lattice, strips
from femupdate.building.members import BeamLines, ColumnGroup
from femupdate.building.references import (
    Stretch,
    beam_stretches,
    intersections,
    resolve,
    spans,
    wall_stretch,
)
from femupdate.fe.elements.beam import Beams

# Which way a section's depth points: z is vertical in a beam; in a column z is the global y.
_BEAM_UP = (0.0, 0.0, 1.0)
_COLUMN_UP = (0.0, 1.0, 0.0)


def column_lines(building: FrameBuilding) -> ExtraLines:
    """Return the mesh lines through columns off the grid."""
    points = [point for columns in building.columns for point in columns.points]
    return ExtraLines(x=tuple(x for x, _ in points), y=tuple(y for _, y in points))


def column_blocks(building: FrameBuilding, lattice: Lattice) -> Iterator[ElementBlock]:
    """Yield the columns, one block a story and place."""
    for number, columns in enumerate(building.columns):
        key = f"columns[{number}]"
        section = building.sections[columns.section]
        stories = resolve(columns.stories, building.story_names, "story", f"{key}.stories")
        for ix, iy in _places(building, lattice, columns, key):
            for group in map(building.story_names.index, stories):
                nodes = strips(lattice.crossings(ix, iy, lattice.story(group)))
                offset = None
                if columns.eccentricity is not None:
                    offset = np.tile([*columns.eccentricity, 0.0], (len(nodes), 2, 1))
                yield ElementBlock(
                    key=key,
                    element=Beams,
                    nodes=nodes,
                    group=group,
                    kind="column",
                    section=section.figures(),
                    material=building.material(section.material),
                    up=_COLUMN_UP,
                    offset=offset,
                )


def _places(
    building: FrameBuilding, lattice: Lattice, columns: ColumnGroup, key: str
) -> list[tuple[int, int]]:
    """Return the mesh lines in x and y at which columns stand."""
    if columns.points:
        return [(lattice.x.near(x), lattice.y.near(y)) for x, y in columns.points]
    points = intersections(building.grid, columns.at, f"{key}.at")
    return [(lattice.x.at[point.x], lattice.y.at[point.y]) for point in points]


def beam_blocks(building: FrameBuilding, lattice: Lattice) -> Iterator[ElementBlock]:
    """Yield the beams, one block a floor and line, or a floor and span where spans have ends."""
    for number, beams in enumerate(building.beams):
        key = f"beams[{number}]"
        section = building.sections[beams.section]
        floors = resolve(beams.floors, building.floors, "floor", f"{key}.floors")
        for run in beam_stretches(building.grid, beams, key):
            parts = [run]
            if beams.has_spans:
                spanned = spans(building.grid, run)
                parts = [Stretch(run.axis, run.line, start, end) for start, end, _ in spanned]
            for floor, part in product(floors, parts):
                points = lattice.along(part, np.array([lattice.z.at[floor]]))[:, 0]
                nodes = strips(_touched(lattice, beams, part, points))
                yield ElementBlock(
                    key=key,
                    element=Beams,
                    nodes=nodes,
                    group=building.floors.index(floor),
                    kind="beam",
                    section=section.figures(),
                    material=building.material(section.material),
                    up=_BEAM_UP,
                    offset=_arms(beams, part.axis, len(nodes)),
                    released=_hinges(beams, len(nodes)),
                )


def brace_blocks(building: FrameBuilding, lattice: Lattice) -> Iterator[ElementBlock]:
    """Yield the braces, one block a story; each brace is one element from corner to corner."""
    for number, braces in enumerate(building.braces):
        key = f"braces[{number}]"
        section = building.sections[braces.section]
        stretch = wall_stretch(building.grid, braces, key)
        for story in resolve(braces.stories, building.story_names, "story", f"{key}.stories"):
            group = building.story_names.index(story)
            levels = lattice.story(group)[[0, -1]]
            (low_start, high_start), *_, (low_end, high_end) = lattice.along(stretch, levels)
            diagonals = {"up": (low_start, high_end), "down": (high_start, low_end)}
            if stretch.start != braces.start:  # stretches run along the axis
                diagonals = {"up": (low_end, high_start), "down": (high_end, low_start)}
            chosen = diagonals if braces.shape == "cross" else (braces.shape,)
            nodes = np.array([diagonals[leaning] for leaning in chosen], dtype=np.int64)
            yield ElementBlock(
                key=key,
                element=Beams,
                nodes=nodes,
                group=group,
                kind="brace",
                section=section.figures(),
                material=building.material(section.material),
                up=_BEAM_UP,
                released=_pins(len(nodes)) if braces.ends == "pinned" else None,
            )


def _pins(count: int) -> Flags:
    """Return that neither end of an element passes bending moments on, (count, 12)."""
    released = np.zeros((count, 12), dtype=np.bool_)
    released[:, [4, 5, 10, 11]] = True
    return released


def _touched(lattice: Lattice, beams: BeamLines, run: Stretch, points: Integers) -> Integers:
    """Return those of the crossings along a beam that its elements join.

    A rigid end reaches from the first node into the element that ends outside it; the beam does
    not touch the nodes that it passes on the way.
    """
    place = lattice.coordinates(points)[:, run.axis]
    first, last = beams.rigid_ends or (0.0, 0.0)
    inside = (place > place[0] + first) & (place < place[-1] - last)
    if inside.any():  # an element that is almost all rigid would have next to no length
        gap = 0.25 * np.diff(place).min()
        inside &= (place > place[0] + first + gap) & (place < place[-1] - last - gap)
    inside[[0, -1]] = True
    return points[inside]


def _arms(beams: BeamLines, axis: int, count: int) -> Floats | None:
    """Return the rigid arms of a beam's elements, (count, 2, 3) m."""
    if beams.rigid_ends is None and beams.eccentricity is None:
        return None
    first, last = beams.rigid_ends or (0.0, 0.0)
    offset = np.zeros((count, 2, 3))
    offset[:, :, 2] = -(beams.eccentricity or 0.0)
    offset[0, 0, axis], offset[-1, 1, axis] = first, -last
    return offset


def _hinges(beams: BeamLines, count: int) -> Flags | None:
    """Return where a beam's elements pass no bending moment on, (count, 12)."""
    if beams.hinges is None:
        return None
    released = np.zeros((count, 12), dtype=np.bool_)
    released[0, [4, 5]] = beams.hinges in ("start", "both")
    released[-1, [10, 11]] = beams.hinges in ("end", "both")
    return released
