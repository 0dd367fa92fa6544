"""Building files: TOML in and out, by path or by the name of a shipped model.

Before anything is computed, an engineer would ask about some figures of such a file.
"""

import logging
import re
import shutil
from collections.abc import Iterator, Mapping, MutableMapping
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from femupdate.building.common import Building as AnyBuilding
from femupdate.building.document import Building, from_document, to_document
from femupdate.building.kinds import (
    FrameBuilding,
    MeshBuilding,
    ShearBuilding,
    shear_operators,
)
from femupdate.building.members import Slab
from femupdate.building.mesh import check_mesh
from femupdate.building.model_files import load_text
from femupdate.building.references import resolve
from femupdate.building.shipped import building_text
from femupdate.errors import BuildingError
from femupdate.storage import atomic_path, toml_content

# How the text of other programs' models begins.
_FOREIGN = {
    "ETABS": re.compile(r'^\s*(\$ (File|PROGRAM|STORIES)|PROGRAM\s+"ETABS")', re.MULTILINE),
    "OpenSees": re.compile(r"^\s*(wipe\s*$|model\s+basic|ops\.model\()", re.M | re.I),
}
_FOREIGN_MENDS = {
    "ETABS": "give its file the ending .e2k",
    "OpenSees": 'let it print("-JSON", "-file", "model.json"), and name that',
}
_log = logging.getLogger(__name__)


def load_building(path_or_name: str | Path, units: str | None = None) -> Building:
    """Return the building of a file, or a shipped one by its name.

    Args:
        path_or_name: a path to a TOML file or to another program's model, or a name such as
            "six_story_wall_frame".
        units: force and length of a model, such as "N,mm", where it does not tell them.

    Raises:
        BuildingError: no such file, not TOML, or an entry that cannot be; the message names the
            file, the key and the mend.
    """
    deck = load_text(path_or_name, units)
    where, text = deck or building_text(path_or_name)
    try:
        document = toml_content(text)
    except ValueError as error:
        foreign = next((name for name, begins in _FOREIGN.items() if begins.search(text)), None)
        raise BuildingError(
            f"{where}: this is a model of {foreign}; {_FOREIGN_MENDS[foreign]}"
            if foreign
            else f"{where}: {error}"
        ) from None
    try:
        building = from_document(document, where, from_file=True)
    except RecursionError:
        raise BuildingError(
            f"{where}: its lists or tables are nested too deeply; write the "
            "building as in a shipped file"
        ) from None
    building.__dict__["source"] = text  # what a cached property of it would be
    if isinstance(building, MeshBuilding):
        building = _with_mesh_file(building, Path(where).expanduser().parent / building.mesh.file)
    try:
        for doubt in doubts(building):
            _warn_once(f"{where}: {doubt}")
        if isinstance(building, FrameBuilding | MeshBuilding):
            check_mesh(building)
    except BuildingError as error:
        if deck:
            raise
        raise BuildingError(f"{where}: {error}") from None
    return building


AnyBuilding.load = staticmethod(load_building)


_warn_once = cache(_log.warning)


def _with_mesh_file(building: MeshBuilding, file: Path) -> MeshBuilding:
    return building.model_copy(
        update={"mesh": building.mesh.model_copy(update={"file": str(file)})}
    )


def save_building(building: Building, path: str | Path) -> Path:
    """Write the building as TOML that loads back equal, and return the path.

    The file appears whole or not at all. Of a building that was read from a file, or that changes
    one, the text stays with all its comments but for what has changed. The mesh of a building of
    kind "mesh" is copied beside it, so that the two can be moved together.

    Raises:
        BuildingError: the file cannot be written.
    """
    target = Path(path).expanduser()
    if isinstance(building, MeshBuilding):
        source = Path(building.mesh.file).expanduser()
        copy = target.with_name(f"{target.stem}_mesh{source.suffix}")
        if not (copy.exists() and source.exists() and copy.samefile(source)):
            with atomic_path(copy, BuildingError) as temporary:
                shutil.copyfile(source, temporary)
        building = _with_mesh_file(building, Path(copy.name))
    text = to_toml(building)
    with atomic_path(target, BuildingError) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return target


