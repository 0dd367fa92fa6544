"""The building of a study described: stories, members, assumptions, a view and plans."""

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from femupdate.building.document import to_document
from femupdate.effects.drawn_building import DrawnBuilding
from femupdate.effects.registry import building_effects
from femupdate.effects.structure import structure_of
from femupdate.effects.tolerances import tolerances_of
from femupdate.report.quantities import heights_of
from femupdate.report.scale import mass_scale
from femupdate.result import Item, Note, Notes, Picture, Result
from femupdate.tables import Table
from femupdate.units import capital
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import direction_of

_DRAWN = ("grid", "effects", "provenance", "prior", "frequency_grid", "observation", "reduction")


@dataclass(frozen=True)
class BuildingDescription(Result):
    """A building as its file says it, with the `sensors` of these floors."""

    model: StudyModel
    sensors: tuple[str, ...] = ()

    def items(self) -> Iterator[Item]:
        """Stories, the tables of the file, and what is assumed."""
        building = self.model.building
        yield Note(f"{building.title or building.name}: {len(building.story_names)} stories.")
        yield from (Note(" ".join(part.split())) for part in building.description.split("\n\n"))
        heights, above = heights_of(building), self.model.reduced.story_mass
        scale = mass_scale(above)
        nominal = "nominal " if building.forces_are_relative else ""
        rows = [
            (
                name,
                floor,
                "not given" if heights is None else f"{heights[k]:.3g}",
                f"{above[k] / scale.factor:.4g}",
            )
            for k, (name, floor) in enumerate(
                zip(building.story_names, building.floors, strict=True)
            )
        ]
        head = (
            "story",
            "floor above",
            "height, m",
            f"{nominal}mass above its middle, {scale.unit}",
        )
        yield Table.of(head, rows, name="stories", caption="Stories, from the bottom")
        yield Note("As the building file says it, where * stands for all:")
        yield from self._members()
        listed = building_effects(building).placed
        yield Notes(tuple(f"The building file lists: {placed.in_words}." for placed in listed))
        yield Note("What is assumed:")
        yield Notes(tuple(self._assumptions()))

    def _members(self) -> Iterator[Table]:
        """Materials, sections, members and masses, in the units of the file."""
        building = self.model.building
        document = tomllib.loads(building.source) if building.source else to_document(building)
        single = [
            (f"{key}, {name}".replace("_", " "), _cell(entry))
            for key, value in document.items()
            if isinstance(value, dict) and key not in _DRAWN
            for name, entry in value.items()
            if not isinstance(entry, dict)
        ]
        for key, value in document.items():
            entries = value
            if isinstance(value, dict) and all(isinstance(each, dict) for each in value.values()):
                entries = [{"name": name, **entry} for name, entry in value.items()]
            tables = isinstance(entries, list) and entries and isinstance(entries[0], dict)
            if key in _DRAWN or not tables:
                continue
            keys = list(dict.fromkeys(name for entry in entries for name in entry))
            if key == "stories" and set(keys) <= {"name", "height"}:
                continue
            yield Table.of(
                [name.replace("_", " ") for name in keys],
                [[_cell(entry.get(name, "")) for name in keys] for entry in entries],
                name=f"file_{key}",
                caption=capital(key.replace("_", " ")),
            )

        yield Table.of(("setting", ""), single, name="file_settings", caption="Settings")

    def _assumptions(self) -> Iterator[str]:
        building, axis = self.model.building, direction_of(self.model.building)
        yield "The response is linear within a record: nothing yields, cracks or slides in it."
        yield f"The base moves along {axis}, and floors are measured along {axis}."
        base = "fixed" if building.supports is None else building.supports.base
        yield f"The foot of the building: {base}."
        damping, prior = building.damping, building.prior
        if getattr(building, "springs", ()):
            beside = " with dashpots" if building.has_dashpots else ""
            yield f"Springs{beside} stand between it and the ground, linear and not calibrated."
        if damping.ratios is not None:
            pairs = zip(damping.ratios, damping.anchors or (), strict=True)
            listed = ", ".join(f"{ratio:g} at {hz:g} Hz" for ratio, hz in pairs)
            yield f"Every mode has a damping ratio of its own: {listed}."
        elif damping.anchors is not None:
            low, high = damping.anchors
            yield f"Damping is Rayleigh's: a ratio of {damping.ratio:g} at {low:g} and {high:g} Hz."
        elif prior.zeta is not None:
            yield (
                f"All modes have one damping ratio, anything from {prior.zeta.lower:g} to "
                f"{prior.zeta.upper:g} before the data; predictions without data use "
                f"{damping.ratio:g}."
            )
        else:
            yield f"All modes have the damping ratio {damping.ratio:g}."
        which = "of one kind in its story" if building.by_kind else "that its story owns"
        yield (
            f"A stiffness factor multiplies Young's modulus of everything {which}, alike. Before "
            f"the data it may be anything from {prior.theta.lower:.3g} to {prior.theta.upper:.3g}."
        )
        if not tolerances_of(building):
            yield "Masses, gains of the sensors and clocks are taken to be exact."

    def figures(self) -> Iterator[Picture]:
        """The model at rest, and plans where it has a mesh."""
        from femupdate.report.geometry import Geometry, drawn
        from femupdate.report.plot_building import building_view, story_plans

        building = self.model.building
        drawing = DrawnBuilding(structure_of(building))
        floors = list(
            zip(("base", *building.floors), (drawing.levels - drawing.low[2]).tolist(), strict=True)
        )
        grid = getattr(building, "grid", None)
        lines = () if grid is None else (grid.x, grid.y)
        signs = drawn(drawing.sensors(",".join(self.sensors)))
        shape = Geometry.of_building(drawing)
        yield Picture("model", lambda: building_view(shape, signs, floors, lines))
        mesh = drawing.structure.mesh
        if mesh is not None:
            yield Picture("plans", lambda: story_plans(mesh, building.story_names, lines))


def _cell(value: Any) -> str:
    """An entry of the file as text."""
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_cell(each)}" for name, each in value.items())
    if isinstance(value, list):
        named = value and isinstance(value[0], dict)
        return f"{len(value)}" if named else ", ".join(map(_cell, value))
    return {True: "yes", False: "no"}[value] if isinstance(value, bool) else str(value)
