"""Reads what OpenSees prints of a domain by `print -JSON`.

It holds nodes with their masses, elements, sections and materials. It does not hold supports, rigid
links, whether masses are lumped, and units: those must be said beside it.
"""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.entry import ALL
from femupdate.building.model_tables import LEVEL, ModelFile, ModelTables, Stuff, file_text
from femupdate.building.sections import SectionFigures
from femupdate.errors import BuildingError

_BEAMS = (
    *("ElasticBeam3d", "ElasticTimoshenkoBeam3d", "ForceBeamColumn3d", "DispBeamColumn3d"),
    *("ForceBeamColumnCBDI3d", "MixedBeamColumn3d", "DispBeamColumnAsym3d"),
)
_TRUSSES = ("Truss", "CorotTruss", "TrussSection", "CorotTrussSection")
_SHELLS = (
    *("ShellMITC4", "ShellDKGQ", "ShellNLDKGQ", "ASDShellQ4"),
    *("ShellDKGT", "ShellNLDKGT", "ASDShellT3"),
)
_SPRINGS = ("ZeroLength", "TwoNodeLink")
_TAKEN = (*_BEAMS, *_TRUSSES, *_SHELLS, *_SPRINGS)
_DIRECTIONS = ("P", "Vy", "Vz", "T", "My", "Mz")
_LINEAR = ("ElasticMaterial", "ElasticIsotropicMaterial")
_GROUPS = dict.fromkeys(("nodes", "elements"), "geometry")
_GROUPS |= dict.fromkeys(
    ("uniaxialMaterials", "ndMaterials", "sections", "crdTransformations"), "properties"
)
# Of uniaxial materials, where they begin.
_MODULI = ("Epos", "E", "Ec", "E0", "E1p", "Ke0", "Ke", "K0", "K")
# Where the integration of beams with hinges has its points, and their weights: in lengths of
# hinges at either end, two Gauss points between them.
_HINGES: dict[str, tuple[tuple[tuple[float, float], ...], float]] = {
    "HingeRadau": (((0.0, 1.0), (8.0 / 3.0, 3.0)), 4.0),
    "HingeRadauTwo": (((0.0, 0.25), (2.0 / 3.0, 0.75)), 1.0),
    "HingeMidpoint": (((0.5, 1.0),), 1.0),
    "HingeEndpoint": (((0.0, 1.0),), 1.0),
}


@dataclass(frozen=True)
class _Object:
    """One object of the file."""

    file: str
    text: str  # of the whole file
    group: str  # such as "elements"
    values: Mapping[str, Any]
    objects: Mapping[str, Sequence["_Object"]]  # all there are, by their group

    @property
    def kind(self) -> str:
        return str(self.values.get("type", self.group))

    def error(self, text: str) -> BuildingError:
        name = self.values.get("name", "")
        start = max(self.text.find(f'"{self.group}"'), 0)
        found = re.search(rf'"name"\s*:\s*"?{re.escape(str(name))}\b', self.text[start:])
        line = self.text.count("\n", 0, start + (found.start() if found else 0)) + 1
        return BuildingError(f"{self.file}, line {line}: {self.kind} {name}: {text}")

    def real(self, key: str, usual: float | None = None) -> float:
        value = self.values.get(key, usual)
        try:
            number = np.nan if isinstance(value, bool) else float(value)
        except (TypeError, ValueError):
            number = np.nan
        if not np.isfinite(number):
            said = f"is {value!r}" if key in self.values else "is missing"
            raise self.error(f"{key} {said}; print the domain again, or write a number")
        return number

    def row(self, key: str, count: int) -> Floats:
        value = self.values.get(key)
        try:
            numbers = np.array(value, dtype=np.float64)
        except (TypeError, ValueError):
            numbers = np.full(0, np.nan)
        if numbers.shape != (count,) or not np.isfinite(numbers).all():
            raise self.error(f"{key} {value!r} are no {count} numbers; the model must have -ndm 3")
        return numbers

    def other(self, group: str, name: Any) -> "_Object":
        """The object of another group that this one names."""
        named = (each for each in self.objects[group] if str(each.values.get("name")) == str(name))
        found = next(named, None)
        if found is None:
            raise self.error(
                f"there is no {name} in {group}, or OpenSees has no JSON for it; replace it by an "
                "elastic one and print the domain again"
            )
        return found


