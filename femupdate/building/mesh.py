"""The mesh of a building of any kind."""

import math
from dataclasses import replace

from femupdate.building.building_mesh import BuildingMesh
from femupdate.building.document import Building
from femupdate.building.frame_mesh import mesh_frame
from femupdate.building.kinds import FrameBuilding, MeshBuilding
from femupdate.building.lattice import lattice_of
from femupdate.building.mesh_import import import_mesh
from femupdate.building.split_mesh import split_mesh
from femupdate.errors import BuildingError


def mesh_building(building: Building, mesh_size: float | None = None) -> BuildingMesh:
    """Return the mesh of a building.

    Every interval between grid lines, and every story, is divided into equal parts no longer than
    the mesh size; walls, columns, beams and slabs meet in common nodes on those lines.

    Args:
        building: of kind "frame", or "mesh", whose mesh is read from its file.
        mesh_size: m; the building's own where None.

    Raises:
        BuildingError: a shear building, a size for a mesh that is read, two members in one place,
            a part that is connected to nothing below, a floor lighter than its self weight, a
            sensor where nothing is built.
    """
    if isinstance(building, MeshBuilding):
        if mesh_size is not None:
            raise BuildingError(
                f"{building.name}: mesh.size: the mesh comes from {building.mesh.file}; refine it "
                "by mesh.split, or in the program that made it"
            )
        mesh = import_mesh(building)
        for _ in range(building.mesh.split):
            mesh = replace(split_mesh(mesh), of_coarser=None)
        return mesh
    if not isinstance(building, FrameBuilding):
        raise BuildingError(
            f'{building.name}: kind: a building of kind "shear" has no mesh; use shear_operators'
        )
    size = building.mesh.size if mesh_size is None else mesh_size
    if not size > 0.0:
        raise BuildingError(f"mesh.size: {size!r} m must be greater than 0; write a length")
    return mesh_frame(building, size)


def check_mesh(building: FrameBuilding | MeshBuilding) -> None:
    """Raise BuildingError where `mesh_building` would, at the cost of a very coarse mesh."""
    if isinstance(building, MeshBuilding):
        mesh_building(building)
        return
    lattice_of(building, building.mesh.size)
    # Two parts an interval: what nothing carries between two grid lines shows as well.
    mesh_frame(building, math.inf, least=2)
