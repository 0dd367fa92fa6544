"""Models of other programs: the reader of each file, its units, and what a building adds to it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.deck_model import NastranModel
from femupdate.building.entry import Complaint
from femupdate.building.etabs_model import EtabsModel
from femupdate.building.kinds import MeshBuilding
from femupdate.building.model_tables import ModelFile, ReadModel, Said, read_model
from femupdate.building.opensees_model import OpenSeesModel
from femupdate.building.references import resolve
from femupdate.building.sap2000_model import SapModel
from femupdate.building.shipped import program_of
from femupdate.errors import BuildingError, UnitError
from femupdate.units import factor

_READERS: dict[str, Callable[[Path], ModelFile[Any]]] = {
    "Nastran": NastranModel.opened,
    "OpenSees": OpenSeesModel.opened,
    "SAP2000": SapModel.opened,
    "ETABS": EtabsModel.opened,
}
_SYSTEMS = [f"{f},{m}" for f in ("N", "kN", "MN", "kgf", "tf") for m in ("m", "cm", "mm")]
_SYSTEMS += ["lbf,in", "lbf,ft", "kip,in", "kip,ft"]
# Young's modulus (GPa) and density (kg/m3) of concrete, steel, aluminium, timber and masonry.
_USUAL = "15 50 1500 2700 180 220 7400 8200 65 75 2600 2900 5 18 350 900 1 15 1400 2300"
_MATERIALS = np.array(_USUAL.split(), dtype=np.float64).reshape(5, 2, 2)
LACKING = {
    "supports.base": "what holds the base",
    "mesh.diaphragms": "which floors are rigid in plan",
    "mesh.mass": "whether elements have their mass at their nodes",
}


def open_model(file: Path) -> ModelFile[Any]:
    """Parse the model of another program."""
    return _READERS[program_of(file) or ""](file)


def model_units(file: ModelFile[Any], units: str | None) -> tuple[str, str, str]:
    """Units of force and length of a model, and how they are known.

    Args:
        units: as the user says them, such as "kN,m".
    """
    stated, fitting = file.units, _fitting(file)
    if units:
        force, _, length = (part.strip() for part in units.partition(","))
        try:
            factor(force, "force"), factor(length, "length")
        except UnitError as error:
            raise BuildingError(f"--units {units}: {error}; write force and length: N,mm") from None
        if stated is not None and stated != (force, length):
            raise BuildingError(
                f"{file.file.name}: the file is in {','.join(stated)}, not {units}; leave --units "
                "out"
            )
        if stated is None and fitting and f"{force},{length}" not in fitting:
            raise BuildingError(
                f"{file.file.name}: its materials are usual ones in {' or '.join(fitting)}, and "
                f"none in {units}; correct --units or leave it out"
            )
        return force, length, "as you said"
    if stated is not None:
        return *stated, "as the file says"
    if len(fitting) == 1:
        ((system, (young, density)),) = fitting.items()
        force, length = system.split(",")
        why = f"the only ones with a usual material ({young:.4g} GPa, {density:.4g} kg/m3)"
        return force, length, why
    lacks = f"; --draft then asks for {', '.join(LACKING[key] for key in file.lacks)}"
    could = f"could be {' or '.join(fitting)}" if fitting else "tell none"
    raise BuildingError(
        f"{file.file.name}: the file says no units, and its materials {could}; say force and "
        f"length by --units, such as --units N,mm{lacks if file.lacks else ''}"
    )


def _fitting(file: ModelFile[Any]) -> dict[str, Floats]:
    """Systems of units in which all materials of a file are usual ones, with figures of one."""
    known = np.array([pair for pair in file.materials if min(pair) > 0.0]).reshape(-1, 2)
    fitting = {}
    for system in _SYSTEMS:
        newton, metre = (
            factor(u, k) for u, k in zip(system.split(","), ("force", "length"), strict=True)
        )
        scale = np.array([newton / metre**2 * 1e-9, newton / metre**4])
        figures = (known * scale)[:, None, :]
        inside = (figures >= _MATERIALS[..., 0]) & (figures <= _MATERIALS[..., 1])
        if len(known) and inside.all(axis=2).any(axis=1).all():
            fitting[system] = figures[0, 0]
    return fitting


def building_model(building: MeshBuilding) -> ReadModel:
    """The model that a building's file holds, with what the building says beside it."""
    mesh = building.mesh
    file = open_model(Path(mesh.file).expanduser())
    assert mesh.force is not None
    if file.units not in (None, (mesh.force, mesh.unit)):
        raise Complaint("mesh.unit", f"the model is in {','.join(file.units or ())}; write those")
    base = building.supports.base if "supports" in building.model_fields_set else None
    given = {"supports.base": base, "mesh.diaphragms": mesh.diaphragms, "mesh.mass": mesh.mass}
    if missing := [key for key in file.lacks if given[key] is None]:
        keys = "the key is" if len(missing) == 1 else "these keys are"
        unsaid = ", ".join(LACKING[key] for key in missing)
        raise Complaint(
            ", ".join(missing),
            f"{keys} missing; {file.program} does not say {unsaid}, so say it in the building file "
            f"(--draft writes one for {file.file.name})",
        )
    if base == "pinned" and "supports.base" not in file.lacks:
        raise Complaint("supports.base", "the model says what holds the base; change it there")
    rigid = None
    if mesh.diaphragms is not None and mesh.diaphragms != "none":
        named = resolve(mesh.diaphragms, building.floors, "floor", "mesh.diaphragms")
        rigid = tuple(building.floors.index(name) for name in named)
    said = Said(
        ignored=mesh.ignore or (),
        elastic=mesh.elastic or (),
        mass=mesh.mass,
        infills=mesh.infills or 0.0,
        diaphragms=rigid,
        base=base if "supports.base" in file.lacks else None,
        sections={name: section.figures() for name, section in building.sections.items()},
    )
    length, force = factor(mesh.unit, "length"), factor(mesh.force, "force")
    return read_model(file, length, force, said, base=mesh.base, building=building)