@dataclass(frozen=True)
class OpenSeesModel(ModelFile[_Object]):
    """A domain: nodes, and elements by their type."""

    program: ClassVar[str] = "OpenSees"
    node_kind: ClassVar[str] = "node"
    what: ClassVar[str] = "elements"
    mends: ClassVar[Mapping[str, str]] = {}

    @classmethod
    def opened(cls, file: Path) -> "OpenSeesModel":
        """The domain of a file."""
        text, again = file_text(file), 'by print("-JSON", "-file", "model.json")'
        try:
            try:
                whole = json.loads(text)
            except ValueError:
                whole = json.loads(_plain_json(file.name, text))
        except (ValueError, RecursionError) as error:
            line = getattr(error, "lineno", 1)
            raise BuildingError(
                f"{file.name}, line {line}: this is no JSON; write the domain again {again}"
            ) from None
        objects: dict[str, list[_Object]] = {}
        for group, half in _GROUPS.items():
            rows = whole
            for key in ("StructuralAnalysisModel", half, group):
                rows = rows.get(key) if isinstance(rows, dict) else None
            objects[group] = [
                _Object(file.name, text, group, row, objects)
                for row in (rows if isinstance(rows, list) else [])
                if isinstance(row, dict)
            ]
        if not objects["nodes"] or not objects["elements"]:
            raise BuildingError(
                f"{file.name}: there are no nodes or elements under StructuralAnalysisModel, "
                f"geometry; write the domain {again}"
            )
        entries = {"node": objects["nodes"]}
        for element in objects["elements"]:
            if "type" not in element.values:
                raise element.error("it has no type; print the domain again")
            entries.setdefault(element.kind, []).append(element)
        return cls(file, entries)

    @property
    def elements(self) -> Sequence[_Object]:
        """In the order of the file."""
        return self.entries["node"][0].objects["elements"]

    @property
    def materials(self) -> list[tuple[float, float]]:
        """Of shells, and of beams with a mass per length."""
        pairs = []
        for section in self.entries["node"][0].objects["sections"]:
            if "masspervolume" in section.values:
                pairs.append((section.real("Em", 0.0), section.real("masspervolume")))
        for beam in self.elements:
            if "A" in beam.values and "E" in beam.values:
                density = beam.real("massperlength", 0.0) / max(beam.real("A"), 1e-300)
                pairs.append((beam.real("E"), density))
        return pairs

    @property
    def unknown(self) -> list[str]:
        """Types of elements that have no counterpart."""
        return [name for name in self.counts if name not in ("node", *_TAKEN)]

    @property
    def lacks(self) -> tuple[str, ...]:
        heavy = any(e.values.get("massperlength") or e.kind in _SHELLS for e in self.elements)
        return ("mesh.diaphragms", *(("mesh.mass",) if heavy else ()), "supports.base")

    def fill(self, tables: ModelTables) -> None:
        for node in self.of("node"):
            name = str(node.values.get("name"))
            if name in tables.number:
                raise node.error("there is another node of this name; print the domain again")
            number = tables.node(name, node.row("crd", 3))
            if "mass" in node.values:
                mass = node.row("mass", 6) * tables.mass
                tables.point_mass(node, number, mass[:3], mass[3:] * tables.length**2)
        for element in self.elements:
            if element.kind in _TAKEN:
                ends = [tables.find(element, str(n)) for n in element.values.get("nodes", ())]
                if len(ends) != 2 and element.kind not in _SHELLS:
                    raise element.error(f"it has {len(ends)} nodes; give it two")
                if element.kind in _SHELLS:
                    _shell(element, ends, tables)
                elif element.kind in _SPRINGS:
                    _springs(element, ends, tables)
                else:
                    _beam(element, ends, tables)


