"""Checks across the entries of a building file: every name must name something."""

from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import TYPE_CHECKING

from femupdate.building.analysis import Damping, Prior, RayleighDamping
from femupdate.building.entry import Complaint, unknown
from femupdate.building.members import Beams, Grid, Opening, Wall
from femupdate.building.parameters import by_kind
from femupdate.building.references import (
    Run,
    beam_runs,
    intersections,
    require,
    resolve,
    slab_lines,
    spans,
    wall_run,
)

if TYPE_CHECKING:
    from femupdate.building.schema import FrameBuilding, MeshBuilding


_CLOSEST_LINES = 1e-3  # m; nearer lines are a slip of the pen, and would make needle-thin elements


def check_story_names(names: Iterable[str]) -> None:
    """Raise Complaint where there is no story or two share a name."""
    seen: list[str] = []
    for number, name in enumerate(names):
        if name in seen:
            text = f"{name!r} is the name of stories[{seen.index(name)}] already; rename one"
            raise Complaint(f"stories[{number}].name", text)
        seen.append(name)
    if not seen:
        raise Complaint("stories", "the building has no story; add a [[stories]] table")


def check_prior(prior: Prior, damping: Damping, stories: Iterable[str]) -> None:
    """Raise Complaint where a prior is for an unknown story or for a damping that is fixed."""
    known = list(stories)
    for name in prior.stories:
        if name not in known:
            raise Complaint(f"prior.stories.{name}", unknown("story", name, known))
    if prior.zeta is not None and isinstance(damping, RayleighDamping):
        text = "Rayleigh damping is fixed by its anchors; remove the prior, or use constant damping"
        raise Complaint("prior.zeta", text)


def _check_lines(lines: Mapping[str, float], key: str) -> None:
    if not lines:
        raise Complaint(key, 'it has no line; add one, such as A = "0 m"')
    ordered = sorted(lines.items(), key=lambda item: item[1])
    for (first, low), (second, high) in pairwise(ordered):
        if high - low < _CLOSEST_LINES:
            raise Complaint(f"{key}.{second}", f"it lies on {first!r}; move one or remove it")
    for name in lines:
        if "-" in name or name == "*" or not name.strip():
            raise Complaint(f"{key}.{name}", 'a line\'s name has no "-" and is not "*"; rename it')


def _check_grid(grid: Grid) -> None:
    _check_lines(grid.x, "grid.x")
    _check_lines(grid.y, "grid.y")
    for name in grid.x:
        if name in grid.y:
            raise Complaint(f"grid.x.{name}", "a line of grid.y has the same name; rename one")


def _check_material(building: "FrameBuilding | MeshBuilding", name: str | None, key: str) -> None:
    if name is not None:
        require(name, building.materials, "material", f"{key}.material")
    elif len(building.materials) != 1:
        names = ", ".join(building.materials)
        raise Complaint(f"{key}.material", f"the key is missing; name one of the materials {names}")


def _check_members(building: "FrameBuilding") -> None:
    grid, stories, floors = building.grid, building.story_names, building.floors
    for name, section in building.sections.items():
        _check_material(building, section.material, f"sections.{name}")
    for n, columns in enumerate(building.columns):
        require(columns.section, building.sections, "section", f"columns[{n}].section")
        intersections(grid, columns.at, f"columns[{n}].at")
        _check_points(grid, columns.points, f"columns[{n}].points")
        resolve(columns.stories, stories, "story", f"columns[{n}].stories")
    for n, beams in enumerate(building.beams):
        require(beams.section, building.sections, "section", f"beams[{n}].section")
        _check_spans(grid, beams, beam_runs(grid, beams, f"beams[{n}]"), f"beams[{n}]")
        resolve(beams.floors, floors, "floor", f"beams[{n}].floors")
    for n, wall in enumerate(building.walls):
        wall_run(grid, wall, f"walls[{n}]")
        resolve(wall.stories, stories, "story", f"walls[{n}].stories")
        _check_material(building, wall.material, f"walls[{n}]")
        for m, opening in enumerate(wall.openings):
            _check_opening(building, wall, opening, f"walls[{n}].openings[{m}]")
    for n, slab in enumerate(building.slabs):
        slab_lines(slab.x, grid.x, f"slabs[{n}].x")
        slab_lines(slab.y, grid.y, f"slabs[{n}].y")
        resolve(slab.floors, floors, "floor", f"slabs[{n}].floors")
        _check_material(building, slab.material, f"slabs[{n}]")


