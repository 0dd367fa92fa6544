"""Spans of the beams of a read mesh, and what happens at their ends: arms and hinges."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from femupdate.arrays import Flags, Floats, Integers
from femupdate.building.entry import Complaint
from femupdate.building.own_mesh import Part
from femupdate.building.pieces import place

_STRAIGHT = 0.985  # cosine of the angle by which one span turns at most
_LEAST = 1e-3  # m; a beam between rigid ends is longer


@dataclass(frozen=True)
class SpanEnds:
    """Where the spans of line elements start and end.

    Attributes:
        start, end: (n, 2) whether a span starts, or ends, at the first and at the second node of
            each element.
    """

    start: Flags
    end: Flags


def span_ends(nodes: Floats, lines: Integers, others: Integers) -> SpanEnds:
    """Find the spans of line elements.

    A span runs straight on until it meets another line element, forks or ends. It starts at the
    lower coordinate along the axis (x, y or z) along which it runs most.

    Args:
        nodes: (N, 3) m.
        lines: (n, 2) node indices.
        others: nodes of other line elements.
    """
    broken = _breaks(nodes, lines, others)
    elements = np.repeat(np.arange(len(lines)), 2)
    passing = ~broken[lines.ravel()]
    shape = (len(lines), len(nodes))
    through = coo_array(
        (np.ones(int(passing.sum())), (elements[passing], lines.ravel()[passing])), shape=shape
    ).tocsr()
    _, span = connected_components(through @ through.T, directed=False)
    at_end = broken[lines]
    starts, ends = np.zeros_like(at_end), np.zeros_like(at_end)
    element, side = np.nonzero(at_end)
    order = np.argsort(span[element], kind="stable")  # the two ends of a span, one after the other
    first, second = element[order].reshape(-1, 2).T, side[order].reshape(-1, 2).T
    start, end = (nodes[lines[first[k], second[k]]] for k in range(2))
    along = np.abs(end - start).argmax(axis=1)
    rows = np.arange(len(along))
    swapped = (end[rows, along] < start[rows, along]).astype(np.int64)
    starts[first[swapped, rows], second[swapped, rows]] = True
    ends[first[1 - swapped, rows], second[1 - swapped, rows]] = True
    return SpanEnds(starts, ends)


def _breaks(nodes: Floats, lines: Integers, others: Integers) -> Flags:
    """Which nodes spans do not pass, (N,)."""
    count = np.bincount(lines.ravel(), minlength=len(nodes))
    broken = count != 2
    broken[others] = True
    axis = nodes[lines[:, 1]] - nodes[lines[:, 0]]
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    # Unit vectors away from a node add up to nothing where the two are one line.
    away = np.zeros((len(nodes), 3))
    np.add.at(away, lines[:, 0], axis)
    np.add.at(away, lines[:, 1], -axis)
    broken |= np.einsum("nd,nd->n", away, away) > 2.0 - 2.0 * _STRAIGHT
    return np.asarray(broken)


def beam_arms(part: Part, nodes: Floats, lines: Integers, spans: SpanEnds, key: str) -> Floats:
    """Rigid arms from the nodes to the axes of a part's beams, (n, 2, 3) m.

    Raises:
        Complaint: a rigid end is as long as the element there.
    """
    arms = np.zeros((len(lines), 2, 3))
    arms += part.eccentricity or (0.0, 0.0, 0.0)
    if part.rigid_ends is None:
        return arms
    axis = nodes[lines[:, 1]] - nodes[lines[:, 0]]
    length = np.linalg.norm(axis, axis=1)
    first, last = part.rigid_ends
    rigid = first * spans.start + last * spans.end
    short = np.flatnonzero(rigid.sum(axis=1) > length - _LEAST)
    if len(short):
        where = place(nodes[lines[short[0]]].mean(axis=0))
        text = f"they leave nothing of the element at {where}, {length[short[0]]:.4g} m long"
        raise Complaint(f"{key}.rigid_ends", f"{text}; shorten them or make that element longer")
    inwards = np.stack([axis, -axis], axis=1) / length[:, None, None]
    return arms + rigid[:, :, None] * inwards


def beam_releases(part: Part, spans: SpanEnds) -> Flags:
    """Where the beams of a part pass no bending moment on, (n, 12)."""
    hinged = np.zeros_like(spans.start)
    if part.hinges in ("start", "both"):
        hinged |= spans.start
    if part.hinges in ("end", "both"):
        hinged |= spans.end
    released = np.zeros((len(hinged), 12), dtype=np.bool_)
    released[:, [4, 5]] = hinged[:, :1]
    released[:, [10, 11]] = hinged[:, 1:]
    return released
