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
from femupdate.building.model_tables import ModelFile, ModelTables, Stuff, file_text
from femupdate.building.quantities import ALL
from femupdate.building.sections import SectionFigures
from femupdate.errors import BuildingError

_BEAMS = (
    *("ElasticBeam3d", "ElasticTimoshenkoBeam3d", "ForceBeamColumn3d", "DispBeamColumn3d"),
    *("ForceBeamColumnCBDI3d", "MixedBeamColumn3d", "DispBeamColumnAsym3d"),
)
_TRUSSES = ("Truss", "CorotTruss")
_SHELLS = (
    *("ShellMITC4", "ShellDKGQ", "ShellNLDKGQ", "ASDShellQ4"),
    *("ShellDKGT", "ShellNLDKGT", "ASDShellT3"),
)
_SPRINGS = ("ZeroLength",)
_TAKEN = (*_BEAMS, *_TRUSSES, *_SHELLS, *_SPRINGS)
_DIRECTIONS = ("P", "Vy", "Vz", "T", "My", "Mz")
_LINEAR = ("ElasticMaterial", "ElasticIsotropicMaterial")
_GROUPS = {
    **dict.fromkeys(("nodes", "elements"), "geometry"),
    **dict.fromkeys(
        ("uniaxialMaterials", "ndMaterials", "sections", "crdTransformations"), "properties"
    ),
}
_MODULI = ("Epos", "E", "Ec", "E0", "E1p")  # of uniaxial materials, where they begin


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
            number = float(value)
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
            raise self.error(f"there is no {name} in {group}; print the domain again")
        return found


@dataclass(frozen=True)
class OpenSeesModel(ModelFile[_Object]):
    """A domain: nodes, and elements by their type."""

    program: ClassVar[str] = "OpenSees"
    node_kind: ClassVar[str] = "node"
    what: ClassVar[str] = "elements"
    mends: ClassVar[Mapping[str, str]] = {
        "TwoNodeLink": "write a zeroLength between two nodes in one place",
    }

    @classmethod
    def opened(cls, file: Path) -> "OpenSeesModel":
        """The domain of a file."""
        text, again = file_text(file), 'by print("-JSON", "-file", "model.json")'
        try:
            whole = json.loads(text)
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
        """As of a `ModelFile`."""
        heavy = any(e.values.get("massperlength") or e.kind in _SHELLS for e in self.elements)
        return ("mesh.diaphragms", *(("mesh.mass",) if heavy else ()), "supports.base")

    def fill(self, tables: ModelTables) -> None:
        """As of a `ModelFile`."""
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
                if element.kind in _SHELLS:
                    _shell(element, ends, tables)
                elif element.kind in _SPRINGS:
                    turn = element.values.get("transMatrix", np.eye(3))
                    axes = np.array(turn, dtype=np.float64)
                    materials, ways = (element.values.get(key, ()) for key in ("materials", "dof"))
                    for name, way in zip(materials, ways, strict=True):
                        half, which = divmod(_DIRECTIONS.index(way), 3)
                        along = int(np.abs(axes[which]).argmax())
                        if abs(axes[which, along]) < 1.0 - 1e-6:
                            raise element.error("it acts along no global axis; turn it by -orient")
                        stiffness = _modulus(element, name, tables)
                        tables.spring(ends[0], ends[1], 3 * half + along, stiffness)
                else:
                    _beam(element, ends, tables)


def _beam(element: _Object, ends: list[int], tables: ModelTables) -> None:
    pins, arms = np.zeros(12, dtype=np.bool_), np.zeros((2, 3))
    if element.kind in _TRUSSES:
        young = _modulus(element, element.values.get("material"), tables)
        stuff, area = tables.material(element, young, 0.0, 0.0), element.real("A")
        figures = tables.section(element, area, (0.0, 0.0), 0.0, (0.0, 0.0), rod=True)
        axis = tables.points[ends[1]] - tables.points[ends[0]]
        up, pins[[4, 5, 10, 11]] = np.eye(3)[int(np.abs(axis).argmin())], True
    else:
        section = element
        if "sections" in element.values:
            names = list(dict.fromkeys(element.values["sections"]))
            if len(names) != 1:
                raise element.error(
                    f"it has {len(names)} sections along it; give it one, or elastic middle parts"
                )
            section = element.other("sections", names[0])
        stuff, figures = _elastic(section, tables)
        turn = element.other("crdTransformations", element.values.get("crdTransformation"))
        up = turn.row("vecInLocXZPlane", 3)
        for end, key in enumerate(("iOffset", "jOffset")):
            if key in turn.values:
                arms[end] = tables.length * turn.row(key, 3)
        for key, place in (("releasez", 5), ("releasey", 4)):
            code = int(element.real(key, 0))
            pins[place], pins[place + 6] = bool(code & 1), bool(code & 2)
    heavy = element.real("massperlength", 0.0) * tables.mass / tables.length
    stuff = replace(stuff, density=heavy / figures.area)
    tables.line(element, ends, figures, stuff, up, pins=pins, arms=arms)


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
    bending, thickness = 1.0, tables.length * section.real("thickness")
    if section.kind == "ElasticMembranePlateSection":
        young, ratio = section.real("Em"), section.real("nu")
        density, bending = section.real("masspervolume"), section.real("Ep", young) / young
    elif section.kind == "PlateFiber":
        inside = section.values.get("fibers") or [{}]
        material = section.other("ndMaterials", inside[0].get("material"))
        if material.kind not in _LINEAR:
            raise material.error("it is not linear and isotropic; print the elastic model")
        young, ratio, density = (material.real(key) for key in ("E", "nu", "rho"))
    else:
        raise section.error("layers have no counterpart; write ElasticMembranePlateSection")
    stuff = tables.material(section, young, ratio, density)
    tables.area(element, corners, stuff, thickness, bending=bending)
