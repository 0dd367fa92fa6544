"""Reads mesh files through meshio: nodes, cells by type, and the groups that cells belong to."""

import contextlib
import io
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.arrays import Flags, Floats, Integers
from femupdate.building.entry import Complaint
from femupdate.fe.registry import cell_types
from femupdate.storage import LARGEST_BYTES, refuse_endless

_MEND = "write it as gmsh 2.2 or 4.1 (.msh), Abaqus (.inp), MED (.med) or VTU (.vtu)"
_POINTS = ("vertex",)  # they carry no stiffness and are left out


@dataclass(frozen=True)
class Cells:
    """All cells of one type."""

    nodes: Integers  # (n, 2), (n, 3) or (n, 4) node indices
    groups: Mapping[str, Flags]  # (n,) flags for every group's name


@dataclass(frozen=True)
class RawMesh:
    """What a mesh file holds, in its own unit."""

    nodes: Floats  # (N, 3) coordinates
    cells: Mapping[str, Cells]  # by type: "line", "triangle", "quad"

    @property
    def group_names(self) -> tuple[str, ...]:
        """Names of all groups that have a cell."""
        names = {
            name
            for cells in self.cells.values()
            for name, flags in cells.groups.items()
            if flags.any()
        }
        return tuple(sorted(names))


def read_mesh(path: Path, tags: str | None) -> RawMesh:
    """Read a mesh file: gmsh, Abaqus, MED, VTU or another format that meshio knows.

    Args:
        tags: cell data that holds the groups' numbers, if any.
    """
    mesh = _read(path)
    _refuse_other_cells(mesh)
    _check_points(mesh)
    if tags is not None and tags not in mesh.cell_data:
        known = ", ".join(sorted(mesh.cell_data)) or "none"
        raise Complaint("mesh.tags", f"the mesh has no cell data {tags!r} (it has: {known})")
    nodes = np.zeros((len(mesh.points), 3))
    nodes[:, : mesh.points.shape[1]] = mesh.points
    try:
        cells = {kind: _cells(mesh, kind, count, tags) for kind, count in cell_types().items()}
    except (ValueError, IndexError, KeyError, TypeError, OverflowError) as error:
        raise Complaint(
            "mesh.file", f"its groups do not go with its cells ({error}); {_MEND}"
        ) from None
    return RawMesh(nodes, {kind: block for kind, block in cells.items() if len(block.nodes)})


def _read(path: Path) -> Any:
    import meshio

    # Unlike Path.is_file, this says no where a name is too long or a folder closed.
    if not os.path.isfile(path):
        raise Complaint("mesh.file", f"there is no file {path}; correct the path")
    size = path.stat().st_size
    if size > LARGEST_BYTES:  # it would fill the memory
        raise Complaint(
            "mesh.file",
            f"{path.name} holds {size / 1e6:.0f} MB, which no building's mesh needs; coarsen it",
        )
    try:
        # meshio prints what it thinks of a file, and exits where it cannot read one.
        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            if path.suffix == ".med":
                refuse_endless(path)
            return meshio.read(path)
    except (Exception, SystemExit) as error:  # its readers raise whatever a broken file causes
        reason = str(error) if str(error) not in ("", "1") else "its content is not as its ending"
        raise Complaint("mesh.file", f"{path.name} cannot be read ({reason}); {_MEND}") from None


def _check_points(mesh: Any) -> None:
    """Refuse nodes that are no points in space, and cells of nodes that there are not."""
    points = np.asarray(mesh.points)
    if points.ndim != 2 or not 0 < points.shape[1] <= 3 or points.dtype.kind not in "fiu":
        per = points.shape[1] if points.ndim == 2 else "no"
        raise Complaint(
            "mesh.file",
            f"its nodes have {per} coordinates each (is the comma the decimal sign?); {_MEND}",
        )
    if not np.isfinite(points).all():
        raise Complaint("mesh.file", f"a coordinate of a node is not a number; {_MEND}")
    # Nobody builds a thousand kilometres, in mm.
    if points.size and np.abs(points).max() > 1e9:
        text = f"a node lies at {np.abs(points).max():.3g}, which no building reaches; {_MEND}"
        raise Complaint("mesh.file", text)
    for block in mesh.cells:
        data = np.asarray(block.data)
        known = data.dtype.kind in "iu" and data.ndim == 2
        if not known or (data.size and not (data.min() >= 0 and data.max() < len(points))):
            raise Complaint(
                "mesh.file", f"cells of type {block.type!r} name nodes that it has not; {_MEND}"
            )


def _refuse_other_cells(mesh: Any) -> None:
    for block in mesh.cells:
        if block.type in cell_types() or block.type in _POINTS:
            continue
        count = sum(len(b.data) for b in mesh.cells if b.type == block.type)
        plain = next((kind for kind in cell_types() if block.type.startswith(kind)), None)
        mend = (
            f'write the mesh with first-order elements ("{plain}")'
            if plain
            else "leave them out: walls, slabs, beams and columns are surfaces and lines"
        )
        text = f"it holds {count} cells of type {block.type!r}, which have no element here"
        raise Complaint("mesh.file", f"{text}; {mend}")


def _cells(mesh: Any, kind: str, corners: int, tags: str | None) -> Cells:
    """Join the blocks of one type, whose cells have so many corners."""
    blocks = [number for number, block in enumerate(mesh.cells) if block.type == kind]
    if not blocks:
        return Cells(np.zeros((0, corners), dtype=np.int64), {})
    nodes = np.concatenate([mesh.cells[number].data for number in blocks]).astype(np.int64)
    names: dict[str, list[Flags]] = {}
    for place, number in enumerate(blocks):
        count = len(mesh.cells[number].data)
        for name, flags in _groups(mesh, number, count, tags):
            empty = [np.zeros(len(mesh.cells[b].data), dtype=np.bool_) for b in blocks]
            names.setdefault(name, empty)[place] |= flags
    return Cells(nodes, {name: np.concatenate(parts) for name, parts in names.items()})


def _groups(mesh: Any, block: int, count: int, tags: str | None) -> Iterable[tuple[str, Flags]]:
    """Yield the groups of one block with the flags of its cells."""
    for key in ("gmsh:physical", "cell_tags", tags):
        if key is None or key not in mesh.cell_data:
            continue
        values = np.asarray(mesh.cell_data[key][block]).ravel()
        for value in np.unique(values):
            names = [f"{float(value):g}"]
            if key == "cell_tags":  # MED: a family may belong to several groups
                names += getattr(mesh, "cell_tags", {}).get(int(value), [])
            elif key == "gmsh:physical":
                names += [n for n, data in mesh.field_data.items() if int(data[0]) == int(value)]
            for name in names:
                yield name, values == value
    for name, sets in mesh.cell_sets.items():
        if name.startswith("gmsh:") or sets[block] is None:
            continue
        flags = np.zeros(count, dtype=np.bool_)
        flags[np.asarray(sets[block], dtype=np.int64)] = True
        yield name, flags
