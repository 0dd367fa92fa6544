"""Building files: TOML in and out, by path or by the name of a shipped model."""

import logging
import re
import shutil
from collections.abc import Mapping, MutableMapping
from functools import cache
from pathlib import Path
from typing import Any

import tomlkit

from femupdate.building.common import Building as AnyBuilding
from femupdate.building.document import Building, from_document, to_document
from femupdate.building.kinds import FrameBuilding, MeshBuilding
from femupdate.building.mesh import check_mesh
from femupdate.building.model_draft import load_text
from femupdate.building.plausible import doubts
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
