"""Members of a frame building cut into blocks of elements on the mesh lines."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Flags, Floats, Integers
from femupdate.building.entry import Complaint
from femupdate.building.lattice import ExtraLines, Lattice, quadrilaterals, strips
from femupdate.building.members import Beams, Columns, Material, Opening, Wall
from femupdate.building.references import (
    Run,
    beam_runs,
    intersections,
    resolve,
    slab_lines,
    spans,
    wall_run,
)
from femupdate.building.schema import BASE, FrameBuilding
from femupdate.building.sections import SectionFigures

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

    `kind` is "column" or "beam", `nodes` (n, 2) crossings, `offset` (n, 2, 3) and `released`
    (n, 12) as for `femupdate.fe.model.Beams`; the rest as for `Panel`.
    """

    key: str
    nodes: Integers
    group: int
    kind: str
    section: SectionFigures
    material: Material
    up: tuple[float, float, float]
    offset: Floats | None = None
    released: Flags | None = None


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
    """Yield the walls that have stiffness, one panel a story, without what is open.

    Raises:
        Complaint: the openings leave nothing of a wall.
    """
    for key, wall, run, group in _wall_stories(building, stiff=True):
        nodes = quadrilaterals(lattice.along(run, _story_levels(building, lattice, group)))
        open_ = _is_open(building, lattice, wall, run, group, nodes)
        if open_.all():
            story = building.story_names[group]
            text = f"the openings leave nothing of the wall in story {story}; make them smaller"
            raise Complaint(f"{key}.openings", text)
        yield Panel(
            key=key,
            nodes=nodes[~open_],
            group=group,
            kind=_wall_kind(wall),
            thickness=wall.thickness,
            material=building.material(wall.material),
        )


def _openings_in(building: FrameBuilding, wall: Wall, group: int) -> Iterator[Opening]:
    own = resolve(wall.stories, building.story_names, "story", "stories")
    for opening in wall.openings:
        if building.story_names[group] in resolve(opening.stories, own, "story", "stories"):
            yield opening


def _is_open(
    building: FrameBuilding, lattice: Lattice, wall: Wall, run: Run, group: int, nodes: Integers
) -> Flags:
    """Return which elements (n, 4) of a wall lie in an opening."""
    middle = lattice.coordinates(nodes.ravel()).reshape(-1, 4, 3).mean(axis=1)
    along, up = middle[:, run.axis], middle[:, 2]
    open_ = np.zeros(len(nodes), dtype=np.bool_)
    for opening in _openings_in(building, wall, group):
        left, right, bottom, top = _sides(building, run, group, opening)
        open_ |= (along > left) & (along < right) & (up > bottom) & (up < top)
    return open_


def _sides(
    building: FrameBuilding, run: Run, group: int, opening: Opening
) -> tuple[float, float, float, float]:
    """Return where an opening's sides are: along the wall from and to, and up from and to, m."""
    start = (building.grid.x if run.axis == 0 else building.grid.y)[run.start] + opening.left
    floor = float(building.floor_levels[group]) - building.stories[group].height + opening.bottom
    return start, start + opening.width, floor, floor + opening.height


def extra_lines(building: FrameBuilding) -> ExtraLines:
    """Return the mesh lines that openings and columns off the grid need."""
    lines = ExtraLines(
        x=tuple(x for columns in building.columns for x, _ in columns.points),
        y=tuple(y for columns in building.columns for _, y in columns.points),
    )
    for stiff in (True, False):
        for _, wall, run, group in _wall_stories(building, stiff=stiff):
            for opening in _openings_in(building, wall, group):
                left, right, bottom, top = _sides(building, run, group, opening)
                along = {"x" if run.axis == 0 else "y": (left, right)}
                lines += ExtraLines(**along, z=(bottom, top))
    return lines


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
        for ix, iy in _places(building, lattice, columns, key):
            for group in groups:
                nodes = strips(lattice.crossings(ix, iy, _story_levels(building, lattice, group)))
                yield Bar(
                    key=key,
                    nodes=nodes,
                    group=group,
                    kind="column",
                    section=section.figures(),
                    material=building.material(section.material),
                    up=_COLUMN_UP,
                    offset=_aside(columns.eccentricity, len(nodes)),
                )


