"""How the names in a building file (stories, floors, grid lines) find what they name."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise

from femupdate.building.entry import ALL, Complaint, unknown
from femupdate.building.members import BeamLines, Braces, Grid, InfillWall, Wall


@dataclass(frozen=True)
class Stretch:
    """A stretch of a grid line between two lines that cross it, in ascending order."""

    axis: int  # 0 where the line runs along x, 1 where it runs along y
    line: str  # names of the line and of the two that bound the stretch
    start: str
    end: str

    def ends(self, grid: Grid) -> tuple[float, float]:
        """Coordinates of the start and of the end along the line, m."""
        crossing = _crossing(grid, self.axis)
        return crossing[self.start], crossing[self.end]


@dataclass(frozen=True)
class Intersection:
    """Where a line at constant x crosses a line at constant y."""

    x: str
    y: str


def resolve(names: tuple[str, ...], known: Iterable[str], what: str, key: str) -> tuple[str, ...]:
    """Return the names, or all known ones for "*"; raise Complaint at `key` for an unknown one."""
    everything = tuple(known)
    if names == ALL:
        return everything
    for name in names:
        if name == "*":
            raise Complaint(key, '"*" stands for all and cannot be listed beside others; remove it')
        if name not in everything:
            raise Complaint(key, unknown(what, name, everything))
    return names


def require(name: str, known: Iterable[str], what: str, key: str) -> str:
    """Return the name; raise Complaint at `key` where it is not known."""
    if name == "*":
        raise Complaint(key, '"*" cannot stand here; write one name')
    return resolve((name,), known, what, key)[0]


def _crossing(grid: Grid, axis: int) -> Mapping[str, float]:
    """Return the lines that cross a line running along the axis, in ascending order."""
    lines = grid.x if axis == 0 else grid.y
    return dict(sorted(lines.items(), key=lambda item: item[1]))


def stretch_of(grid: Grid, line: str, bounds: tuple[str | None, str | None], key: str) -> Stretch:
    """Return the stretch of a line between two crossing lines (None: its first, its last)."""
    require(line, [*grid.x, *grid.y], "grid line", f"{key}.along")
    axis = 0 if line in grid.y else 1
    crossing = _crossing(grid, axis)
    order = list(crossing)
    start, end = bounds[0] or order[0], bounds[1] or order[-1]
    for name, part in ((start, "from"), (end, "to")):
        if name in (grid.y if axis == 0 else grid.x):
            text = f"{name!r} does not cross {line!r}; write one of {', '.join(order)}"
            raise Complaint(f"{key}.{part}", text)
        require(name, order, f"grid line across {line!r}", f"{key}.{part}")
    if start == end:
        raise Complaint(f"{key}.to", f"it starts and ends at {end!r}; write another end")
    first, last = sorted((start, end), key=crossing.__getitem__)
    return Stretch(axis, line, first, last)


def spans(grid: Grid, stretch: Stretch) -> tuple[tuple[str, str, float], ...]:
    """Return the spans of a stretch: two neighbouring crossing lines and their distance, m."""
    crossing = _crossing(grid, stretch.axis)
    order = list(crossing)
    inside = order[order.index(stretch.start) : order.index(stretch.end) + 1]
    return tuple((a, b, crossing[b] - crossing[a]) for a, b in pairwise(inside))


def wall_stretch(grid: Grid, wall: Wall | Braces | InfillWall, key: str) -> Stretch:
    """Return the stretch under a wall, an infill or braces."""
    return stretch_of(grid, wall.along, (wall.start, wall.end), key)


def beam_stretches(grid: Grid, beams: BeamLines, key: str) -> tuple[Stretch, ...]:
    """Return the stretches that beams follow."""
    lines = resolve(beams.along, [*grid.y, *grid.x], "grid line", f"{key}.along")
    if beams.along == ALL:  # a line that only one other crosses has no length
        lines = tuple(n for n in lines if len(grid.x if n in grid.y else grid.y) > 1)
    return tuple(stretch_of(grid, line, (beams.start, beams.end), key) for line in lines)


def intersection(grid: Grid, text: str, key: str) -> Intersection:
    """Return the intersection that "X1-Y1" names (in either order)."""
    parts = [part.strip() for part in text.split("-")]
    if len(parts) != 2:
        example = f"{next(iter(grid.y))}-{next(iter(grid.x))}"
        raise Complaint(key, f"{text!r} is not an intersection of grid lines, such as {example!r}")
    for part in parts:
        require(part, [*grid.y, *grid.x], "grid line", key)
    along_x, along_y = sorted(parts, key=lambda part: part in grid.x)
    if along_x in grid.x or along_y in grid.y:
        raise Complaint(key, f"{parts[0]!r} and {parts[1]!r} are parallel; write two that cross")
    return Intersection(x=along_y, y=along_x)


def intersections(grid: Grid, names: tuple[str, ...], key: str) -> tuple[Intersection, ...]:
    """Return the named intersections, or every one of the grid for "*"."""
    if names == ALL:
        return tuple(Intersection(x, y) for y in grid.y for x in grid.x)
    return tuple(intersection(grid, name, f"{key}[{n}]") for n, name in enumerate(names))


def slab_lines(lines: tuple[str, str], known: Mapping[str, float], key: str) -> tuple[str, str]:
    """Return the two lines that bound a slab, in ascending order."""
    for number, line in enumerate(lines):
        require(line, known, "grid line", f"{key}[{number}]")
    if lines[0] == lines[1]:
        raise Complaint(key, f"it starts and ends at {lines[0]!r}; write another line")
    first, last = sorted(lines, key=known.__getitem__)
    return first, last