def _check_points(grid: Grid, points: tuple[tuple[float, float], ...], key: str) -> None:
    for n, point in enumerate(points):
        for value, lines, axis in zip(point, (grid.x, grid.y), "xy", strict=True):
            low, high = min(lines.values()), max(lines.values())
            if not low <= value <= high:
                text = f"{axis} = {value:g} m lies outside the grid ({low:g} to {high:g} m)"
                raise Complaint(f"{key}[{n}]", f"{text}; add a grid line there or correct it")


def _check_spans(grid: Grid, beams: Beams, runs: tuple[Run, ...], key: str) -> None:
    if beams.rigid_ends is None:
        return
    for run in runs:
        for start, end, length in spans(grid, run):
            if sum(beams.rigid_ends) >= length - _CLOSEST_LINES:
                text = f"they leave nothing of the span {start} to {end} on {run.line}"
                raise Complaint(f"{key}.rigid_ends", f"{text}, {length:g} m; shorten them")


def _check_opening(building: "FrameBuilding", wall: Wall, opening: Opening, key: str) -> None:
    run = wall_run(building.grid, wall, key)
    crossing = building.grid.x if run.axis == 0 else building.grid.y
    length = crossing[run.end] - crossing[run.start]
    if opening.left + opening.width > length + _CLOSEST_LINES:
        text = f"the opening ends {opening.left + opening.width:g} m from {run.start}, the wall at"
        raise Complaint(f"{key}.width", f"{text} {length:g} m; make it narrower or move it")
    known = resolve(wall.stories, building.story_names, "story", f"{key}.stories")
    for story in resolve(opening.stories, known, "story of this wall", f"{key}.stories"):
        height = building.stories[building.story_names.index(story)].height
        if opening.bottom + opening.height > height + _CLOSEST_LINES:
            text = f"the opening ends {opening.bottom + opening.height:g} m above the floor, story"
            raise Complaint(f"{key}.height", f"{text} {story} at {height:g} m; make it lower")


def _check_floor_mass(building: "FrameBuilding | MeshBuilding") -> None:
    given: dict[str, int] = {}
    for n, mass in enumerate(building.floor_mass):
        key = f"floor_mass[{n}].floors"
        for floor in resolve(mass.floors, building.floors, "floor", key):
            if floor in given:
                text = f"floor_mass[{given[floor]}] gives the mass of {floor} already; remove one"
                raise Complaint(key, text)
            given[floor] = n


def _check_sensors(building: "FrameBuilding") -> None:
    intersections(building.grid, building.sensors.points, "sensors.points")
    for floor, points in building.sensors.floors.items():
        require(floor, building.floors, "floor", f"sensors.floors.{floor}")
        intersections(building.grid, points, f"sensors.floors.{floor}")


def _check_standing(building: "FrameBuilding") -> None:
    stories = building.story_names
    named = [columns.stories for columns in building.columns]
    named += [wall.stories for wall in building.walls if wall.is_stiff]
    held = {story for names in named for story in resolve(names, stories, "story", "stories")}
    for number, story in enumerate(stories):
        if story not in held:
            text = f"no column or wall with stiffness stands in story {story!r}; add one"
            raise Complaint(f"stories[{number}]", text)


def check_frame(building: "FrameBuilding") -> None:
    """Raise Complaint for the first entry of a frame building that names nothing it knows."""
    check_story_names(building.story_names)
    check_prior(building.prior, building.damping, building.story_names)
    if not building.materials:
        raise Complaint("materials", "the building has no material; add a [materials.NAME] table")
    _check_grid(building.grid)
    _check_members(building)
    _check_floor_mass(building)
    _check_sensors(building)
    _check_standing(building)
    if by_kind(building) and building.effects:
        text = "effects need one factor a story; remove [parameters], or the effects"
        raise Complaint("effects", text)


def check_mesh_building(building: "MeshBuilding") -> None:
    """Raise Complaint for the first entry of a building with its own mesh that names nothing."""
    check_story_names(building.story_names)
    check_prior(building.prior, building.damping, building.story_names)
    if not building.materials:
        raise Complaint("materials", "the building has no material; add a [materials.NAME] table")
    if not building.parts:
        raise Complaint("parts", "no group of the mesh has a meaning; add a [[parts]] table")
    for name, section in building.sections.items():
        _check_material(building, section.material, f"sections.{name}")
    for n, part in enumerate(building.parts):
        if part.section is not None:
            require(part.section, building.sections, "section", f"parts[{n}].section")
        own = building.sections[part.section].material if part.section is not None else None
        _check_material(building, part.material or own, f"parts[{n}]")
        if part.story is not None:
            require(part.story, building.story_names, "story", f"parts[{n}].story")
    _check_floor_mass(building)
    for floor in building.sensors.floors:
        require(floor, building.floors, "floor", f"sensors.floors.{floor}")
