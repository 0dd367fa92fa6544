"""NAFEMS LE5: a thin-walled Z-section cantilever under torsion, as open core walls are.

After "The standard NAFEMS benchmarks" (1990), as quoted in the benchmarks manual of Abaqus (4.2.5).
"""

import numpy as np

from femupdate.fe import FiniteElementModel

from .meshes import ALL, UY, displacement, hold, model, shells, zeros
from .shell_forces import shell_forces

LENGTH, FLANGE, WEB, THICKNESS = 10.0, 1.0, 2.0, 0.1
_AT = 2.5  # m from the clamped end


def z_section(along: int = 8, across: int = 1) -> FiniteElementModel:
    """The section: flanges of 1 m in opposite directions at the ends of a web of 2 m."""
    half = 0.5 * WEB
    outline = np.array([[-FLANGE, half], [0.0, half], [0.0, -half], [FLANGE, -half]])
    per_side = np.array([across, 2 * across if across > 1 else 1, across])
    place = np.concatenate([[0.0], np.cumsum(np.repeat(1.0 / per_side, per_side))])
    line = np.stack([np.interp(place, np.arange(4), outline[:, k]) for k in (0, 1)], axis=1)
    x = np.linspace(0.0, LENGTH, along + 1)
    points = np.array([[a, *yz] for a in x for yz in line])
    number = np.arange(len(points)).reshape(along + 1, len(line))
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1)
    return model(
        points,
        hold(len(points), (points[:, 0] == 0, ALL)),
        shells=shells(quads.reshape(-1, 4), THICKNESS, 210e9, 0.3),
    )


def axial_stress(along: int = 8, across: int = 1) -> dict[str, float]:
    """Axial stress at mid-thickness 2.5 m from the wall, at points of the section, Pa.

    The torque of 1.2 MN m acts as a shear of 0.6 MN along each flange. Values of the elements that
    meet at a node within the flange are averaged.
    """
    structure = z_section(along, across)
    load = zeros(len(structure.nodes))
    x, _, z = structure.nodes.T
    for level, force in ((0.5 * WEB, -0.6e6), (-0.5 * WEB, 0.6e6)):
        edge = np.flatnonzero((x == LENGTH) & (z == level))
        shares = np.ones(len(edge))
        shares[[0, -1]] = 0.5
        load[edge, UY] += force * shares / shares.sum()
    u = displacement(structure, load)
    forces = shell_forces(structure, u, np.ones(1))
    stress = forces.stress()
    flange = np.abs(structure.nodes[structure.faces, 2] - 0.5 * WEB).max(axis=1) < 1e-9
    found = {}
    for name, y in (("tip", -FLANGE), ("corner", 0.0)):
        distance = np.linalg.norm(structure.nodes - [_AT, y, 0.5 * WEB], axis=1)
        corner = (structure.faces == distance.argmin()) & flange[:, None]
        found[name] = float(stress[corner][:, 0].mean())
    return found
