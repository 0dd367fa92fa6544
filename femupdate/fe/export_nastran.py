"""A finite-element model as bulk data, for Nastran and its kin."""

import numpy as np

from femupdate.errors import StructureError
from femupdate.fe.elements.beam import Beams
from femupdate.fe.model import FiniteElementModel
from femupdate.fe.surface import Surface


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
