"""Members of a frame as blocks of elements on the mesh lines.

Infill walls are equivalent diagonal struts, two across every bay.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from functools import partial
from itertools import pairwise, product
from typing import Any

import numpy as np

from femupdate.arrays import Flags, Floats, Integers, Strings
from femupdate.building.entry import Complaint
from femupdate.building.kinds import FrameBuilding
from femupdate.building.lattice import ExtraLines, Lattice, quadrilaterals, strips
from femupdate.building.members import Material, Wall
from femupdate.building.references import (
    Intersection,
    Stretch,
    beam_stretches,
    intersections,
    resolve,
    slab_lines,
    spans,
    wall_stretch,
)
from femupdate.building.sections import SectionFigures
from femupdate.fe.elements.beam import Beams
from femupdate.fe.elements.shell import Shells
from femupdate.fe.model import Elements

# Shape of what an element has more than one figure of.
_SHAPES = {"up": (3,), "size": (2,), "offset": (2, 3), "released": (12,)}


@dataclass(frozen=True, kw_only=True)
class ElementBlock:
    """The n elements of one member in one story or on one floor, or of one part of a read mesh."""

    key: str  # the entry of the file that it comes from, such as "walls[2]"
    element: type[Elements]  # the kind of element
    nodes: Integers  # (n, k) points of a lattice, or nodes of a read mesh
    group: int | Integers  # index of the story that owns it, or (n,) of each element
    # "wall", "non_structural_wall", "slab", "column", "beam", "brace" or "infill", or (n,) of each
    kind: str | Strings
    material: Material  # of all
    thickness: float | None = None  # of surfaces, m
    section: SectionFigures | None = None  # of lines
    # as for `femupdate.fe.elements.beam.Beams`; None where there are none
    up: tuple[float, float, float] | Floats | None = None
    offset: Floats | None = None
    released: Flags | None = None
    part: int = -1  # number of the part of a read mesh

    def values(self) -> dict[str, Any]:
        """What the element's fields are filled with, by their names."""
        filled = {item.name: getattr(self, item.name) for item in fields(self)}
        filled |= dict(self.material)
        if self.section is not None:
            filled |= {item.name: getattr(self.section, item.name) for item in fields(self.section)}
            filled["size"] = self.section.size
        return filled


def by_element(blocks: Sequence[ElementBlock]) -> dict[type[Elements], list[ElementBlock]]:
    """Return the blocks of each kind of element, in the order of a model's elements."""
    kinds = dict.fromkeys(block.element for block in blocks)
    return {kind: [block for block in blocks if block.element is kind] for kind in kinds}


def joined(blocks: Sequence[ElementBlock], used: Integers) -> tuple[Elements, ...]:
    """Return the elements of blocks, one block a kind.

    Args:
        blocks: whose elements have fields for what the blocks hold, or do without it.
        used: points of the lattice, or nodes of the read mesh, that are the model's nodes.
    """
    made = []
    for kind, alike in by_element(blocks).items():
        nodes = np.searchsorted(used, np.concatenate([block.nodes for block in alike]))
        known = [block.values() for block in alike]
        filled: dict[str, Any] = {"nodes": nodes}
        for name in {item.name for item in fields(kind)} - {"nodes"}:
            columns = [values.get(name) for values in known]
            given = [np.asarray(value) for value in columns if value is not None]
            if given:
                shape = _SHAPES.get(name, ())
                nothing = np.zeros(shape, dtype=given[0].dtype)
                parts = [
                    np.broadcast_to(nothing if value is None else value, (len(block.nodes), *shape))
                    for value, block in zip(columns, alike, strict=True)
                ]
                filled[name] = np.concatenate(parts)
        made.append(kind(**filled))
    return tuple(made)


def column_lines(building: FrameBuilding) -> ExtraLines:
    """Return the mesh lines through columns off the grid."""
    points = [point for columns in building.columns for point in columns.points]
    return ExtraLines(x=tuple(x for x, _ in points), y=tuple(y for _, y in points))


