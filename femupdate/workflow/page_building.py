"""The section of the page on the building: stories, modes, and the model that turns."""

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.building.building_mesh import BuildingMesh
from femupdate.discrepancy.diagnose import NAMED, PARTLY
from femupdate.dynamics.tracking import mean_shape, node_displacements
from femupdate.effects.drawn_building import DrawnBuilding
from femupdate.effects.effect import Placed
from femupdate.effects.registry import CATALOGUE, building_effects
from femupdate.effects.structure import Structure, structure_of
from femupdate.report.geometry import Geometry
from femupdate.report.glyphs import Glyphs, drawn
from femupdate.report.page import Block, Remarks, Scene, Section, Text
from femupdate.report.page_scene import ElementField, MovingShape, scene_content, thinned_geometry
from femupdate.report.scale import mass_scale
from femupdate.study import as_written
from femupdate.tables import Table
from femupdate.workflow.modes import StudyMode, mode_table
from femupdate.workflow.page_parts import PageStudy, read_json
from femupdate.workflow.prediction_quantities import heights_of


def building_section(page: PageStudy) -> Section:
    """What the building is."""
    building = page.model.building
    lead = f"{building.title or building.name}: {len(building.story_names)} stories."
    parts = (lead, *building.description.split("\n\n"))
    modes = page.modes
    blocks: list[Block] = [Text(tuple(part for part in parts if part.strip())), _stories(page)]
    if building.effects:
        listed = tuple(one.in_words for one in building_effects(building).placed)
        blocks.append(Remarks(tuple(f"The building file lists: {one}." for one in listed)))
    if modes:
        blocks.append(mode_table(modes))
    blocks.append(_scene(page, modes))
    return Section("building", "The building", tuple(blocks))


def _stories(page: PageStudy) -> Table:
    building = page.model.building
    heights, above = heights_of(building), page.model.reduced.story_mass
    known = not building.forces_are_relative
    scale = mass_scale(above)
    title = (
        f"mass above its middle, {scale.unit}"
        if known
        else f"nominal mass above its middle, {scale.unit}"
    )
    rows = [
        (
            name,
            floor,
            "not given" if heights is None else f"{heights[k]:.3g}",
            f"{above[k] / scale.factor:.4g}",
        )
        for k, (name, floor) in enumerate(zip(building.story_names, building.floors, strict=True))
    ]
    return Table.of(
        name="stories",
        caption="Stories, from the bottom",
        head=("story", "floor above", "height, m", title),
        rows=tuple(rows),
    )


def _scene(page: PageStudy, modes: tuple[StudyMode, ...]) -> Scene:
    building = page.model.building
    drawing = DrawnBuilding(structure_of(building))
    full = Geometry.of_building(drawing)
    thin = thinned_geometry(full)
    content = scene_content(
        thin,
        _fields(page, drawing.structure, full),
        [_moving(page, drawing, mode) for mode in modes],
        _signs(page, drawing),
        list(zip(("base", *building.floors), drawing.levels.tolist(), strict=True)),
    )
    shown = len(thin.faces) + len(thin.lines)
    every = len(full.shells) + len(full.beams)
    size = f"All {every} elements are drawn."
    if shown < every:
        size = f"Thinned for the screen: {shown} of {every} elements are drawn."
    note = "Drag or use the arrow keys to turn it. Displacements are enlarged."
    return Scene(caption="The model", content=content, note=f"{size} {note}")


def _fields(page: PageStudy, structure: Structure, full: Geometry) -> list[ElementField]:
    """Mean and spread of the stiffness factor of every element."""
    posterior = page.posterior
    if posterior is None:
        return []
    draws = posterior.of("stiffness").samples
    faces, lines = _groups(structure.mesh, full, draws.shape[1])
    mean, spread = draws.mean(axis=0), 100.0 * draws.std(axis=0) / draws.mean(axis=0)
    named = (("stiffness factor", "", mean, "factor"), ("its spread", "%", spread, "spread"))
    return [
        ElementField(
            name=name, unit=unit, faces=_of(values, faces), lines=_of(values, lines), map=colors
        )
        for name, unit, values, colors in named
    ]


def _of(values: Floats, groups: Integers) -> Floats:
    """The value of every element's group; NaN where no factor scales it."""
    return np.asarray(np.where(groups >= 0, values[np.clip(groups, 0, None)], np.nan))


def _groups(mesh: BuildingMesh | None, full: Geometry, count: int) -> tuple[Integers, Integers]:
    """The factor of every face and line, -1 for none."""
    if mesh is None:
        return np.full(len(full.shells), -1), np.tile(np.arange(count), 4)
    none = np.zeros(0, dtype=np.int64)
    both = []
    for dimension in (2, 1):
        own = [one.group for one in mesh.model.elements if one.dimension() == dimension]
        both.append(np.concatenate([none, *own]))
    return both[0], both[1]


def _moving(page: PageStudy, drawing: DrawnBuilding, one: StudyMode) -> MovingShape:
    """A mode with the spread of its displacement over the draws."""
    mode = one.tracked
    model = page.model.reduced
    if model.node_shapes is not None:
        shapes = node_displacements(model, mode.recognised)
    else:
        floors = mode.recognised @ model.floor_shapes.T
        levels = np.column_stack([np.zeros(len(floors)), floors])
        shapes = np.zeros((len(floors), 4 * levels.shape[1], 3))
        shapes[:, :, drawing.structure.direction] = np.repeat(levels, 4, axis=1)
    mean, spread = mean_shape(shapes)
    frequency = "" if one.number is None else f", {mode.frequency_mean:.2f} Hz"
    title = f"{one.name}{frequency}"
    return MovingShape(name=title, shape=mean, spread=100.0 * spread)


def _signs(page: PageStudy, drawing: DrawnBuilding) -> list[tuple[Glyphs, bool]]:
    """Sensors, effects of the building file, and the effect that the finder named."""
    signs: list[tuple[Glyphs, bool]] = []
    if page.posterior is not None:
        floors = ",".join(page.posterior.observation.floors)
        signs.append((drawn(drawing.sensors(floors)), False))
    for placed in (*building_effects(page.model.building).placed, *_named(page)):
        signs.append((drawn(placed.effect.glyphs(drawing, placed.place)), True))
    return signs


def _named(page: PageStudy) -> tuple[Placed, ...]:
    """The effect that a diagnosis of this study named, whole or partly, if any."""
    path = page.study.path("diagnosis.json")
    if page.state("diagnosis") is None:
        return ()
    with as_written(path):
        found = read_json(path)
        if found["verdict"] not in (NAMED, PARTLY):
            return ()
        first = found["effects"][0]
        effect = CATALOGUE.get(first["name"])
        return () if effect is None else (Placed(effect, str(first["place"])),)