def to_toml(building: Building) -> str:
    """The text of a building's file, with the comments of the file that it was read from."""
    document = to_document(building)
    if building.source:
        text = tomlkit.parse(building.source)
        _change(text, to_document(from_document(text.unwrap())), document)
        if to_document(from_document(tomlkit.parse(tomlkit.dumps(text)).unwrap())) == document:
            return tomlkit.dumps(text)
    return tomlkit.dumps({name: _item(value) for name, value in document.items()})


def _change(
    text: MutableMapping[str, Any], before: Mapping[str, Any], after: Mapping[str, Any]
) -> None:
    """Change what differs in the tables of a file."""
    for name in before.keys() - after.keys():
        del text[name]
    for name, value in after.items():
        old = before.get(name)
        if old == value:
            continue
        if isinstance(old, dict) and isinstance(value, dict):
            _change(text[name], old, value)
        elif isinstance(old, list) and isinstance(old[0], dict) and value[: len(old)] == old:
            for table in value[len(old) :]:  # tables that were added
                text[name].append(_item(table))
        else:
            text[name] = _item(value)


def _item(value: Any) -> Any:
    """An entry as TOML: text of several lines is written as such."""
    if isinstance(value, str) and "\n" in value:
        return tomlkit.string(value, multiline=True)
    return tomlkit.item(value)


# Young's moduli in GPa, by words in the name of a material.
_USUAL = {
    "steel": (150.0, 250.0),
    "alumin": (60.0, 80.0),
    "concrete": (10.0, 60.0),
    "masonry": (0.3, 30.0),
    "brick": (0.3, 30.0),
    "timber": (3.0, 20.0),
    "wood": (3.0, 20.0),
    "": (1.0, 1000.0),
}
_WRONG_UNIT = 10.0  # times beyond what is usual, from where a named material is refused


def doubts(building: Building) -> Iterator[str]:
    """Yield what is odd about a building's figures, a sentence each."""
    yield from _names(building)
    yield from _heights(building)
    if isinstance(building, ShearBuilding):
        return
    for name, material in building.materials.items():
        kind = next(word for word in _USUAL if word in name.lower())
        (low, high), modulus = _USUAL[kind], material.youngs_modulus / 1e9
        key, usual = f"materials.{name}", f"{low:g} to {high:g} GPa are usual"
        if kind and not low / _WRONG_UNIT <= modulus <= high * _WRONG_UNIT:
            text = f"{modulus:.3g} GPa is no {name}, of which {usual}; is the unit wrong?"
            raise BuildingError(f"{key}.youngs_modulus: {text} Correct it")
        if not low <= modulus <= high:
            text = usual if kind else "steel has 210, concrete 20 to 45, timber 5 to 15"
            yield f"{key}: youngs_modulus is {modulus:.3g} GPa, and {text}: is the unit wrong?"
        if not material.density:
            yield f"{key}: density is zero: the members made of it weigh nothing"
        elif not 300.0 <= material.density <= 9000.0:  # of timber and of steel
            usual = "steel has 7850, concrete 2400, timber 500: is the unit wrong?"
            yield f"{key}: density is {material.density:.3g} kg/m3, and {usual}"
    deck = isinstance(building, MeshBuilding) and building.from_program
    if "supports" not in building.model_fields_set and not deck:
        yield "supports: the table is left out, so the base is fixed in all six directions"
    if isinstance(building, FrameBuilding):
        yield from _wide_sections(building)
        yield from _soft_slabs(building)


def _names(building: Building) -> Iterator[str]:
    """Stories are listed from the bottom; drawings list them from the top."""
    parts = [re.fullmatch(r"(\D*)(\d+)", name) for name in building.story_names]
    counts = [(part[1], int(part[2])) for part in parts if part is not None]
    same = len(counts) == len(parts) > 1 and len({prefix for prefix, _ in counts}) == 1
    if same and all(low > high for (_, low), (_, high) in pairwise(counts)):
        names = building.story_names
        yield (
            f"stories: {names[0]} is the lowest and {names[-1]} the highest, as they are listed "
            "from the bottom to the top, but their names count downwards: is the order right?"
        )