def _plain_json(file: str, text: str) -> str:
    """The text without what OpenSees prints of materials that it has no JSON for."""
    lines, start = text.splitlines(), text.count("\n", 0, max(text.find('"elements"'), 0))
    for number, line in enumerate(lines):
        if not line.strip() or line.lstrip()[0] in '{}[]"' or text.lstrip()[:1] != "{":
            continue
        if number > start > 0 and re.search(r"[A-Za-z]{3}", line):
            raise BuildingError(
                f"{file}, line {number + 1}: OpenSees has no JSON for {line.strip()!r}; replace "
                "that element"
            )
        lines[number] = ""
    whole = re.sub(r"(?<=[\s\[,:])-?nan\b", "NaN", "\n".join(lines))
    return re.sub(r",(\s*[\]}])", r"\1", re.sub(r"}(\s*){", r"},\1{", whole))


def _springs(element: _Object, ends: list[int], tables: ModelTables) -> None:
    materials, ways = (element.values.get(key, ()) for key in ("materials", "dof"))
    span = tables.points[ends[1]] - tables.points[ends[0]]
    length = float(np.linalg.norm(span))
    if length > LEVEL:  # a strut, or a link between two places
        if list(ways) != ["P"]:
            raise element.error("it joins two places by more than P; write zeroLength and beams")
        young = _modulus(element, materials[0], tables)
        stuff = tables.material(element, young * length / tables.length, 0.0, 0.0)
        figures = tables.section(element, 1.0, (0.0, 0.0), 0.0, (0.0, 0.0), rod=True)
        up, pins = np.eye(3)[int(np.abs(span).argmin())], np.zeros(12, dtype=np.bool_)
        pins[[4, 5, 10, 11]] = True
        tables.line(element, ends, figures, stuff, up, pins=pins)
        return
    axes = np.array(element.values.get("transMatrix", np.eye(3)), dtype=np.float64)
    for name, way in zip(materials, ways, strict=True):
        half, which = divmod(_DIRECTIONS.index(way), 3)
        along = int(np.abs(axes[which]).argmax())
        if not abs(axes[which, along]) > 1.0 - 1e-6:
            raise element.error("it acts along no global axis; turn it by -orient")
        tables.spring(ends[0], ends[1], 3 * half + along, _modulus(element, name, tables))


def _beam(element: _Object, ends: list[int], tables: ModelTables) -> None:
    pins, arms = np.zeros(12, dtype=np.bool_), np.zeros((2, 3))
    if element.kind in _TRUSSES:
        if "section" in element.values:
            stuff, figures = _elastic(element.other("sections", element.values["section"]), tables)
        else:
            young = _modulus(element, element.values.get("material"), tables)
            stuff, area = tables.material(element, young, 0.0, 0.0), element.real("A")
            figures = tables.section(element, area, (0.0, 0.0), 0.0, (0.0, 0.0), rod=True)
        axis = tables.points[ends[1]] - tables.points[ends[0]]
        up, pins[[4, 5, 10, 11]] = np.eye(3)[int(np.abs(axis).argmin())], True
    else:
        turn = element.other("crdTransformations", element.values.get("crdTransformation"))
        up = turn.row("vecInLocXZPlane", 3)
        for end, key in enumerate(("iOffset", "jOffset")):
            if key in turn.values:
                arms[end] = tables.length * turn.row(key, 3)
        names = list(dict.fromkeys(element.values.get("sections", ())))
        if len(names) > 1:
            span = tables.points[ends[1]] + arms[1] - tables.points[ends[0]] - arms[0]
            stuff, figures = _hinged(element, float(np.linalg.norm(span)), tables)
        else:
            section = element.other("sections", names[0]) if names else element
            stuff, figures = _elastic(section, tables)
        for key, place in (("releasez", 5), ("releasey", 4)):
            code = int(element.real(key, 0))
            pins[place], pins[place + 6] = bool(code & 1), bool(code & 2)
    heavy = element.real("massperlength", 0.0) * tables.mass / tables.length
    stuff = replace(stuff, density=heavy / figures.area)
    tables.line(element, ends, figures, stuff, up, pins=pins, arms=arms)


