"""list and examples: shipped buildings, effects, formats of measured files, and example files."""

import inspect
import tomllib
from collections.abc import Iterator
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from femupdate.building.shipped import building_text, shipped_buildings
from femupdate.effects.effect import Effect
from femupdate.effects.registry import CATALOGUE
from femupdate.measurement.reader import readers
from femupdate.result import Note, Told
from femupdate.storage import atomic_path
from femupdate.units import capital


def list_all() -> Told:
    """Shipped buildings, effects with their places and units, and formats of measured files."""
    buildings, effects, told = [], [], list[Note]()
    for name in shipped_buildings():
        content = tomllib.loads(building_text(name)[1])
        known = {"title": content.get("title", name), "kind": content["kind"]}
        buildings.append({"name": name, **known, "stories": len(content["stories"])})
    for name in sorted(CATALOGUE):
        effect = CATALOGUE[name]
        # Where it can sit: in its words, or the first line of its own method's docstring.
        if type(effect).places is Effect.places:
            places = capital(effect.sits)
        else:
            places = (inspect.getdoc(type(effect).places) or "").splitlines()[0].rstrip(".")
        parameters = [
            {"name": p.name, "unit": p.unit, "meaning": p.text} for p in effect.parameters
        ]
        known = {"title": effect.title, "places": places, "parameters": parameters}
        effects.append({"name": name, **known, "explains": effect.sentence})
        told += [Note(f"  {name}: {effect.title.lower()}"), Note(f"      places: {places}")]
        told += [Note(f"      {p.name} [{p.unit}]: {p.text}") for p in effect.parameters]
    formats = [{"name": name, "reads": reader.READS} for name, reader in readers().items()]
    width = 2 + max(len(known["name"]) for known in formats)
    return Told(
        (
            Note("Buildings (build-model NAME, or --building NAME)", {"buildings": buildings}),
            *(Note("  {name:<24}{stories:>2} stories  {title}".format(**b)) for b in buildings),
            Note("\nEffects (simulate --effect NAME@PLACE=SIZE)", {"effects": effects}),
            *told,
            Note("\nFormats of measured files", {"formats": formats}),
            *(Note(f"  {known['name']:<{width}}{known['reads']}") for known in formats),
        )
    )


_LEFT_OUT = ("__init__.py", "__pycache__")


def copy_examples(folder: Path | str = "examples") -> Told:
    """Copy the shipped example and building files into a folder; files there stay as they are.

    Raises:
        StudyError: a file cannot be written.
    """
    copied, kept = [], []
    models = [
        (Path("models") / name, source)
        for name, source in _shipped(files("femupdate.models"))
        if name.suffix == ".toml"
    ]
    for name, source in (*_shipped(files("femupdate.examples")), *models):
        target = Path(folder) / name
        if target.exists():
            kept.append(target)
            continue
        with atomic_path(target) as temporary:
            temporary.write_bytes(source.read_bytes())
        copied.append(target)
    there = (f"  {path} was there already and stays as it is" for path in kept)
    return Told(
        (
            Note(f"Examples in {folder}:", {"folder": folder}),
            Note("\n".join(f"  {path}" for path in copied), {"copied": tuple(copied)}),
            Note("\n".join(there), {"kept": tuple(kept)}),
        )
    )


def _shipped(folder: Traversable, above: Path = Path()) -> Iterator[tuple[Path, Traversable]]:
    """Path below the folder and content of every file."""
    for entry in sorted(folder.iterdir(), key=lambda path: path.name):
        if entry.name in _LEFT_OUT:
            continue
        if entry.is_dir():
            yield from _shipped(entry, above / entry.name)
        else:
            yield above / entry.name, entry
