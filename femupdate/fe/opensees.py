"""What a kind of element adds to the OpenSees script: tables, and the code that reads them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femupdate.arrays import Floats, Integers


@dataclass(frozen=True)
class OpenSeesTable:
    """A table of the script: names of its columns, and arrays (n,) or (n, k) beside each other."""

    head: tuple[str, ...]
    columns: Sequence[NDArray[Any]]

    def text(self, name: str) -> str:
        """Python that assigns the rows to a name."""
        rows = zip(*self.columns, strict=True)
        lines = "\n".join(numbers(np.concatenate([np.ravel(v) for v in row])) for row in rows)
        return f'# {", ".join(self.head)}\n{name} = table("""\n{lines}\n""")\n\n'


@dataclass(frozen=True)
class OpenSeesPart:
    """What one kind of element adds."""

    tables: Mapping[str, OpenSeesTable]  # by the names that the code uses
    # Python that adds the elements to OpenSees when it runs inside the script's `build`. It may use
    # `ops`, `np`, `TYPES` (the element type chosen for each kind), `whole` (node tags of node
    # indices), `new("element")` (the next free tag) and `arm`.
    code: str


def numbers(values: Iterable[Any]) -> str:
    """Numbers as text, with twelve digits."""
    return " ".join(f"{value:.12g}" for value in values)


def sections(*columns: Floats) -> tuple[Floats, Integers]:
    """The distinct rows (m, c) of some columns (n,), and the row of each element, (n,)."""
    kinds, which = np.unique(np.column_stack(columns), axis=0, return_inverse=True)
    return kinds, which.ravel()