def _bar(building: FrameBuilding, key: str, kind: str, name: str) -> Callable[..., ElementBlock]:
    """A maker of the elements of a member with a section of the building."""
    section = building.sections[name]
    return partial(
        ElementBlock,
        key=key,
        element=Beams,
        kind=kind,
        section=section.figures(),
        material=building.material(section.material),
        # Its depth is vertical in a beam; in a column it lies along the global y.
        up=(0.0, 1.0, 0.0) if kind == "column" else (0.0, 0.0, 1.0),
    )


def column_blocks(building: FrameBuilding, lattice: Lattice) -> Iterator[ElementBlock]:
    """Yield the columns, one block a story and place."""
    for number, columns in enumerate(building.columns):
        key = f"columns[{number}]"
        bar = _bar(building, key, "column", columns.section)
        stories = resolve(columns.stories, building.story_names, "story", f"{key}.stories")
        places = [(lattice.x.near(x), lattice.y.near(y)) for x, y in columns.points]
        if not places:
            points = intersections(building.grid, columns.at, f"{key}.at")
            places = [(lattice.x.at[point.x], lattice.y.at[point.y]) for point in points]
        for ix, iy in places:
            for group in map(building.story_names.index, stories):
                upright = lattice.crossings(ix, iy, lattice.story(group))
                nodes = strips(_touched(lattice, columns.rigid_ends, 2, upright))
                offset = None
                if columns.eccentricity is not None or columns.rigid_ends is not None:
                    first, last = columns.rigid_ends or (0.0, 0.0)
                    aside = columns.eccentricity or (0.0, 0.0)
                    offset = np.tile([*aside, 0.0], (len(nodes), 2, 1))
                    offset[0, 0, 2], offset[-1, 1, 2] = first, -last
                yield bar(nodes=nodes, group=group, offset=offset)


def beam_blocks(building: FrameBuilding, lattice: Lattice) -> Iterator[ElementBlock]:
    """Yield the beams, one block a floor and line, or a floor and span where spans have ends."""
    for number, beams in enumerate(building.beams):
        key = f"beams[{number}]"
        bar = _bar(building, key, "beam", beams.section)
        floors = resolve(beams.floors, building.floors, "floor", f"{key}.floors")
        for run in beam_stretches(building.grid, beams, key):
            parts = [run]
            if beams.rigid_ends is not None or beams.hinges is not None:  # at ends of every span
                spanned = spans(building.grid, run)
                parts = [Stretch(run.axis, run.line, start, end) for start, end, _ in spanned]
            for floor, part in product(floors, parts):
                points = lattice.along(part, np.array([lattice.z.at[floor]]))[:, 0]
                nodes = strips(_touched(lattice, beams.rigid_ends, part.axis, points))
                offset, released = None, None
                if beams.rigid_ends is not None or beams.eccentricity is not None:
                    first, last = beams.rigid_ends or (0.0, 0.0)
                    offset = np.zeros((len(nodes), 2, 3))
                    offset[:, :, 2] = -(beams.eccentricity or 0.0)
                    offset[0, 0, part.axis], offset[-1, 1, part.axis] = first, -last
                if beams.hinges is not None:  # which pass no bending moment on
                    released = np.zeros((len(nodes), 12), dtype=np.bool_)
                    released[0, [4, 5]] = beams.hinges in ("start", "both")
                    released[-1, [10, 11]] = beams.hinges in ("end", "both")
                group = building.floors.index(floor)
                yield bar(nodes=nodes, group=group, offset=offset, released=released)


def brace_blocks(building: FrameBuilding, lattice: Lattice) -> Iterator[ElementBlock]:
    """Yield the braces, one block a story; each brace is one element from corner to corner."""
    for number, braces in enumerate(building.braces):
        key = f"braces[{number}]"
        bar = _bar(building, key, "brace", braces.section)
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
            released = pinned(len(nodes)) if braces.ends == "pinned" else None
            yield bar(nodes=nodes, group=group, released=released)


def pinned(count: int) -> Flags:
    """Where members whose ends pass no bending moment on are released, (count, 12)."""
    released = np.zeros((count, 12), dtype=np.bool_)
    released[:, [4, 5, 10, 11]] = True
    return released


