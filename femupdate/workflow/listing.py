"""list: shipped buildings, effects and formats of measured files."""

import inspect
import tomllib
from dataclasses import dataclass
from typing import Any

from femupdate.building.shipped import building_text, shipped_buildings
from femupdate.effects.effect import Effect
from femupdate.effects.registry import CATALOGUE
from femupdate.measurement.reader import Reader
from femupdate.measurement.registry import readers
from femupdate.units import capital


@dataclass(frozen=True)
class ShippedBuilding:
    """A building that comes with femupdate.

    Attributes:
        name: by which commands take it.
        title: what it is.
        kind: "frame", "shear" or "mesh".
        stories: how many.
    """

    name: str
    title: str
    kind: str
    stories: int


@dataclass(frozen=True)
class Listing:
    """What comes with femupdate.

    Attributes:
        buildings: shipped ones.
        effects: of the catalogue.
        formats: of measured files.
    """

    buildings: tuple[ShippedBuilding, ...]
    effects: tuple[Effect, ...]
    formats: tuple[Reader, ...]

    def as_dict(self) -> dict[str, Any]:
        """What `--json` holds."""
        return {
            "buildings": [vars(one) for one in self.buildings],
            "effects": [
                {
                    "name": one.name,
                    "title": one.title,
                    "places": _places(one),
                    "parameters": [
                        {"name": p.name, "unit": p.unit, "meaning": p.text} for p in one.parameters
                    ],
                    "explains": one.sentence,
                }
                for one in self.effects
            ],
            "formats": [{"name": one.name, "reads": one.reads} for one in self.formats],
        }

    def lines(self) -> tuple[str, ...]:
        """Three tables, for people."""
        width = 2 + max(len(one.name) for one in self.formats)
        return (
            "Buildings (build-model NAME, or --building NAME)",
            *(f"  {b.name:<24}{b.stories:>2} stories  {b.title}" for b in self.buildings),
            "",
            "Effects (simulate --effect NAME@PLACE=SIZE)",
            *(line for one in self.effects for line in _effect_lines(one)),
            "",
            "Formats of measured files",
            *(f"  {one.name:<{width}}{one.reads}" for one in self.formats),
        )


def list_all() -> Listing:
    """Everything that comes with femupdate, by name."""
    effects = tuple(CATALOGUE[name] for name in sorted(CATALOGUE))
    return Listing(
        tuple(_shipped(name) for name in shipped_buildings()), effects, tuple(readers().values())
    )


def _shipped(name: str) -> ShippedBuilding:
    content = tomllib.loads(building_text(name)[1])
    stories = len(content["stories"])
    return ShippedBuilding(name, content.get("title", name), content["kind"], stories)


def _places(effect: Effect) -> str:
    """Where an effect can sit: in its words, or the first line of its own method's docstring."""
    if type(effect).places is Effect.places:
        return capital(effect.sits)
    return (inspect.getdoc(type(effect).places) or "").splitlines()[0].rstrip(".")


def _effect_lines(effect: Effect) -> tuple[str, ...]:
    """Name, places and parameters of an effect."""
    parameters = [f"{p.name} [{p.unit}]: {p.text}" for p in effect.parameters]
    return (
        f"  {effect.name}: {effect.title.lower()}",
        f"      places: {_places(effect)}",
        *(f"      {one}" for one in parameters),
    )
