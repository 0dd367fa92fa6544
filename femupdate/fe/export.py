"""A finite-element model for other programs: a Python script for OpenSeesPy, a deck of Nastran.

The script rebuilds the model and prints its frequencies, as a check. It stands alone and holds the
model as tables of text. It needs `openseespy`, whose licence restricts commercial redistribution;
femupdate itself never imports it.
"""

from collections.abc import Mapping

import numpy as np

from femupdate import __version__
from femupdate.arrays import Floats
from femupdate.errors import StructureError
from femupdate.fe.elements.beam import Beams
from femupdate.fe.model import (
    DOF_NAMES,
    DOF_PER_NODE,
    FiniteElementModel,
    RigidLinks,
    check_model,
    group_factors,
)
from femupdate.fe.opensees import OpenSeesPart, OpenSeesTable, numbers
from femupdate.fe.surface import Surface

_RIGID = np.ones(6, dtype=np.bool_)
_DIAPHRAGM = np.array([True, True, False, False, False, True])
_NO_TYPES: Mapping[str, str] = {}


def opensees_script(
    model: FiniteElementModel,
    theta: Floats,
    *,
    name: str = "model",
    modes: int = 12,
    types: Mapping[str, str] = _NO_TYPES,
) -> str:
    """Return the script.

    Elements become what their kind says (see `Elements.opensees`), point masses nodal masses,
    springs zeroLength elements, rigid links rigidLink and rigidDiaphragm. The stiffness factors
    are in the moduli.

    Args:
        modes: how many to ask for by default.
        types: the element type to use for a kind of element, such as {"shell": "ShellMITC4"}; the
            first of its `opensees_types` for the others.

    Raises:
        StructureError: a link ties single directions, theta has another length, or a type does not
            fit its kind.
    """
    check_model(model)
    factors = np.asarray(theta, dtype=float)
    if factors.shape != (model.groups,):
        raise StructureError(
            f"the export needs {model.groups} stiffness parameters; got {factors.size}"
        )
    parts = [
        block.opensees(block.youngs_modulus * group_factors(block.group, factors))
        for block in model.elements
    ]
    known = {block.name: block.opensees_types for block in model.elements if block.opensees_types}
    for kind, named in types.items():
        if kind in known and named not in known[kind]:
            raise StructureError(
                f"{named} cannot stand for a {kind} in OpenSees; use {', '.join(known[kind])}"
            )
    head = _HEAD.format(
        name=name,
        version=__version__,
        modes=modes,
        theta=numbers(factors),
        types={kind: types.get(kind, first) for kind, (first, *_) in known.items()},
    )
    tables = _tables(model, factors, parts)
    text = "".join(table.text(key) for key, table in tables.items())
    code = "".join(part.code for part in parts).strip().replace("\n", "\n    ")
    return head + text + _BODY.replace("    ELEMENTS", f"    {code}")


def _tables(
    model: FiniteElementModel, factors: Floats, parts: list[OpenSeesPart]
) -> dict[str, OpenSeesTable]:
    held, springs = np.flatnonzero(model.fixed.any(axis=1)), model.springs
    stiffness = springs.stiffness * group_factors(springs.group, factors)
    # One row per node: OpenSees keeps the last mass of a node and drops the others.
    masses = model.masses
    heavy, where = np.unique(masses.node, return_inverse=True)
    values = np.zeros((len(heavy), DOF_PER_NODE))
    np.add.at(values, where, np.column_stack([masses.mass, masses.inertia]))
    tables = {
        "NODES": OpenSeesTable(("x", "y", "z"), [model.nodes]),
        "SUPPORTS": OpenSeesTable(("node", *DOF_NAMES), [held, model.fixed[held].astype(int)]),
        "MASSES": OpenSeesTable(
            ("node", "kg along x", "y", "z", "kg m2 about x", "y", "z"), [heavy, values]
        ),
        "SPRINGS": OpenSeesTable(
            ("node", "node or -1", "direction", "N/m or N m/rad", "N s/m or N m s/rad"),
            [springs.nodes, springs.direction, stiffness, springs.dashpots],
        ),
        "RIGID": _links(model.links, _RIGID),
        "DIAPHRAGM": _links(model.links, _DIAPHRAGM),
    }
    for part in parts:
        tables.update(part.tables)
    return tables