def _touched(
    lattice: Lattice, rigid_ends: tuple[float, float] | None, axis: int, points: Integers
) -> Integers:
    """Crossings along a member that its elements join; rigid ends pass those on their way."""
    place = lattice.coordinates(points)[:, axis]
    first, last = rigid_ends or (0.0, 0.0)
    inside = (place > place[0] + first) & (place < place[-1] - last)
    if inside.any():  # an element that is almost all rigid would have next to no length
        gap = 0.25 * np.diff(place).min()
        inside &= (place > place[0] + first + gap) & (place < place[-1] - last - gap)
    inside[[0, -1]] = True
    return points[inside]


@dataclass(frozen=True)
class DeadWall:
    """A wall of one story that only weighs."""

    key: str
    group: int
    # (n,) crossings along the wall on the floor above and below (below is empty on the ground)
    above: Integers
    below: Integers
    share: Floats  # (n,) mass for each of those, kg: half of the wall's in all

    @property
    def mass(self) -> float:
        """Mass of the whole wall, kg."""
        return 2.0 * float(self.share.sum())


@dataclass(frozen=True)
class _WallStory:
    """A wall in one story."""

    key: str  # the entry of the file it comes from
    wall: Wall  # that entry
    run: Stretch  # the stretch of the grid line under it
    group: int  # index of the story
    openings: Floats  # (n, 4) sides of each opening, m: along the wall from and to, up from and to

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
            yield _WallStory(key, wall, run, group, np.array(sides).reshape(-1, 4))


def wall_blocks(building: FrameBuilding, lattice: Lattice) -> Iterator[ElementBlock]:
    """Yield the walls that have stiffness, one block a story, without what is open."""
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
        nodes = quadrilaterals(sheet)
        corners = lattice.coordinates(nodes.ravel()).reshape(-1, 4, 3)
        area = np.ptp(corners[:, :, part.run.axis], axis=1) * np.ptp(corners[:, :, 2], axis=1)
        closed = float(area[~part.is_open(lattice, nodes)].sum() / area.sum())
        height = building.stories[part.group].height * closed
        yield DeadWall(
            key=part.key,
            group=part.group,
            above=sheet[:, -1],
            below=sheet[:0, 0] if building.below[part.group] < 0 else sheet[:, 0],
            share=area_density * height * tributary / 2.0,
        )


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


@dataclass(frozen=True)
class Panel:
    """An infill in one bay and story."""

    key: str  # the entry of the file that it comes from
    bay: Stretch  # between two columns
    group: int  # index of the story
    width: float  # of the strut, m; each of the two has half of it
    height: float  # of the panel itself, between beams, m
    length: float  # of the panel itself, between columns, m


def strut_width(
    formula: str, height: float, length: float, column_height: float, stiffness_ratio: float
) -> float:
    """Return the width of the strut that stands for a panel, m.

    FEMA 356 (2000), section 7.5.2: .175 (lambda h_col)^-.4 r with lambda =
    (E t sin 2 theta / (4 E_col I_col h))^(1/4). EN 1998-1 (2004), 5.9: a fixed share of the
    diagonal r, here .15.

    Args:
        height, length: h of the panel and its length, m.
        column_height: h_col, floor to floor, m.
        stiffness_ratio: E t of the panel over E_col I_col, 1/m3.
    """
    diagonal = math.hypot(height, length)
    if formula == "EN 1998-1":
        return 0.15 * diagonal
    twice = math.sin(2.0 * math.atan2(height, length))
    relative = (stiffness_ratio * twice / (4.0 * height)) ** 0.25
    return 0.175 * (relative * column_height) ** -0.4 * diagonal


def panels(building: FrameBuilding) -> Iterator[Panel]:
    """Yield every infill of a building, bay by bay; Complaint for one that cannot stand."""
    for number, infill in enumerate(building.infills):
        key = f"infills[{number}]"
        run = wall_stretch(building.grid, infill, key)
        material = building.material(infill.material)
        for story in resolve(infill.stories, building.story_names, "story", f"{key}.stories"):
            group = building.story_names.index(story)
            crossing = spans(building.grid, run)
            lines = [crossing[0][0], *(end for _, end, _ in crossing)]
            held = {line: _column(building, run, line, story) for line in lines}
            for line, end in ((lines[0], "from"), (lines[-1], "to")):
                if held[line] is None:
                    text = f"no column stands at {line}-{run.line} in story {story}"
                    raise Complaint(f"{key}.{end}", f"{text}; end the infill at columns or add one")
            standing = [(line, column) for line, column in held.items() if column is not None]
            for (start, (deep, first)), (end, (deep_too, last)) in pairwise(standing):
                bay = Stretch(run.axis, run.line, start, end)
                low, high = bay.ends(building.grid)
                tall = building.stories[group].height
                height = tall - _beam_depth(building, bay, building.floors[group])
                length = high - low - 0.5 * (deep + deep_too)
                if min(height, length) <= 0.0:
                    text = f"beams and columns leave nothing of the bay {start} to {end}"
                    raise Complaint(key, f"{text} in story {story}; remove the infill there")
                ratio = material.youngs_modulus * infill.thickness
                ratio /= 0.5 * (first + last)
                width = strut_width(infill.formula, height, length, tall, ratio)
                yield Panel(key, bay, group, width, height, length)


