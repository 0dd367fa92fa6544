"""Stiffness of beams and columns in parts that a change scales by a number each."""

import numpy as np
from scipy.sparse import csc_matrix

from femupdate.arrays import Floats, Integers
from femupdate.effects.effect import Stiffness
from femupdate.effects.infill import onto_free
from femupdate.fe.assembly import AffineOperators
from femupdate.fe.elements.beam import Beams
from femupdate.fe.entries import element_entries, summed
from femupdate.fe.model import FiniteElementModel

_FINE = 3  # decimals of ln(1 + series) in which members of one matrix agree


def bars_of(model: FiniteElementModel, kinds: tuple[str, ...]) -> Beams:
    """The beam elements of some kinds."""
    beams = model.elements_of(Beams)
    return beams.taken(np.flatnonzero(np.isin(beams.kind, kinds)))


def bending_terms(
    model: FiniteElementModel, operators: AffineOperators, kinds: tuple[str, ...]
) -> tuple[Stiffness, ...]:
    """What a share of the second moments of area of some kinds of members adds, shear as it is.

    Args:
        kinds: of beam elements, such as "column".
    """
    bars = bars_of(model, kinds)
    series, columns = bars.bending_parts(model.nodes)
    scale = np.sqrt(1.0 - series)[:, None, :]
    parts = series.shape[1]
    return rank_one_terms(
        np.repeat(bars.nodes, parts, axis=0),
        np.repeat(bars.group, parts),
        (scale * columns).transpose(0, 2, 1).reshape(-1, columns.shape[1]),
        series.ravel(),
        operators,
    )


def rank_one_terms(
    nodes: Integers,
    group: Integers,
    columns: Floats,
    series: Floats,
    operators: AffineOperators,
    sign: float = 1.0,
) -> tuple[Stiffness, ...]:
    """Terms that are sums of products c c^T, one matrix for each story and ratio of series.

    Args:
        nodes: (n, 2) that each column acts on.
        group: (n,) story.
        columns: (n, 12).
        series: (n,) as in `Stiffness`.
        sign: of all products.
    """
    level = np.round(np.log1p(series), _FINE)
    present = (columns != 0.0).any(axis=1)
    found = []
    for story, own in sorted({*zip(group[present], level[present], strict=True)}):
        chosen = np.flatnonzero(present & (group == story) & (level == own))
        products = sign * columns[chosen, :, None] * columns[chosen, None, :]
        entries = element_entries(nodes[chosen], products)
        matrix: csc_matrix = onto_free(summed([entries], operators.dof), operators)
        if matrix.nnz:
            found.append(Stiffness(int(story), matrix, float(series[chosen].mean())))
    return tuple(found)