def _hinged(element: _Object, length: float, tables: ModelTables) -> tuple[Stuff, SectionFigures]:
    """A uniform beam as flexible as one with other sections near its ends, alike at both.

    Its bending and shear stiffness give the flexibility of an end alone and of both together.
    """
    named = element.values["sections"]
    integration = element.values.get("integration", {})
    points, reach = _HINGES.get(str(integration.get("type")), ((), 0.0))
    hinges = [tables.length * float(integration.get(key, 0.0)) for key in ("lpI", "lpJ")]
    rates = [_rates(element.other("sections", name), tables) for name in named]
    flexible = np.array([[1.0 / rate.get(way, np.inf) for way in _DIRECTIONS] for rate in rates])
    if (
        len(named) != 2 * len(points) + 2
        or abs(hinges[0] - hinges[1]) > LEVEL
        or not np.allclose(flexible, flexible[::-1], rtol=1e-4, atol=0.0)
    ):
        raise element.error(
            f"it has {len(set(named))} sections along it; give it one, or hinges alike at both ends"
        )
    half = length - 2.0 * reach * hinges[0]
    gauss = [(0.5 * (length + side * half / np.sqrt(3.0)), 0.5 * half) for side in (-1.0, 1.0)]
    first = [(hinges[0] * at, hinges[0] * weight) for at, weight in points]
    at, weight = np.array([*first, *gauss, *((length - x, w) for x, w in first[::-1])]).T
    yields = dict(zip(_DIRECTIONS, (weight[:, None] * flexible).T, strict=True))
    given = {way: length / yields[way].sum() for way in ("P", "T") if yields[way].any()}
    for bending, shear in (("My", "Vz"), ("Mz", "Vy")):
        slide = float(yields[shear].sum()) / length**2
        near = float(yields[bending] @ (1.0 - at / length) ** 2) + slide
        across = slide - float(yields[bending] @ ((1.0 - at / length) * at / length))
        given[bending] = 0.5 * length / (near - across)
        sheared = max((near + 2.0 * across) / 3.0 * length, 0.0)
        given[shear] = 1.0 / sheared if sheared > 1e-9 * length**3 * near else np.inf
    tables.changes["beams with hinges of their own sections: as flexible ones"] += 1
    return _stiff(element, given, tables)


def _rates(section: _Object, tables: ModelTables) -> dict[str, float]:
    """Stiffness of a section in SI for the forces it has; of two for the same force, both yield."""
    if section.kind != "SectionAggregator":
        stuff, figures = _elastic(section, tables)
        shear = 0.5 * stuff.young / (1.0 + stuff.ratio) * stuff.shear_share
        bending = {"My": stuff.young * figures.inertia_y, "Mz": stuff.young * figures.inertia_z}
        sheared = {"Vy": shear * figures.shear_area_y, "Vz": shear * figures.shear_area_z}
        axial = {"P": stuff.young * figures.area, "T": shear * figures.torsion_constant}
        return axial | bending | sheared
    inner = section.values.get("section")
    rates = {} if inner is None else _rates(section.other("sections", inner), tables)
    ways, materials = (section.values.get(key, ()) for key in ("dof", "materials"))
    for way, name in zip(ways, materials, strict=True):
        arm = 1.0 if way in ("P", "Vy", "Vz") else tables.length
        rate = _modulus(section, name, tables) * tables.force * arm**2
        if not rate > 0.0:
            raise section.error(f"its stiffness for {way} is not positive; correct it")
        rates[way] = 1.0 / (1.0 / rate + 1.0 / rates.get(way, np.inf))
    return rates


def _stiff(
    user: _Object, rates: Mapping[str, float], tables: ModelTables
) -> tuple[Stuff, SectionFigures]:
    """Material and figures of a beam with these stiffnesses; only the products count."""
    missing = [way for way in ("P", "My", "Mz", "T") if not rates.get(way, np.inf) < np.inf]
    if missing:
        raise user.error(f"it has no stiffness for {' '.join(missing)}; give it one")
    stuff = tables.material(user, 30e9 / tables.stress, 0.2, 0.0)
    return stuff, SectionFigures(
        area=rates["P"] / stuff.young,
        shear_area_y=rates.get("Vy", np.inf) * 2.4 / stuff.young,
        shear_area_z=rates.get("Vz", np.inf) * 2.4 / stuff.young,
        inertia_y=rates["My"] / stuff.young,
        inertia_z=rates["Mz"] / stuff.young,
        torsion_constant=rates["T"] * 2.4 / stuff.young,
    )


