"""Models of other programs: their readers and units, and what a building adds to them.

A draft is a building file for such a model: what it holds and what it lacks, with comments.
"""

import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.deck_model import NastranModel
from femupdate.building.entry import ALL, Complaint
from femupdate.building.etabs_model import EtabsModel
from femupdate.building.kinds import MeshBuilding
from femupdate.building.model_tables import ModelFile, ReadModel, Said, read_model
from femupdate.building.opensees_model import OpenSeesModel
from femupdate.building.references import resolve
from femupdate.building.sap2000_model import SapModel
from femupdate.building.shipped import PROGRAMS, building_text, program_of
from femupdate.errors import BuildingError, FemupdateError, StructureError, UnitError
from femupdate.fe.assembly import assemble
from femupdate.fe.solve import lowest_modes
from femupdate.storage import atomic_path
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


_GREAT = 0.2  # of the largest floor's area (or length of beams) is a floor of its own
# Hz: highest frequency, step
_GRIDS = ((2.0, 0.005), (4.0, 0.01), (10.0, 0.02), (25.0, 0.05), (50.0, 0.1))


def floor_levels(read: ReadModel) -> tuple[Floats, list[str]]:
    """Levels (stories,) of the floors above the base, m, and what is not one of them.

    A floor is where slabs lie; without slabs where beams do, else where columns end. BuildingError
    where nothing of this lies above the base.
    """
    model, base = read.model, float(read.model.nodes[read.held, 2].min())
    z, weight = np.zeros(0), np.zeros(0)
    for kind in ("slab", "beam", "column"):  # which ends at a floor
        blocks = [block.taken(np.flatnonzero(block.kind == kind)) for block in model.elements]
        if not len(z) and any(map(len, blocks)):
            z = np.concatenate([model.nodes[b.nodes][:, :, 2].max(axis=1) for b in blocks])
            weight = np.concatenate([block.measure(model.nodes) for block in blocks])
            z, weight = z[z > base + _LOW], weight[z > base + _LOW]
    if not len(z):
        raise BuildingError(
            "no slab, beam or column lies above the nodes that are held; check supports and axes "
            "(z is up)"
        )
    heights, which = np.unique(z.round(3), return_inverse=True)
    area = np.bincount(which.ravel(), weights=weight)
    levels, area = heights[area >= _GREAT * area.max()], area[area >= _GREAT * area.max()]
    while len(levels) > 1:
        gaps = np.diff([base, *levels])
        close = int(gaps.argmin())
        if gaps[close] >= 0.4 * np.median(gaps):  # nearer levels are one floor
            break
        drop = close if close == 0 or area[close] < area[close - 1] else close - 1
        levels, area = np.delete(levels, drop), np.delete(area, drop)
    other = [f"{height - base:.4g}" for height in heights[~np.isin(heights, levels)][:8]]
    return levels - base, other


_LOW = 0.02  # m above the base: the lowest story of a model on a bench


def _open(path: Path, units: str | None) -> tuple[ModelFile[Any], ReadModel, str, str, str]:
    """A model, read whatever a building file must add to it, and its units."""
    file = open_model(path)
    force, length, why = model_units(file, units)
    base = "fixed" if "supports.base" in file.lacks else None
    said = Said(ignored=ALL, elastic=ALL, base=base)
    read = read_model(file, factor(length, "length"), factor(force, "force"), said, base=None)
    return file, read, force, length, why


def draft_text(path: Path, units: str | None, beside: Path) -> str:
    """The building file of another program's model.

    Args:
        units: force and length, where the model does not tell them.
        beside: folder in which the text is to lie.
    """
    file, read, force, length, why = _open(path, units)
    base = float(read.model.nodes[read.held, 2].min())
    levels, other = floor_levels(read)
    names = {round(level - base, 3): name for name, level in read.levels.items()}
    try:
        first = float(lowest_modes(assemble(read.model), np.ones(1), 1).frequency_hz[0])
    except StructureError:  # which is told when it is built
        first = 46.0 / float(levels[-1])
    # Of a podium with towers and of two towers more could not be reduced (25 Hz; 18 and 9 times).
    top = min(8.0 * first, _GRIDS[-1][0])
    step = next(step for most, step in _GRIDS if most >= top)
    middle = 0.5 * (read.model.nodes[:, :2].min(axis=0) + read.model.nodes[:, :2].max(axis=0))
    stories = "\n".join(
        f"[[stories]]\nname = {json.dumps(names.get(round(level, 3), f'S{k}'))}\n"
        f'height = "{height:.9g} m"\n'
        for k, (height, level) in enumerate(zip(np.diff([0.0, *levels]), levels, strict=True), 1)
    )
    more = f"# Levels that are no floor of their own: {', '.join(other)} m.\n" if other else ""
    lines = [f"# {key.partition('.')[2]} = {_SAY[key]}" for key in file.lacks if key in _SAY]
    head = f"# {file.program} does not say these. Correct them, and take the # away."
    lacks = "\n".join([head, *lines, ""]) if file.lacks else ""
    supports = '# [supports]\n# base = "fixed"   # or "pinned"\n\n' if file.lacks else ""
    supports += "".join(
        f"# A section that {file.program} only names: give its sides.\n"
        f'# [sections.{json.dumps(name)}]\n# shape = "I"\n# width = "0.2 m"\n# depth = "0.4 m"\n'
        '# web_thickness = "9 mm"\n# flange_thickness = "14 mm"\n\n'
        for name in file.unsized
    )
    return _DRAFT.format(
        program=file.program,
        name=path.stem,
        unknown=json.dumps(file.unknown or [_EXAMPLES[file.program]]),
        what=file.what,
        file=os.path.relpath(path, beside).replace(os.sep, "/"),
        force=force,
        length=length,
        why=why,
        base=f"{base + read.base:.9g}",
        lacks=lacks,
        supports=supports,
        stories=stories,
        more=more,
        x=f"{middle[0]:.6g}",
        y=f"{middle[1]:.6g}",
        step=step,
        count=round(top / step),
    )