def _links(links: RigidLinks, tied: np.ndarray) -> OpenSeesTable:
    """Links of one kind, each to the last master of its chain."""
    chosen, rigid, plan = ((links.tied == ties).all(axis=1) for ties in (tied, _RIGID, _DIAPHRAGM))
    known = rigid | plan
    if not known.all():
        first = int((~known).argmax())
        raise StructureError(
            f"the rigid link from node {links.master[first]} to node {links.slave[first]} ties "
            "neither all six motions nor those of a floor in its plane; OpenSees has no such link"
        )
    # OpenSees does not follow chains of links.
    whole = links.tied.all(axis=1)
    follows = dict(zip(links.slave[whole].tolist(), links.master[whole].tolist(), strict=True))
    masters = links.master.copy()
    for k, master in enumerate(masters.tolist()):
        while master in follows:
            master = follows[master]
        masters[k] = master
    return OpenSeesTable(("master", "slave"), [masters[chosen], links.slave[chosen]])


_HEAD = '''#!/usr/bin/env python3
"""{name} in OpenSeesPy: builds the model, runs its modal analysis and prints the frequencies.

Written by femupdate {version}. Install OpenSees with `pip install openseespy`, then run
    python THIS_FILE [--modes {modes}] [--solver SparseGeneral]
--help shows which element types can be chosen.
SI units throughout: m, N, kg, s. Stiffness factors in the moduli: {theta}
"""

import argparse
import itertools
import json
import time

import numpy as np
import openseespy.opensees as ops

MODES = {modes}
TYPES = {types}  # element type of OpenSees for each kind of element


def table(text):
    return [[float(word) for word in line.split()] for line in text.strip().splitlines()]


'''

_BODY = '''MASTERS = {int(slave) + 1: int(master) + 1 for master, slave in RIGID}
TAGS = {"node": itertools.count(len(NODES) + 1)}
ARMS = []


def new(what):
    """The next free tag of a node, an element, a section or a material."""
    return next(TAGS.setdefault(what, itertools.count(1)))


def whole(values):
    """Node numbers as OpenSees wants them, counted from 1."""
    return [int(value) + 1 for value in values]


def build():
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    for number, point in enumerate(NODES, start=1):
        ops.node(number, *point)
    for node, *held in SUPPORTS:
        ops.fix(int(node) + 1, *[int(flag) for flag in held])
    for node, *mass in MASSES:
        ops.mass(int(node) + 1, *mass)
    ELEMENTS
    for first, second, direction, *figures in SPRINGS:
        spring(*whole((first, second, direction)), *figures)
    for master, slave in RIGID:
        ops.rigidLink("beam", *whole((master, slave)))
    for master, slave in DIAPHRAGM:
        ops.rigidDiaphragm(3, *whole((master, slave)))


def arm(node, offset):
    """The tag of the node at the end of a rigid arm from a node."""
    start = int(node) + 1
    if not any(offset):
        return start
    end = new("node")
    ops.node(end, *(np.array(NODES[start - 1]) + offset).tolist())
    ops.rigidLink("beam", MASTERS.get(start, start), end)
    ARMS.append(end)
    return end


def spring(first, second, direction, stiffness, damping):
    if second == 0:  # a spring to the ground: a held node in the same place
        second = new("node")
        ops.node(second, *NODES[first - 1])
        ops.fix(second, 1, 1, 1, 1, 1, 1)
    material = new("material")
    ops.uniaxialMaterial("Elastic", material, stiffness, damping)
    connection = (second, first, "-mat", material, "-dir", direction)
    ops.element("zeroLength", new("element"), *connection)


def frequencies(count, solver):
    ops.constraints("Transformation" if RIGID or DIAPHRAGM or ARMS else "Plain")
    ops.numberer("RCM")
    ops.system(solver)
    ops.test("NormUnbalance", 1e-8, 1)
    ops.algorithm("Linear")
    ops.integrator("LoadControl", 0.0)
    ops.analysis("Static", "-noWarnings")
    return (np.sqrt(np.maximum(ops.eigen(count), 0.0)) / (2 * np.pi)).tolist()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--modes", type=int, default=MODES)
    parser.add_argument("--solver", default="SparseGeneral", help="or UmfPack, ProfileSPD")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    for kind, usual in TYPES.items():
        parser.add_argument(f"--{kind}", default=usual, help=f"element type, {usual} by default")
    options = parser.parse_args()
    TYPES = {kind: getattr(options, kind) for kind in TYPES}
    wall, cpu = time.perf_counter(), time.process_time()
    build()
    found = frequencies(options.modes, options.solver)
    report = {
        "frequencies_hz": found,
        "seconds": time.perf_counter() - wall,
        "cpu_seconds": time.process_time() - cpu,
    }
    if options.json:
        print(json.dumps(report))
    else:
        print("\\n".join(f"mode {k:3d}  {value:10.5f} Hz" for k, value in enumerate(found, 1)))
        print(f"{report['seconds']:.2f} s, building the model included")
'''