def _elastic(section: _Object, tables: ModelTables) -> tuple[Stuff, SectionFigures]:
    """Material and figures of a beam or a section; fibres where the user takes them as elastic."""
    if "Iz" in section.values:
        young, shear = section.real("E"), section.real("G")
        ratio = min(max(0.5 * young / shear - 1.0, 0.0), 0.499) if shear > 0.0 else 0.0
        areas = section.real("Avz", 0.0), section.real("Avy", 0.0)
        bending = section.real("Iy"), section.real("Iz")
        return (
            tables.material(section, young, ratio, 0.0, shear),
            tables.section(section, section.real("A"), bending, section.real("Jx"), areas),
        )
    if section.kind == "SectionAggregator":
        return _stiff(section, _rates(section, tables), tables)
    if not (tables.said.elastic == ALL or section.kind in tables.said.elastic):
        raise section.error(
            f'it is not elastic; take it at its initial stiffness by mesh.elastic = ["'
            f'{section.kind}"] in a building file, or print the elastic model'
        )
    fibers = section.values.get("fibers")
    if not isinstance(fibers, list) or not fibers or "coord" not in fibers[0]:
        raise section.error("a section of this kind has no counterpart; give one of fibres")
    named = {"name": section.values["name"]}
    rows = [replace(section, values=named | fiber) for fiber in fibers]
    moduli = np.array([_modulus(row, row.values.get("material"), tables) for row in rows])
    area = np.array([row.real("area") for row in rows])
    y, z = np.array([row.row("coord", 2) for row in rows]).T
    weight = moduli * area
    young = float(weight.sum() / area.sum())
    y, z = (side - weight @ side / weight.sum() for side in (y, z))
    bending = (float(weight @ z**2 / young), float(weight @ y**2 / young))
    tables.changes["sections of fibres: elastic, at their initial stiffness"] += 1
    stuff = tables.material(section, young, 0.2, 0.0)
    torsion = section.real("torsion", 0.0) / (young / 2.4)
    return stuff, tables.section(section, float(area.sum()), bending, torsion, (0.0, 0.0))


def _modulus(user: _Object, name: Any, tables: ModelTables) -> float:
    """Initial stiffness of a uniaxial material."""
    material = user.other("uniaxialMaterials", name)
    named = material.values.get("materials", [material.values.get("material")])
    if named != [None]:  # one around others
        inner = np.array([_modulus(material, each, tables) for each in named])
        return float(
            1.0 / (1.0 / inner).sum() if material.kind == "SeriesMaterial" else inner.sum()
        )
    if material.kind not in _LINEAR:
        if not (tables.said.elastic == ALL or material.kind in tables.said.elastic):
            raise material.error(
                "it is not linear; take it at its initial stiffness by mesh.elastic = ["
                f'"{material.kind}"] in a building file'
            )
        tables.changes[f"uses of {material.kind}: elastic, at its initial stiffness"] += 1
    key = next((key for key in _MODULI if key in material.values), "E")
    return material.real(key)


def _shell(element: _Object, corners: list[int], tables: ModelTables) -> None:
    section = element.other("sections", element.values.get("section"))
    key = "totalThickness" if "totalThickness" in section.values else "thickness"
    bending, thickness = 1.0, tables.length * section.real(key)
    if section.kind == "ElasticMembranePlateSection":
        young, ratio = section.real("Em"), section.real("nu")
        density, bending = section.real("masspervolume"), section.real("Ep", young) / young
    elif section.kind in ("PlateFiber", "LayeredShellFiberSection"):
        inside = section.values.get("fibers") or [{}]
        if len({str(layer.get("material")) for layer in inside}) > 1:
            raise section.error("layers have no counterpart; write ElasticMembranePlateSection")
        material = section.other("ndMaterials", inside[0].get("material"))
        if material.kind == "PlateFiberMaterial":
            material = section.other("ndMaterials", material.values.get("material"))
        if material.kind not in _LINEAR:
            raise material.error("it is not linear and isotropic; print the elastic model")
        young, ratio, density = (material.real(key) for key in ("E", "nu", "rho"))
    else:
        raise section.error("layers have no counterpart; write ElasticMembranePlateSection")
    stuff = tables.material(section, young, ratio, density)
    tables.area(element, corners, stuff, thickness, bending=bending)
