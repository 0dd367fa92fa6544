"""The three kinds of building."""

from collections.abc import Mapping

from femupdate.building.frame import FrameBuilding
from femupdate.building.own_mesh import MeshBuilding
from femupdate.building.shear import ShearBuilding

Building = FrameBuilding | MeshBuilding | ShearBuilding

KINDS: Mapping[str, type[Building]] = {
    "frame": FrameBuilding,
    "mesh": MeshBuilding,
    "shear": ShearBuilding,
}
