"""Stiffness of beams, columns and their joints in parts that a change scales by a number each."""

import numpy as np
from scipy.sparse import csc_matrix

from femupdate.arrays import Flags, Floats, Integers
from femupdate.effects.effect import Hinges, Stiffness
from femupdate.effects.infill import onto_free
from femupdate.effects.structure import Structure
from femupdate.fe.assembly import AffineOperators, element_entries, summed
from femupdate.fe.elements.beam import Beams
from femupdate.fe.model import FiniteElementModel


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
        series: (n,) as in `Stiffness`.
    """
    # Members of one matrix agree in three decimals of it.
    level = np.round(np.log1p(series), 3)
    present = (columns != 0.0).any(axis=1)
    found = []
    for story, height in sorted({*zip(group[present], level[present], strict=True)}):
        chosen = np.flatnonzero(present & (group == story) & (level == height))
        products = sign * columns[chosen, :, None] * columns[chosen, None, :]
        entries = element_entries(nodes[chosen], products)
        matrix: csc_matrix = onto_free(summed([entries], operators.dof), operators)
        if matrix.nnz:
            found.append(Stiffness(int(story), matrix, float(series[chosen].mean())))
    return tuple(found)


def turning_floors(structure: Structure) -> Hinges:
    """Floors of a stick that rotate, held by the columns and a spring each.

    Every story is a column of bending stiffness E I = k h^3 / 12 that is continuous through the
    floors and clamped at the base (Przemieniecki 1968, the beam of two nodes). At unit size the
    spring of a floor is the mean of E I / h over the stories.
    """
    count, levels = len(structure.levels), np.concatenate([[0.0], structure.levels])
    height = np.diff(levels)
    stiffness = np.array(
        [term.diagonal()[k] for k, term in enumerate(structure.stiffness_terms)]
    )  # of a story, at the floor above it
    coupling, inner = np.zeros((2, count, count + 1, count + 1))  # the base comes first
    for story, (k, h) in enumerate(zip(stiffness, height, strict=True)):
        ends = slice(story, story + 2)
        coupling[story, ends, ends] = k * h / 2.0 * np.array([[1.0, 1.0], [-1.0, -1.0]])
        inner[story, ends, ends] = k * h**2 / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
    spring = np.full(count, float((stiffness * height**2).mean()) / 12.0)
    return Hinges(coupling[:, 1:, 1:], inner[:, 1:, 1:], spring)


def turning_beams(model: FiniteElementModel, operators: AffineOperators) -> tuple[Stiffness, ...]:
    """Beams whose ends turn against the columns in the vertical plane, on a spring each.

    At unit size the spring has the E I / L of its beam, L from joint to joint; it is scaled by the
    factor of the beam's story.
    """
    joint = np.zeros(len(model.nodes), dtype=bool)
    joint[bars_of(model, ("column",)).nodes.ravel()] = True
    return _turning(bars_of(model, ("beam",)), joint, joint, (1,), operators)


def turning_feet(model: FiniteElementModel, operators: AffineOperators) -> tuple[Stiffness, ...]:
    """Columns whose held feet turn in both planes, on springs that are made likewise."""
    foot, joint = np.asarray(model.fixed.all(axis=1)), np.zeros(len(model.nodes), dtype=bool)
    for block in model.elements:
        joint[block.nodes[np.isin(block.kind, ("beam", "slab"))].ravel()] = True
    return _turning(bars_of(model, ("column",)), foot, joint | foot, (1, 2), operators)


def _turning(
    bars: Beams, turns: Flags, joint: Flags, axes: tuple[int, ...], operators: AffineOperators
) -> tuple[Stiffness, ...]:
    """Bars whose ends turn about local axes, condensed: k = 1 / (1 / k(0) + s L / (E I)).

    Args:
        turns: (N,) nodes where ends turn.
        joint: (N,) nodes at which bars end.
    """
    points = operators.model.nodes
    spans, ends = _spans(bars, points, joint), turns[bars.nodes]
    columns, series = [], []
    for axis in axes:
        rows, inner = bars.bending_ends(points, axis)
        inertia = bars.inertia_y if axis == 1 else bars.inertia_z
        spring = bars.youngs_modulus * inertia / spans
        # Columns and ratios of what springs at some ends take away.
        softened = np.where(ends[:, :, None] & ends[:, None, :], inner, 0.0)
        ratios, vectors = np.linalg.eigh(softened / spring[:, None, None])
        series.append(np.maximum(ratios, 0.0).ravel())
        taken = np.where(ends[:, :, None], rows, 0.0) / np.sqrt(spring)[:, None, None]
        columns.append((vectors.mT @ taken).reshape(-1, rows.shape[-1]))
    return rank_one_terms(
        np.tile(np.repeat(bars.nodes, 2, axis=0), (len(axes), 1)),
        np.tile(np.repeat(bars.group, 2), len(axes)),
        np.concatenate(columns),
        np.concatenate(series),
        operators,
        sign=-1.0,
    )


def _spans(beams: Beams, points: Floats, joint: Flags) -> Floats:
    """Length of the beam that each element is part of, from joint to joint, (n,) m."""
    length = beams.measure(points)
    axis = np.diff(points[beams.nodes], axis=1)[:, 0] / length[:, None]
    at_node: dict[int, list[int]] = {}
    for element, pair in enumerate(beams.nodes.tolist()):
        for node in pair:
            at_node.setdefault(node, []).append(element)
    span = np.zeros(len(beams))
    for element in range(len(beams)):
        if span[element]:
            continue
        # The elements in one line with it, no joint between them.
        whole, open_ends = [element], list(beams.nodes[element])
        while open_ends:
            node = open_ends.pop()
            for other in () if joint[node] else at_node[node]:
                # The angle between elements of one beam has no greater sine.
                straight = np.linalg.norm(np.cross(axis[element], axis[other])) < 1e-6
                if straight and other not in whole:
                    whole.append(other)
                    open_ends += [end for end in beams.nodes[other] if end != node]
        span[whole] = length[whole].sum()
    return span