def infill_blocks(building: FrameBuilding, lattice: Lattice) -> Iterator[ElementBlock]:
    """Yield the struts, one block a bay and story; together they weigh as much as the panel."""
    entries = {f"infills[{n}]": infill for n, infill in enumerate(building.infills)}
    for panel in panels(building):
        infill = entries[panel.key]
        levels = lattice.story(panel.group)[[0, -1]]
        (low_start, high_start), *_, (low_end, high_end) = lattice.along(panel.bay, levels)
        nodes = np.array([(low_start, high_end), (high_start, low_end)], dtype=np.int64)
        ends = lattice.coordinates(nodes[0])
        area = 0.5 * panel.width * infill.thickness
        material = building.material(infill.material)
        mass = material.density * infill.thickness * panel.height * panel.length
        line = mass / (2.0 * area * float(np.linalg.norm(ends[1] - ends[0])))
        none = 1e-6 * area**2  # a strut has no bending or torsion to speak of
        yield ElementBlock(
            key=panel.key,
            element=Beams,
            nodes=nodes,
            group=panel.group,
            kind="infill",
            material=material.model_copy(update={"density": line}),
            section=SectionFigures(
                area, area, area, none, none, none, (infill.thickness, 0.5 * panel.width)
            ),
            up=(0.0, 0.0, 1.0),
            released=pinned(2),
        )


def infill_notes(building: FrameBuilding) -> tuple[str, ...]:
    """Return a sentence for every infill: by which formula, and how wide its struts are."""
    widths: dict[str, list[float]] = {}
    for panel in panels(building):
        widths.setdefault(panel.key, []).append(panel.width)
    notes = []
    for infill, (key, of_bays) in zip(building.infills, widths.items(), strict=True):
        low, high = (f"{value:.3g}" for value in (min(of_bays), max(of_bays)))
        wide = f"{low} m" if low == high else f"{low} to {high} m"
        bays = "1 bay" if len(of_bays) == 1 else f"{len(of_bays)} bays"
        notes.append(
            f"{key}: strut {wide} wide by {infill.formula}, half of it along each diagonal of "
            f"{bays}."
        )
    return tuple(notes)


def _column(
    building: FrameBuilding, run: Stretch, line: str, story: str
) -> tuple[float, float] | None:
    """Depth along the bay (m) of the column where a line crosses a stretch, and its E I in it."""
    place = Intersection(line, run.line) if run.axis == 0 else Intersection(run.line, line)
    for columns in building.columns:
        stories = resolve(columns.stories, building.story_names, "story", "stories")
        places = () if columns.points else intersections(building.grid, columns.at, "at")
        if story in stories and place in places:
            section = building.sections[columns.section]
            figures, young = section.figures(), building.material(section.material)
            inertia = (figures.inertia_z, figures.inertia_y)[run.axis]
            return figures.size[run.axis], young.youngs_modulus * inertia
    return None


def _beam_depth(building: FrameBuilding, bay: Stretch, floor: str) -> float:
    """Depth of the deepest beam over a bay, m; zero without one."""
    low, high = bay.ends(building.grid)
    depths = [0.0]
    for beams in building.beams:
        if floor in resolve(beams.floors, building.floors, "floor", "floors"):
            for run in beam_stretches(building.grid, beams, "beams"):
                start, end = run.ends(building.grid)
                if run.line == bay.line and start <= low and high <= end:
                    depths.append(building.sections[beams.section].figures().size[1])
    return max(depths)