def _places(
    building: FrameBuilding, lattice: Lattice, columns: Columns, key: str
) -> list[tuple[int, int]]:
    """Return the mesh lines in x and y at which columns stand."""
    if columns.points:
        return [(lattice.x.near(x), lattice.y.near(y)) for x, y in columns.points]
    points = intersections(building.grid, columns.at, f"{key}.at")
    return [(lattice.x.at[point.x], lattice.y.at[point.y]) for point in points]


def _aside(eccentricity: tuple[float, float] | None, count: int) -> Floats | None:
    """Return the arms of a column's elements, (count, 2, 3) m, from the point to its axis."""
    if eccentricity is None:
        return None
    return np.broadcast_to(np.array([*eccentricity, 0.0]), (count, 2, 3)).copy()


def beam_bars(building: FrameBuilding, lattice: Lattice) -> Iterator[Bar]:
    """Yield the beams, one bar a floor and line, or a floor and span where spans have ends."""
    for number, beams in enumerate(building.beams):
        key = f"beams[{number}]"
        section = building.sections[beams.section]
        floors = resolve(beams.floors, building.floors, "floor", f"{key}.floors")
        for run in beam_runs(building.grid, beams, key):
            for floor in floors:
                level = np.array([lattice.z.at[floor]])
                for part in _parts(building, run, beams):
                    ends = _beam_ends(lattice, beams, part, lattice.along(part, level)[:, 0])
                    yield Bar(
                        key=key,
                        nodes=ends.nodes,
                        group=building.floors.index(floor),
                        kind="beam",
                        section=section.figures(),
                        material=building.material(section.material),
                        up=_BEAM_UP,
                        offset=ends.offset,
                        released=ends.released,
                    )


def _parts(building: FrameBuilding, run: Run, beams: Beams) -> tuple[Run, ...]:
    if not beams.has_spans:
        return (run,)
    return tuple(Run(run.axis, run.line, a, b) for a, b, _ in spans(building.grid, run))


@dataclass(frozen=True)
class _BeamEnds:
    """Elements of a beam with the arms and releases at its ends."""

    nodes: Integers
    offset: Floats | None
    released: Flags | None


def _beam_ends(lattice: Lattice, beams: Beams, run: Run, points: Integers) -> _BeamEnds:
    """Return the elements along these crossings.

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
    nodes = strips(points[inside])
    offset = released = None
    if beams.rigid_ends is not None or beams.eccentricity is not None:
        offset = np.zeros((len(nodes), 2, 3))
        offset[:, :, 2] = -(beams.eccentricity or 0.0)
        offset[0, 0, run.axis] = first
        offset[-1, 1, run.axis] = -last
    if beams.hinges is not None:
        released = np.zeros((len(nodes), 12), dtype=np.bool_)
        released[0, [4, 5]] = beams.hinges in ("start", "both")
        released[-1, [10, 11]] = beams.hinges in ("end", "both")
    return _BeamEnds(nodes, offset, released)


def dead_walls(building: FrameBuilding, lattice: Lattice) -> Iterator[DeadWall]:
    """Yield the walls whose weight alone counts, one a story."""
    for key, wall, run, group in _wall_stories(building, stiff=False):
        ends = _story_levels(building, lattice, group)[[0, -1]]
        lines = lattice.along(run, ends)
        points = lattice.coordinates(lines[:, 0])[:, run.axis]
        widths = np.diff(points)
        tributary = (np.append(widths, 0.0) + np.append(0.0, widths)) / 2.0
        area_density = building.material(wall.material).density * wall.thickness
        height = building.stories[group].height * _closed_share(building, lattice, wall, run, group)
        yield DeadWall(
            key=key,
            group=group,
            above=lines[:, 1],
            below=lines[:0, 0] if group == 0 else lines[:, 0],
            share=area_density * height * tributary / 2.0,
        )


def _closed_share(
    building: FrameBuilding, lattice: Lattice, wall: Wall, run: Run, group: int
) -> float:
    """Return how much of a wall's area no opening takes."""
    if not wall.openings:
        return 1.0
    sheet = lattice.along(run, _story_levels(building, lattice, group))
    nodes = quadrilaterals(sheet)
    corners = lattice.coordinates(nodes.ravel()).reshape(-1, 4, 3)
    area = np.ptp(corners[:, :, run.axis], axis=1) * np.ptp(corners[:, :, 2], axis=1)
    closed = ~_is_open(building, lattice, wall, run, group, nodes)
    return float(area[closed].sum() / area.sum())
