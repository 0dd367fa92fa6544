"""Writes the mesh of a building for other programs, its members as groups of cells."""

from pathlib import Path

import numpy as np

from femupdate.building.building_mesh import BuildingMesh
from femupdate.errors import BuildingError
from femupdate.storage import atomic_path

GROUPS = ("slab", "wall", "non_structural_wall", "column", "beam")
_FORMATS = {".vtu": "vtu", ".msh": "gmsh22", ".med": "med"}
TAGS = "group"  # cell data with the number of the group, from 1, where a format has no names


def export_mesh(mesh: BuildingMesh, path: str | Path) -> Path:
    """Write nodes and elements with one group a kind of member.

    gmsh 2.2 and MED name the groups; VTU numbers them in the cell data "group", in the order of
    `GROUPS`. Rigid links, springs and masses are not part of a mesh.
    """
    import meshio

    target = Path(path).expanduser()
    if target.suffix not in _FORMATS:
        known = ", ".join(_FORMATS)
        raise BuildingError(f"{target}: a mesh is written as {known}; choose one of these endings")
    model = mesh.model
    blocks = model.elements
    numbers = [
        np.array([GROUPS.index(kind) + 1 for kind in elements.kind.tolist()]) for elements in blocks
    ]
    cells = [(elements.cell_type, elements.nodes) for elements in blocks]
    written = meshio.Mesh(model.nodes, cells)
    if target.suffix == ".msh":
        written.cell_data = {"gmsh:physical": numbers, "gmsh:geometrical": numbers}
        written.field_data = {
            name: np.array([k, 2 if k < 4 else 1]) for k, name in enumerate(GROUPS, 1)
        }
    elif target.suffix == ".med":
        written.cell_data = {"cell_tags": [-number for number in numbers]}
        written.cell_tags = {-k: [name] for k, name in enumerate(GROUPS, 1)}
    else:
        written.cell_data = {TAGS: numbers}
    with atomic_path(target, BuildingError) as temporary:
        written.write(temporary, file_format=_FORMATS[target.suffix])
    return target