# What a draft proposes where a program says nothing.
_SAY = {
    "mesh.diaphragms": '"*"        # or "none", or some floors: ["2F", "RF"]',
    "mesh.mass": '"lumped"         # as OpenSees does without -cMass, or "consistent"',
}
# An entry that such files may hold and that has no counterpart here.
_EXAMPLES = {"Nastran": "RBE3", "OpenSees": "Joint3D", "SAP2000": "LINK", "ETABS": "LINK"}

_DRAFT = """\
# Written by femupdate for a model of {program}, which has members, masses and supports.
# What it lacks is below: correct it, and say where sensors are.
name = "{name}"
kind = "mesh"

[mesh]
file = "{file}"
unit = "{length}"      # of length in the model, {why}
force = "{force}"
base = "{base} m"      # level of the lowest node that is held
# ignore = {unknown}  # {what} to be left out, which are named and counted
# infills = "15 GPa"  # softer diagonals are struts of infills; without this all are braces
{lacks}
{supports}# Floors lie at the sums of these heights above the base.
# Members belong to the story between whose floors they are. Of towers, setbacks and mezzanines say
# where: on = "S1" (what it stands on), x = ["0 m", "9 m"] and y alike (its part of the plan).
# List it after the story whose part it takes. Floors are named in the order of this list.
{more}{stories}
[sensors]
direction = "x"        # of the measured motion, x or y
points = [["{x} m", "{y} m"]]   # in plan; the nearest node on the level of every floor
# [sensors.floors]      # other points in plan, such as for a tower
# RF = [["0 m", "0 m"], ["10 m", "5 m"]]
# [sensors.at]          # or nodes anywhere: a mezzanine, a split level
# 2F = [["5 m", "0 m", "2 m"]]

[frequency_grid]       # frequencies at which responses are compared
start = "{step} Hz"
step = "{step} Hz"
count = {count}

[prior.theta]          # stiffness of every story over that of the model
lower = "1/3"
upper = 3

[prior.zeta]           # the damping ratio that is sought
lower = 0.005
upper = 0.1

[damping]              # for predictions where nothing was measured
law = "constant"
ratio = 0.02
"""


def _no_model(path: Path | str, what: str) -> BuildingError:
    known = ", ".join(PROGRAMS)
    return BuildingError(f"{path}: {what} another program's model ({known}); leave the option out")


def load_text(path: Path | str, units: str | None) -> tuple[str, str] | None:
    """What to call another program's model, and its draft; None of another file."""
    if program_of(path) is None:
        if units:
            raise _no_model(path, "units belong to")
        return None
    building_text(path)  # which says what is no file
    file = Path(path).expanduser()
    return str(path), draft_text(file, units, file.parent)


def write_draft(model: Path | str, units: str | None, path: Path) -> Path:
    """Write the building file of another program's model, and return its path."""
    if program_of(model) is None:
        raise _no_model(model, "a draft is made of")
    building_text(model)
    text = draft_text(Path(model).expanduser(), units, path.expanduser().parent)
    with atomic_path(path.expanduser(), BuildingError) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return path


def asks(model: Path | str, failure: FemupdateError) -> bool:
    """Whether a draft of this model must be completed, or is where the failure is mended."""
    file = open_model(Path(model).expanduser())
    # Keys that messages name, and no file that is called mesh.bdf.
    keys = r"\b(mesh\.(base|diaphragms|force|ignore|merge|unit)|reduction\.tolerance)\b"
    return bool(file.lacks or file.unsized or re.search(keys, str(failure)))


def model_words(path: Path, units: str | None) -> tuple[str, ...]:
    """What is in another program's model, a sentence each."""
    file = open_model(path)
    try:
        model_units(file, units)
    except BuildingError as error:
        listed = ", ".join(f"{count} {name}" for name, count in file.counts.items())
        return f"{file.what.capitalize()}: {listed}.", f"Units: {error}."
    file, read, force, length, why = _open(path, units)
    levels, other = floor_levels(read)
    size = np.ptp(read.model.nodes, axis=0)
    refused = [f"Refused unless ignored: {', '.join(file.unknown)}."] if file.unknown else []
    lacks = ", ".join(LACKING[key] for key in file.lacks)
    missing = [f"{file.program} does not say {lacks}: a building file must."] if lacks else []
    no_floor = f" No floor of their own: {', '.join(other)} m." if other else ""
    return (
        f"Units {force} and {length}: {why}.",
        f"{size[0]:.4g} m by {size[1]:.4g} m in plan, {size[2]:.4g} m high.",
        f"Floors at {', '.join(f'{z:.4g}' for z in levels)} m above the base.{no_floor}",
        *read.notes,
        *refused,
        *missing,
    )
