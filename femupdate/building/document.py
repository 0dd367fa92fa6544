"""The kinds of building as plain documents, their hashes, and their stiffness factors."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from femupdate.building.deck import whole_text
from femupdate.building.entry import as_building_error
from femupdate.building.kinds import FrameBuilding, MeshBuilding, ShearBuilding
from femupdate.errors import BuildingError, close

Building = FrameBuilding | MeshBuilding | ShearBuilding

KINDS: Mapping[str, type[Building]] = {
    "frame": FrameBuilding,
    "mesh": MeshBuilding,
    "shear": ShearBuilding,
}


_EMPTY: tuple[Any, ...] = ({}, [], "")  # each is the default of the entry that holds it
# What a trained surrogate or a reduced model does not depend on.
_NOT_MECHANICS = (
    *("name", "title", "description", "observation", "reduction", "provenance"),
    "tolerances",
)


def to_document(building: Building) -> dict[str, Any]:
    """Return the building as the tables of its file, quantities as text with their units."""
    dumped = building.model_dump(mode="json", by_alias=True, exclude_none=True)
    return {name: _without_empty(item) for name, item in dumped.items() if item not in _EMPTY}


def _without_empty(value: Any) -> Any:
    if isinstance(value, Mapping):
        inner = {name: _without_empty(item) for name, item in value.items()}
        return {name: item for name, item in inner.items() if item not in _EMPTY}
    return [_without_empty(item) for item in value] if isinstance(value, list) else value


def from_document(
    document: Mapping[str, Any], where: str = "building", *, from_file: bool = False
) -> Building:
    """Return the validated building.

    Args:
        where: what to call the document in a message, such as the file's name.
        from_file: refuse bare numbers where a quantity with its unit belongs.

    Raises:
        BuildingError: with the key in question and the mend.
    """
    kind = document.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        hint = close(kind, KINDS) if isinstance(kind, str) else ""
        said = "the key is missing" if kind is None else f"{kind!r} is not a kind of building"
        raise BuildingError(f'{where}: kind: {said}; write "frame", "mesh" or "shear"{hint}')
    context = {"file": where} if from_file else None
    try:
        return KINDS[kind].model_validate(dict(document), context=context)
    except ValidationError as error:
        raise as_building_error(error, document, where) from None


def _by_content(building: Building) -> dict[str, Any]:
    """Return the document with what is in the mesh file in place of where it is."""
    document = to_document(building)
    if isinstance(building, MeshBuilding):
        try:
            path = Path(building.mesh.file).expanduser()
            content = path.read_bytes()
        except OSError as error:
            raise BuildingError(
                f"{building.name}: mesh.file: {building.mesh.file} cannot be read "
                f"({error.strerror}); correct the path"
            ) from None
        if building.from_program and b"INCLUDE" in content.upper():
            content = whole_text(path).encode()
        document["mesh"]["file"] = hashlib.sha256(content).hexdigest()
    return document


def mechanics_hash(building: Building) -> str:
    """Return the SHA-256 (hexadecimal) of what a simulated data set depends on.

    That is the mechanics, the sensors, the priors and the frequency grid; not names and texts, nor
    the noise of observations, the tolerance of the reduction, or the damping ratio of predictions
    where zeta has a prior.
    """
    document = {k: v for k, v in _by_content(building).items() if k not in _NOT_MECHANICS}
    if building.damping.law == "constant" and building.prior.zeta is not None:
        document["damping"] = {"law": "constant"}
    text = json.dumps(document, sort_keys=True, ensure_ascii=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def without_effects(building: Building) -> Building:
    """The same building without its effects."""
    return building.model_copy(update={"effects": ()})


def factor_titles(building: Building) -> dict[str, str]:
    """Return what every stiffness factor is of, bottom to top: {"theta_1": "story S1", ...}."""
    return {f"theta_{k}": f"story {name}" for k, name in enumerate(building.story_names, 1)}


def factor_ranges(building: Building) -> dict[str, tuple[float, float]]:
    """Return lowest and highest value of every stiffness factor, by its name."""
    ranges = [building.prior.theta_of(story) for story in building.story_names]
    names = factor_titles(building)
    return {name: (kept.lower, kept.upper) for name, kept in zip(names, ranges, strict=True)}
