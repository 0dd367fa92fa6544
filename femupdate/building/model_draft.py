"""A building file for another program's model: what it holds and what it lacks, with comments."""

import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.entry import ALL
from femupdate.building.model_files import LACKING, model_units, open_model
from femupdate.building.model_tables import ModelFile, ReadModel, Said, read_model
from femupdate.building.shipped import PROGRAMS, building_text, program_of
from femupdate.errors import BuildingError, FemupdateError, StructureError
from femupdate.fe.assembly import assemble
from femupdate.fe.solve import lowest_modes
from femupdate.storage import atomic_path
from femupdate.units import factor

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
