"""list: shipped buildings, effects and formats of measured files."""

import inspect
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from femupdate.building.shipped import building_text, shipped_buildings
from femupdate.effects.effect import Effect
from femupdate.effects.registry import CATALOGUE
from femupdate.measurement.reader import readers
from femupdate.result import Item, Note, Result
from femupdate.units import capital


@dataclass(frozen=True)
class ShippedBuilding:
    """A building that comes with femupdate, by which name commands take it."""

    name: str
    title: str
    kind: str
    stories: int


@dataclass(frozen=True)
class Listing(Result):
    """What comes with femupdate."""

    buildings: tuple[ShippedBuilding, ...]
    effects: tuple[Effect, ...]
    formats: Mapping[str, str]

    def items(self) -> Iterator[Item]:
        """Three lists."""
        width = 2 + max(map(len, self.formats))
        yield Note(
            "Buildings (build-model NAME, or --building NAME)",
            {"buildings": [vars(entry) for entry in self.buildings]},
        )
        for b in self.buildings:
            yield Note(f"  {b.name:<24}{b.stories:>2} stories  {b.title}")
        effects = [
            {
                "name": entry.name,
                "title": entry.title,
                "places": _places(entry),
                "parameters": [
                    {"name": p.name, "unit": p.unit, "meaning": p.text} for p in entry.parameters
                ],
                "explains": entry.sentence,
            }
            for entry in self.effects
        ]
        yield Note("\nEffects (simulate --effect NAME@PLACE=SIZE)", {"effects": effects})
        yield from (Note(line) for entry in self.effects for line in _effect_lines(entry))
        formats = [{"name": name, "reads": reads} for name, reads in self.formats.items()]
        yield Note("\nFormats of measured files", {"formats": formats})
        yield from (Note(f"  {name:<{width}}{reads}") for name, reads in self.formats.items())


def list_all() -> Listing:
    """Everything that comes with femupdate, by name."""
    effects = tuple(CATALOGUE[name] for name in sorted(CATALOGUE))
    formats = {name: reader.READS for name, reader in readers().items()}
    return Listing(tuple(_shipped(name) for name in shipped_buildings()), effects, formats)


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
