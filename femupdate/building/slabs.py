"""Slabs of a frame building as blocks of shells on the mesh lines."""

from collections.abc import Iterator

from femupdate.building.blocks import ElementBlock
from femupdate.building.frame import FrameBuilding
from femupdate.building.lattice import Lattice, quadrilaterals
from femupdate.building.references import resolve, slab_lines
from femupdate.fe.elements.shell import Shells


def slab_blocks(building: FrameBuilding, lattice: Lattice) -> Iterator[ElementBlock]:
    """Yield the slabs, one block a floor."""
    for number, slab in enumerate(building.slabs):
        key = f"slabs[{number}]"
        x = slab_lines(slab.x, building.grid.x, f"{key}.x")
        y = slab_lines(slab.y, building.grid.y, f"{key}.y")
        for floor in resolve(slab.floors, building.floors, "floor", f"{key}.floors"):
            yield ElementBlock(
                key=key,
                element=Shells,
                nodes=quadrilaterals(lattice.rectangle(x, y, floor)),
                group=building.floors.index(floor),
                kind="slab",
                thickness=slab.thickness,
                material=building.material(slab.material),
            )
