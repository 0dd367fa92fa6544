"""What the page's model is drawn from: nodes, faces, colours, moving shapes and signs."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.report.figure import MAGNITUDE_MAP, SPREAD_MAP
from femupdate.report.geometry import Geometry, Glyphs, at_levels, outline

MOST_FACES = 6000  # that a phone's processor sorts and draws ten times a second
_MAPS = {"magnitude": MAGNITUDE_MAP, "spread": SPREAD_MAP, "factor": "cividis"}


def thinned_geometry(
    geometry: Geometry, most: int = MOST_FACES
) -> tuple[Geometry, Integers, Integers, Integers]:
    """A geometry of at most about `most` faces and lines; which nodes, faces and lines it keeps.

    Nodes that lie in one cube of a grid become one node, that nearest to their middle; what then
    has no length or area is left out, and of faces between the same nodes one is kept.
    """
    size, cells = geometry.size, 0
    groups = np.arange(len(geometry.nodes))
    while True:
        faces, lines = _kept(geometry, groups)
        if len(faces) + len(lines) <= most:
            break
        cells = int(0.75 * cells) if cells else 160
        groups = _clustered(geometry.nodes, size / cells)
    shells, beams = groups[geometry.shells[faces]], groups[geometry.beams[lines]]
    nodes, place = np.unique(np.concatenate([shells.ravel(), beams.ravel()]), return_inverse=True)
    numbers = place.reshape(-1)
    thinned = Geometry.of(
        geometry.nodes[nodes],
        numbers[: shells.size].reshape(-1, 4),
        numbers[shells.size :].reshape(-1, 2),
    )
    return thinned, nodes, faces, lines


def _clustered(nodes: Floats, side: float) -> Integers:
    """For every node the node (N,) that stands for its cube."""
    cube = np.floor((nodes - nodes.min(axis=0)) / side).astype(np.int64)
    _, group = np.unique(cube, axis=0, return_inverse=True)
    group = group.reshape(-1)
    count = np.bincount(group)
    middle = np.column_stack([np.bincount(group, nodes[:, k]) / count for k in range(3)])
    order = np.argsort(np.linalg.norm(nodes - middle[group], axis=1), kind="stable")
    first = np.full(len(count), -1)
    first[group[order][::-1]] = order[::-1]
    return np.asarray(first[group])


def _kept(geometry: Geometry, groups: Integers) -> tuple[Integers, Integers]:
    """Faces with three or more different corners and lines with two, each once."""
    kept = []
    for pieces, least in ((geometry.shells, 2), (geometry.beams, 1)):
        rows = np.sort(groups[pieces], axis=1)
        chosen = np.flatnonzero((np.diff(rows, axis=1) != 0).sum(axis=1) >= least)
        _, first = np.unique(rows[chosen], axis=0, return_index=True)
        kept.append(np.asarray(chosen[np.sort(first)]))
    return kept[0], kept[1]


def scene_content(
    thinned: tuple[Geometry, Integers, Integers, Integers],
    fields: Sequence[Mapping[str, Any]],
    modes: Sequence[tuple[str, Floats, Floats]],
    signs: Sequence[tuple[Glyphs, bool]],
    floors: Sequence[tuple[str, float]],
) -> dict[str, Any]:
    """Return what `scene.js` draws.

    Args:
        thinned: the building, see `thinned_geometry`.
        fields: name, unit and colour map of what colours elements, with its values at all faces
            and lines of the full geometry, NaN where there is none.
        modes: name, displacements (N, 3) of the full geometry's nodes, of any scale, and standard
            deviations (N,) of these, % of the largest.
        signs: glyphs, and whether they are of an effect (else of sensors).
        floors: name and height, m.
    """
    from matplotlib import colormaps

    geometry, nodes, faces, lines = thinned
    low, high = geometry.nodes.min(axis=0), geometry.nodes.max(axis=0)
    plan = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    colored, moving = [], []
    for field in fields:
        of_faces, of_lines = field["faces"][faces], field["lines"][lines]
        known = np.concatenate([of_faces, of_lines])
        known = known[np.isfinite(known)]
        span = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
        values = {"faces": of_faces, "lines": of_lines, "low": span[0], "high": span[1]}
        colored.append({**field, **values})
    for name, shape, spread in modes:
        largest = np.linalg.norm(shape, axis=1).max() or 1.0
        moved = (shape[nodes] / largest).round(4).ravel()
        moving.append({"name": name, "shape": moved, "spread": spread[nodes].round(2)})
    return {
        "nodes": geometry.nodes.round(3).ravel(),
        "faces": geometry.shells.ravel(),
        "lines": geometry.beams.ravel(),
        "edges": outline(geometry).ravel(),
        "size": geometry.size,
        "span": float(np.hypot(*(high - low)[:2])) or geometry.size,
        "height": float(high[2] - low[2]) or geometry.size,
        "centre": 0.5 * (low + high),
        "fields": colored,
        "modes": moving,
        "signs": [
            {
                "effect": effect,
                "faces": [np.asarray(face).round(3).ravel() for face in glyphs.faces],
                "lines": [np.asarray(line).round(3).ravel() for line in glyphs.lines],
                "balls": [
                    [*np.asarray(centre).round(3), float(radius)] for centre, radius in glyphs.balls
                ],
            }
            for glyphs, effect in signs
        ],
        "labels": [
            {"text": name, "places": [[*corner, float(height)] for corner in plan]}
            for name, height in at_levels(floors, geometry.size)
        ],
        # Red, green and blue, 0 to 255, at even steps of every colour map.
        "maps": {
            name: (255 * colormaps[used](np.linspace(0.0, 1.0, 9))[:, :3])
            .round()
            .astype(int)
            .tolist()
            for name, used in _MAPS.items()
        },
    }
