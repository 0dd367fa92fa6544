"""Finds beams whose moment would go into a wall's drilling rotation.

The rotation of a shell's node about the shell's normal has no limit under refinement when a moment
acts on it: a beam in the plane of a wall that ends at the wall's edge finds a support that softens
with every halving of the mesh. A column along the edge, or the beam running on along the wall,
carries the moment instead.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from femupdate.building.entry import Complaint
from femupdate.building.members import Grid
from femupdate.building.references import Run, beam_runs, intersections, resolve, wall_run

if TYPE_CHECKING:
    from femupdate.building.schema import FrameBuilding

Cell = tuple[str, int, int]  # line, level (0 is the base), bay along the line
Place = tuple[str, str, int]  # line at constant x, line at constant y, story


def _order(grid: Grid, axis: int) -> list[str]:
    lines = grid.x if axis == 0 else grid.y
    return sorted(lines, key=lines.__getitem__)


def _bays(grid: Grid, run: Run) -> range:
    order = _order(grid, run.axis)
    return range(order.index(run.start), order.index(run.end))


def _beam_cells(building: "FrameBuilding") -> dict[Cell, str]:
    cells: dict[Cell, str] = {}
    for n, beams in enumerate(building.beams):
        for run in beam_runs(building.grid, beams, f"beams[{n}]"):
            for floor in resolve(beams.floors, building.floors, "floor", f"beams[{n}].floors"):
                level = building.floors.index(floor) + 1
                for bay in _bays(building.grid, run):
                    cells[run.line, level, bay] = f"beams[{n}]"
    return cells


def _column_places(building: "FrameBuilding") -> set[Place]:
    stories = building.story_names
    return {
        (point.x, point.y, stories.index(story))
        for n, columns in enumerate(building.columns)
        for point in intersections(building.grid, columns.at, f"columns[{n}].at")
        for story in resolve(columns.stories, stories, "story", f"columns[{n}].stories")
    }


def _walls(building: "FrameBuilding") -> Iterator[tuple[Run, int]]:
    for n, wall in enumerate(building.walls):
        if wall.is_stiff:
            run = wall_run(building.grid, wall, f"walls[{n}]")
            for story in resolve(wall.stories, building.story_names, "story", ""):
                yield run, building.story_names.index(story)


def check_joints(building: "FrameBuilding") -> None:
    """Raise Complaint for a beam that ends in its plane at a wall's edge without a column."""
    grid, beams, columns = building.grid, _beam_cells(building), _column_places(building)
    walls = list(_walls(building))
    walled = {(run.line, story, bay) for run, story in walls for bay in _bays(grid, run)}
    for run, story in walls:
        bays, order = _bays(grid, run), _order(grid, run.axis)
        edges = ((run.start, bays[0], bays[0] - 1), (run.end, bays[-1], bays[-1] + 1))
        for crossing, inside, outside in edges:
            point = (crossing, run.line) if run.axis == 0 else (run.line, crossing)
            if (*point, story) in columns or (run.line, story, outside) in walled:
                continue
            for level in (story, story + 1):
                beam = beams.get((run.line, level, outside))
                if beam is not None and (run.line, level, inside) not in beams:
                    raise Complaint(beam, _advice(run.line, crossing, order[inside : inside + 2]))


def _advice(line: str, crossing: str, bay: list[str]) -> str:
    return (
        f"on line {line!r} a beam ends at the edge of a wall at {crossing!r}, where no column "
        f"takes its moment; let it run on along the wall ({bay[0]} to {bay[1]}) or add a column"
    )
