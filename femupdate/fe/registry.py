"""Finds the kinds of elements: every `Elements` in a module of the folder `elements`."""

from functools import cache

from femupdate.errors import StructureError
from femupdate.fe import elements
from femupdate.fe.model import Elements
from femupdate.registry import classes_in


@cache
def element_kinds() -> dict[str, type[Elements]]:
    """All kinds of elements by their names."""
    kinds = classes_in(elements, Elements)  # type: ignore[type-abstract] # only its kinds are made
    return {kind.name: kind for kind in kinds}


def cell_types() -> dict[str, int]:
    """The types of cells that elements are made of, with the number of their nodes."""
    return {kind.cell_type: kind.node_count() for kind in element_kinds().values()}


def element_for(cell_type: str, name: str | None = None) -> type[Elements]:
    """The kind of element that cells of a mesh file become.

    Args:
        name: of the kind; the standard one of this type where None.

    Raises:
        StructureError: no kind of this name is made of such cells.
    """
    fitting = {k: kind for k, kind in element_kinds().items() if kind.cell_type == cell_type}
    if name is None:
        name = next((k for k, kind in fitting.items() if kind.standard), "")
    if name not in fitting:
        raise StructureError(
            f"no element named {name!r} is made of {cell_type} cells; the known ones are "
            f"{', '.join(fitting)}"
        )
    return fitting[name]
