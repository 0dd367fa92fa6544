"""list: shipped buildings, effects and formats of measured files."""

import inspect
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from femupdate.building.shipped import building_text, shipped_buildings
from femupdate.effects.effect import Effect
from femupdate.effects.registry import CATALOGUE
from femupdate.measurement.reader import readers
from femupdate.result import Item, Note, Result
from femupdate.units import capital


@dataclass(frozen=True)
class Listing(Result):
    """What comes with femupdate.

    Attributes:
        buildings: name, by which commands take it, title, kind and stories of each.
        formats: what each reads, by its name.
    """

    buildings: tuple[dict[str, Any], ...]
    effects: tuple[Effect, ...]
    formats: Mapping[str, str]

    def items(self) -> Iterator[Item]:
        """Three lists."""
        width = 2 + max(map(len, self.formats))
        yield Note(
            "Buildings (build-model NAME, or --building NAME)",
            {"buildings": list(self.buildings)},
        )
        for building in self.buildings:
            yield Note("  {name:<24}{stories:>2} stories  {title}".format(**building))
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
        for effect in self.effects:
            yield Note(f"  {effect.name}: {effect.title.lower()}")
            yield Note(f"      places: {_places(effect)}")
            yield from (Note(f"      {p.name} [{p.unit}]: {p.text}") for p in effect.parameters)
        formats = [{"name": name, "reads": reads} for name, reads in self.formats.items()]
        yield Note("\nFormats of measured files", {"formats": formats})
        yield from (Note(f"  {name:<{width}}{reads}") for name, reads in self.formats.items())


def list_all() -> Listing:
    """Everything that comes with femupdate, by name."""
    effects = tuple(CATALOGUE[name] for name in sorted(CATALOGUE))
    formats = {name: reader.READS for name, reader in readers().items()}
    buildings = []
    for name in shipped_buildings():
        content = tomllib.loads(building_text(name)[1])
        stories = len(content["stories"])
        title = content.get("title", name)
        buildings.append(
            {"name": name, "title": title, "kind": content["kind"], "stories": stories}
        )
    return Listing(tuple(buildings), effects, formats)


def _places(effect: Effect) -> str:
    """Where an effect can sit: in its words, or the first line of its own method's docstring."""
    if type(effect).places is Effect.places:
        return capital(effect.sits)
    return (inspect.getdoc(type(effect).places) or "").splitlines()[0].rstrip(".")