def _heights(building: Building) -> Iterator[str]:
    """Stories as high as none is, and sticks whose frequency no building of their height has."""
    low, high = 0.1, 20.0  # m
    heights: list[float | None] = [story.height for story in building.stories]
    for name, height in zip(building.story_names, heights, strict=True):
        if height is None or low <= height <= high:
            continue
        text = f"stories: {name} is {height:g} m high: is the unit wrong?"
        # A mesh of such a story runs for minutes into the limits of the solver.
        meshed = not isinstance(building, ShearBuilding)
        if meshed and not low / _WRONG_UNIT <= height <= high * _WRONG_UNIT:
            raise BuildingError(f"{text} Correct its height")
        yield text
        return
    total = sum(height or np.nan for height in heights)
    if isinstance(building, ShearBuilding) and building.masses_known and total == total:
        stiffness, mass = shear_operators(building)
        terms = stiffness.sum(axis=0) / np.diag(mass)[:, None]
        first = float(np.sqrt(np.linalg.eigvals(terms).real.min())) / (2.0 * np.pi)
        usual = 46.0 / total  # Ellis (1980), Proc. ICE 69, of 163 buildings
        if not 0.02 * usual <= first <= 10.0 * usual:
            yield (
                f"the lowest frequency is {first:.3g} Hz, and buildings so high have about "
                f"{usual:.2g} Hz: are the units of mass and stiffness right?"
            )


def _wide_sections(building: FrameBuilding) -> Iterator[str]:
    height = dict(zip(building.story_names, building.stories, strict=True))
    lowest: dict[str, tuple[float, str]] = {}
    for columns in building.columns:
        for story in resolve(columns.stories, building.story_names, "story", "columns"):
            here = (height[story].height, story)
            lowest[columns.section] = min(here, lowest.get(columns.section, here))
    for name, (limit, story) in lowest.items():
        size = max(building.sections[name].figures().size)
        if size > limit:
            yield (
                f"sections.{name}: a column {size:.3g} m wide stands in story {story}, which is "
                f"{limit:.3g} m high: is the unit wrong?"
            )


def _soft_slabs(building: FrameBuilding) -> Iterator[str]:
    """Floors that bend far below the top of the grid, whose modes are many."""
    totals = {
        floor: mass.total
        for mass in building.floor_mass
        for floor in resolve(mass.floors, building.floors, "floor", "floor_mass")
    }
    areas = dict.fromkeys(building.floors, 0.0)
    on = [resolve(slab.floors, building.floors, "floor", "slabs") for slab in building.slabs]
    for slab, floors in zip(building.slabs, on, strict=True):
        for floor in floors:
            areas[floor] += float(np.prod([sum(bays) for bays in _bays(building, slab)]))
    for number, (slab, floors) in enumerate(zip(building.slabs, on, strict=True)):
        a, b = (max(bays) for bays in _bays(building, slab))
        material = building.material(slab.material)
        rigidity = material.youngs_modulus * slab.thickness**3 / 12.0
        rigidity /= 1.0 - material.poisson_ratio**2
        alone = material.density * slab.thickness
        mass = max([alone, *(totals.get(floor, 0.0) / areas[floor] for floor in floors)])
        # First mode of a simply supported plate (Leissa 1969, Vibration of Plates, section 4.1).
        first = 0.5 * np.pi * (a**-2 + b**-2) * np.sqrt(rigidity / max(mass, 1e-9))
        # A grid up to four times a floor's first frequency holds many of its modes.
        if building.frequency_grid.stop > 4.0 * first:
            yield (
                f"slabs[{number}]: bays of {a:g} by {b:g} m bend from about {first:.2g} Hz, far "
                f"below the top of the frequency grid, {building.frequency_grid.stop:g} Hz; "
                f"should the reduction fail, let the grid end at about {2.0 * first:.2g} Hz"
            )
            return


def _bays(building: FrameBuilding, slab: Slab) -> Iterator[list[float]]:
    """Widths of the bays that a slab spans along x, and along y, m."""
    for lines, (start, end) in ((building.grid.x, slab.x), (building.grid.y, slab.y)):
        low, high = sorted((lines[start], lines[end]))
        inside = sorted(value for value in lines.values() if low <= value <= high)
        yield [after - before for before, after in pairwise(inside)]
