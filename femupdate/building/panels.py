"""Panels of a frame building: its slabs and walls as blocks of shells on the mesh lines."""

from collections.abc import Iterator
from dataclasses import dataclass

from femupdate.arrays import Floats, Integers
from femupdate.building.frame import FrameBuilding
from femupdate.building.lattice import Lattice, quadrilaterals
from femupdate.building.members import Material
from femupdate.building.references import resolve, slab_lines


@dataclass(frozen=True)
class Panel:
    """The shells of one wall in one story, or of one slab on one floor.

    Attributes:
        key: the entry of the file it comes from, such as "walls[2]".
        nodes: (n, 4) crossings.
        group: index of the story that owns it.
        kind: "wall", "non_structural_wall" or "slab".
        thickness: m.
    """

    key: str
    nodes: Integers
    group: int
    kind: str
    thickness: float
    material: Material


@dataclass(frozen=True)
class DeadWall:
    """A wall of one story that only weighs.

    Attributes:
        above, below: (n,) crossings along the wall on the floor above and below (below is empty
            on the ground).
        share: (n,) mass for each of those, kg: half of the wall's in all.
    """

    key: str
    group: int
    above: Integers
    below: Integers
    share: Floats

    @property
    def mass(self) -> float:
        """Mass of the whole wall, kg."""
        return 2.0 * float(self.share.sum())


def slab_panels(building: FrameBuilding, lattice: Lattice) -> Iterator[Panel]:
    """Yield the slabs, one panel a floor."""
    for number, slab in enumerate(building.slabs):
        key = f"slabs[{number}]"
        x = slab_lines(slab.x, building.grid.x, f"{key}.x")
        y = slab_lines(slab.y, building.grid.y, f"{key}.y")
        for floor in resolve(slab.floors, building.floors, "floor", f"{key}.floors"):
            yield Panel(
                key=key,
                nodes=quadrilaterals(lattice.rectangle(x, y, floor)),
                group=building.floors.index(floor),
                kind="slab",
                thickness=slab.thickness,
                material=building.material(slab.material),
            )