def card(name: str, *values: float | str | None) -> str:
    """A card in large fields."""
    words = [f"{v:.9E}" if isinstance(v, float) else "" if v is None else str(v) for v in values]
    lines = [words[k : k + 4] for k in range(0, len(words), 4)]
    heads = [f"{name}*", *["*"] * (len(lines) - 1)]
    return "\n".join(
        f"{head:<8}" + "".join(f"{word:<16}" for word in line).ljust(64)
        for head, line in zip(heads, lines, strict=True)
    )


def bulk_data(model: FiniteElementModel) -> str:
    """A finite-element model, its factors 1, as a deck of Nastran in N and m."""
    cards = ["SOL 103", "CEND", "SPC = 1", "BEGIN BULK", "PARAM,COUPMASS,1"]
    cards += [card("GRID", n, None, *map(float, p)) for n, p in enumerate(model.nodes, 1)]
    element = 0
    numbers: dict[tuple[float | str | None, ...], int] = {}

    def number(name: str, *values: float | str | None) -> int:
        key = (name, *values)
        if key not in numbers:
            numbers[key] = len(numbers) + 1
            cards.append(card(name, numbers[key], *values))
        return numbers[key]

    for block in model.elements:
        for k, nodes in enumerate((block.nodes + 1).tolist()):
            element += 1
            young, density, ratio = (
                float(getattr(block, name)[k])
                for name in ("youngs_modulus", "density", "poisson_ratio")
            )
            material = number("MAT1", young, None, ratio, density)
            if isinstance(block, Surface):
                thickness = float(block.thickness[k])
                plate = number("PSHELL", material, thickness, material, 1.0, material, 5.0 / 6.0)
                name = "CQUAD4" if len(nodes) == 4 else "CTRIA3"
                cards.append(card(name, element, plate, *nodes))
                continue
            if not isinstance(block, Beams):
                raise StructureError(f"bulk data knows no {block.name}; leave such elements out")
            area = float(block.area[k])
            inertia = float(block.inertia_y[k]), float(block.inertia_z[k])
            shear = [  # 0 means that a bar does not shear
                float(value[k] / area) if np.isfinite(value[k]) else 0.0
                for value in (block.shear_area_z, block.shear_area_y)
            ]
            bent = (area, *inertia, float(block.torsion_constant[k]), 0.0)
            bar = number("PBAR", material, *bent, *[None] * 9, *shear, 0.0)
            arms = np.zeros(6) if block.offset is None else block.offset[k].ravel()
            pins = ["", ""]
            if block.released is not None:
                flags = block.released[k].reshape(2, 6)[:, [0, 2, 1, 3, 5, 4]]
                pins = ["".join(str(c + 1) for c in np.flatnonzero(end)) for end in flags]
            up = map(float, block.up[k])
            cards.append(card("CBAR", element, bar, *nodes, *up, None, *pins, *map(float, arms)))
    for node, mass, inertia in zip(
        model.masses.node + 1, model.masses.mass, model.masses.inertia, strict=True
    ):
        if np.ptp(mass) == 0.0:
            element += 1
            x, y, z = map(float, inertia)
            figures = (float(mass[0]), *[None] * 4, x, 0.0, y, 0.0, 0.0, z)
            cards.append(card("CONM2", element, int(node), None, *figures))
            continue
        for way, value in enumerate([*mass, *inertia], 1):
            if value:
                element += 1
                cards.append(card("CMASS2", element, float(value), int(node), way))
    springs = model.springs
    for ends, way, *rates in zip(
        springs.nodes + 1, springs.direction + 1, springs.stiffness, springs.dashpots, strict=True
    ):
        joined = [value for node in ends.tolist() if node for value in (node, int(way))]
        for name, rate in zip(("CELAS2", "CDAMP2"), rates, strict=True):
            if rate:
                element += 1
                cards.append(card(name, element, float(rate), *joined))
    links = model.links
    for master, slave, tied in zip(links.master, links.slave, links.tied, strict=True):
        element += 1
        digits = "".join(str(c + 1) for c in np.flatnonzero(tied))
        cards.append(card("RBE2", element, int(master) + 1, digits, int(slave) + 1))
    for node in np.flatnonzero(model.fixed.any(axis=1)):
        digits = "".join(str(c + 1) for c in np.flatnonzero(model.fixed[node]))
        cards.append(card("SPC1", 1, digits, int(node) + 1))
    return "\n".join([*cards, "ENDDATA", ""])
