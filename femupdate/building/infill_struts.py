"""Infill walls of a frame as equivalent diagonal struts, two across every bay."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from femupdate.building.blocks import ElementBlock, pinned
from femupdate.building.entry import Complaint
from femupdate.building.kinds import FrameBuilding
from femupdate.building.lattice import Lattice
from femupdate.building.references import (
    Intersection,
    Stretch,
    beam_stretches,
    intersections,
    resolve,
    spans,
    wall_stretch,
)
from femupdate.building.sections import SectionFigures
from femupdate.fe.elements.beam import Beams


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
