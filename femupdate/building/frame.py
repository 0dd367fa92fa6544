"""A building of columns, beams, walls and slabs on grid lines; every name must name something."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import BeforeValidator

from femupdate.building.common import MeshedBuilding
from femupdate.building.entry import Complaint
from femupdate.building.members import (
    BeamLines,
    Braces,
    ColumnGroup,
    Grid,
    InfillWall,
    Mesh,
    Opening,
    Sensors,
    Slab,
    Wall,
)
from femupdate.building.references import (
    beam_stretches,
    intersections,
    require,
    resolve,
    slab_lines,
    spans,
    wall_stretch,
)


def _each_line(members: object) -> object:
    """Braces, infills or walls with a list of lines, as one entry for each line."""
    if not isinstance(members, list):
        return members
    return [
        {**member, "along": line} if isinstance(line, str) else member
        for member in members
        for along in (member.get("along") if isinstance(member, dict) else None,)
        for line in (along if isinstance(along, list) and along else [along])
    ]


CLOSEST_LINES = 1e-3  # m; nearer lines would make needle-thin elements


class FrameBuilding(MeshedBuilding):
    """A building of columns, beams, walls and slabs on a grid of named lines."""

    kind: Literal["frame"]
    grid: Grid
    columns: tuple[ColumnGroup, ...] = ()
    beams: tuple[BeamLines, ...] = ()
    braces: Annotated[tuple[Braces, ...], BeforeValidator(_each_line)] = ()
    walls: Annotated[tuple[Wall, ...], BeforeValidator(_each_line)] = ()
    infills: Annotated[tuple[InfillWall, ...], BeforeValidator(_each_line)] = ()
    slabs: tuple[Slab, ...] = ()
    mesh: Mesh
    sensors: Sensors

    def check(self) -> None:
        """Raise Complaint for the first entry that does not fit the others."""
        super().check()
        for number, entry in enumerate(self.stories):
            if entry.x is not None or entry.y is not None:
                key = f"stories[{number}].{'y' if entry.x is None else 'x'}"
                raise Complaint(key, "members of a frame name their story; remove it")
        _check_lines(self.grid.x, "grid.x")
        _check_lines(self.grid.y, "grid.y")
        for name in self.grid.x:
            if name in self.grid.y:
                raise Complaint(f"grid.x.{name}", "a line of grid.y has the same name; rename one")
        _check_members(self)
        _check_columns(self)
        _check_stretches(self)
        for key in ("floors", "at"):
            for floor in getattr(self.sensors, key):
                require(floor, self.floors, "floor", f"sensors.{key}.{floor}")
        intersections(self.grid, self.sensors.points, "sensors.points")
        for floor in self.sensors.floors:
            key, points = self.sensors.of(floor)
            intersections(self.grid, points, key)
        for n, group in enumerate(self.springs):
            intersections(self.grid, group.at, f"springs[{n}].at")
        named = [columns.stories for columns in self.columns]
        named += [wall.stories for wall in self.walls if wall.is_stiff]
        stories = self.story_names
        held = {story for names in named for story in resolve(names, stories, "story", "stories")}
        for number, story in enumerate(stories):
            if story not in held:
                text = f"no column or wall with stiffness stands in story {story!r}; add one"
                raise Complaint(f"stories[{number}]", text)


def _check_lines(lines: Mapping[str, float], key: str) -> None:
    if not lines:
        raise Complaint(key, 'it has no line; add one, such as A = "0 m"')
    ordered = sorted(lines.items(), key=lambda item: item[1])
    for (first, low), (second, high) in pairwise(ordered):
        if high - low < CLOSEST_LINES:
            raise Complaint(f"{key}.{second}", f"it lies on {first!r}; move one or remove it")
    for name in lines:
        if "-" in name or name == "*" or not name.strip():
            raise Complaint(f"{key}.{name}", 'a line\'s name has no "-" and is not "*"; rename it')


def _check_members(building: FrameBuilding) -> None:
    """What members of all kinds name: stories or floors, and a section or a material."""
    lists = {name: getattr(building, name) for name in ("columns", "beams", "braces")}
    surfaces = {name: getattr(building, name) for name in ("walls", "infills", "slabs")}
    for name, members in {**lists, **surfaces}.items():
        for n, member in enumerate(members):
            key = f"{name}[{n}]"
            if name in lists:
                require(member.section, building.sections, "section", f"{key}.section")
            else:
                building.check_material(member.material, key)
            if name in ("beams", "slabs"):
                resolve(member.floors, building.floors, "floor", f"{key}.floors")
            else:
                resolve(member.stories, building.story_names, "story", f"{key}.stories")


def _check_columns(building: FrameBuilding) -> None:
    grid = building.grid
    for n, columns in enumerate(building.columns):
        key = f"columns[{n}]"
        intersections(grid, columns.at, f"{key}.at")
        for name in resolve(columns.stories, building.story_names, "story", f"{key}.stories"):
            height = building.stories[building.story_names.index(name)].height
            if sum(columns.rigid_ends or ()) >= height - CLOSEST_LINES:
                text = f"they leave nothing of story {name}, {height:g} m high"
                raise Complaint(f"{key}.rigid_ends", f"{text}; shorten them")
        for m, point in enumerate(columns.points):
            for value, lines, axis in zip(point, (grid.x, grid.y), "xy", strict=True):
                low, high = min(lines.values()), max(lines.values())
                if not low <= value <= high:
                    text = f"{axis} = {value:g} m lies outside the grid ({low:g} to {high:g} m)"
                    mend = "add a grid line there or correct it"
                    raise Complaint(f"{key}.points[{m}]", f"{text}; {mend}")


def _check_stretches(building: FrameBuilding) -> None:
    """Where beams, braces, walls and slabs begin and end."""
    grid = building.grid
    for n, beams in enumerate(building.beams):
        key, rigid = f"beams[{n}]", sum(beams.rigid_ends or ())
        for stretch in beam_stretches(grid, beams, key):
            for start, end, length in spans(grid, stretch):
                if beams.rigid_ends is not None and rigid >= length - CLOSEST_LINES:
                    text = f"they leave nothing of the span {start} to {end} on {stretch.line}"
                    raise Complaint(f"{key}.rigid_ends", f"{text}, {length:g} m; shorten them")
    for n, braces in enumerate(building.braces):
        wall_stretch(grid, braces, f"braces[{n}]")
    for n, infill in enumerate(building.infills):
        wall_stretch(grid, infill, f"infills[{n}]")
    for n, wall in enumerate(building.walls):
        wall_stretch(grid, wall, f"walls[{n}]")
        for m, opening in enumerate(wall.openings):
            _check_opening(building, wall, opening, f"walls[{n}].openings[{m}]")
    for n, slab in enumerate(building.slabs):
        slab_lines(slab.x, grid.x, f"slabs[{n}].x")
        slab_lines(slab.y, grid.y, f"slabs[{n}].y")


def _check_opening(building: FrameBuilding, wall: Wall, opening: Opening, key: str) -> None:
    stretch = wall_stretch(building.grid, wall, key)
    low, high = stretch.ends(building.grid)
    if opening.left + opening.width > high - low + CLOSEST_LINES:
        text = f"the opening ends {opening.left + opening.width:g} m from {stretch.start}, the wall"
        raise Complaint(f"{key}.width", f"{text} at {high - low:g} m; make it narrower or move it")
    known = resolve(wall.stories, building.story_names, "story", f"{key}.stories")
    for story in resolve(opening.stories, known, "story of this wall", f"{key}.stories"):
        height = building.stories[building.story_names.index(story)].height
        if opening.bottom + opening.height > height + CLOSEST_LINES:
            text = f"the opening ends {opening.bottom + opening.height:g} m above the floor, story"
            raise Complaint(f"{key}.height", f"{text} {story} at {height:g} m; make it lower")
