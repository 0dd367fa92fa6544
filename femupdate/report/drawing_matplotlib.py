"""The building drawn by matplotlib, where nothing can render: farther things first."""

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection

from femupdate.arrays import Floats
from femupdate.report.geometry import VIEW, Geometry, Landmarks, outline
from femupdate.report.style import INK, QUIET


def draw(
    panel: Axes, geometry: Geometry, moved: Floats, values: Floats, color_map: str, top: float
) -> None:
    """Draw the building into a panel; arguments as for the rendered picture."""
    flat, depth = project(moved)
    colors = matplotlib.colormaps[color_map]
    pieces = [*geometry.shells, *geometry.beams]
    is_shell = np.arange(len(pieces)) < len(geometry.shells)
    far = np.array([depth[piece].mean() for piece in pieces])
    # A beam in the plane of a slab or wall must not vanish behind it.
    order = np.argsort(far + np.where(is_shell, 0.0, 0.02 * geometry.size), kind="stable")
    face = colors(np.array([values[piece].mean() for piece in pieces]) / top)
    edge = np.where(is_shell[:, None], (0.2, 0.22, 0.25, 0.3), face)
    panel.add_collection(
        LineCollection(
            list(project(geometry.nodes)[0][outline(geometry)]),
            colors=QUIET,
            linewidths=0.7,
            alpha=0.5,
            zorder=1.0,
        )
    )
    panel.add_collection(
        PolyCollection(
            [flat[pieces[i]] for i in order],
            facecolors=face[order],
            edgecolors=edge[order],
            linewidths=np.where(is_shell, 0.3, 2.2)[order],
            zorder=2.0,
        )
    )
    panel.autoscale_view()
    panel.set_aspect("equal")


def mark(panel: Axes, marks: Landmarks) -> None:
    """Draw names and axes."""
    if not marks.names:
        return
    lines = [project(axis)[0] for axis in marks.axes]
    panel.add_collection(LineCollection(lines, colors=INK, linewidths=1.2))
    places = project(marks.places)[0]
    panel.update_datalim(places)
    for name, (x, y) in zip(marks.names, places, strict=True):
        beside = "center" if name in "xyz" else "right"
        panel.text(x, y, name, ha=beside, va="center", fontsize=9, color=INK)
    panel.autoscale_view()


def project(points: Floats) -> tuple[Floats, Floats]:
    """Return the points (N, 2) as seen, up being up, and their nearness (N,) to the eye."""
    towards = np.asarray(VIEW) / np.linalg.norm(VIEW)
    right = np.cross((0.0, 0.0, 1.0), towards)
    right /= np.linalg.norm(right)
    up = np.cross(towards, right)
    return points @ np.stack([right, up], axis=1), points @ towards
