"""The two-node Timoshenko beam in space, with consistent mass."""

import numpy as np

from femupdate.arrays import Floats
from femupdate.errors import ModelError
from femupdate.fe.element import ElementMatrices, symmetric
from femupdate.fe.links import rigid_arms
from femupdate.fe.model import Beams

_AXIAL = np.array([0, 6])
_TORSION = np.array([3, 9])
_PLANE_XY = np.array([1, 5, 7, 11])  # v and rz, where rz = +dv/dx
_PLANE_XZ = np.array([2, 4, 8, 10])  # w and ry, where ry = -dw/dx
_SIGN_XZ = np.array([1.0, -1.0, 1.0, -1.0])
_PARALLEL = 1e-6  # sine of the angle between `up` and the axis below which there is no plane


def beam_matrices(coordinates: Floats, beams: Beams) -> ElementMatrices:
    """Stiffness and consistent mass of beams.

    The stiffness is exact for loads at the nodes (Przemieniecki 1968); the mass holds rotary and
    torsional inertia and is consistent with the shear-flexible shape (Friedman and Kosmatka 1993).

    Args:
        coordinates: (n, 2, 3) ends, m.
        beams: sections, materials and orientations.

    Returns:
        matrices (n, 12, 12).

    Raises:
        ModelError: a beam has no length, `up` along its axis or an impossible property.
    """
    to_local, stiffness, mass = local_matrices(coordinates, beams)
    to_global = np.swapaxes(to_local, 1, 2)
    return ElementMatrices(
        symmetric(to_global @ stiffness @ to_local), symmetric(to_global @ mass @ to_local)
    )


def local_matrices(coordinates: Floats, beams: Beams) -> tuple[Floats, Floats, Floats]:
    """Matrices in local axes, and the way there, (n, 12, 12) each.

    Rigid arms at the ends are part of the way. Released ends move so that no force passes them:
    they are condensed, and the mass follows the same shapes.

    Args:
        coordinates: (n, 2, 3) nodes, m.
        beams: sections, materials, orientations, arms and releases.

    Returns:
        from global motion of the nodes to local motion of the ends; stiffness; mass.

    Raises:
        ModelError: as `beam_matrices`.
    """
    _check_properties(beams)
    ends = coordinates if beams.offset is None else coordinates + beams.offset
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    axes = _axes(ends, length, beams)
    count = len(beams)
    blocks = np.zeros((count, 4, 3, 4, 3))
    for block in range(4):
        blocks[:, block, :, block] = axes
    to_local = blocks.reshape(count, 12, 12)
    if beams.offset is not None:
        arms = np.zeros((count, 2, 6, 2, 6))
        for end in range(2):
            arms[:, end, :, end] = rigid_arms(beams.offset[:, end])
        to_local = to_local @ arms.reshape(count, 12, 12)
    stiffness, mass = _local_matrices(length, beams)
    if beams.released is not None:
        stiffness, mass = _released(stiffness, mass, beams)
    return to_local, stiffness, mass


def _released(stiffness: Floats, mass: Floats, beams: Beams) -> tuple[Floats, Floats]:
    """Condense the released ends; the few patterns of release are treated one by one."""
    assert beams.released is not None
    stiffness, mass = stiffness.copy(), mass.copy()
    patterns, which = np.unique(beams.released, axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        if not pattern.any():
            continue
        chosen = which.ravel() == number
        out, kept = np.flatnonzero(pattern), np.flatnonzero(~pattern)
        own = stiffness[chosen][:, out[:, None], out]
        loose = np.linalg.matrix_rank(own, hermitian=True) < len(out)
        members = np.zeros(len(beams), dtype=bool)
        members[np.flatnonzero(chosen)[loose]] = True
        _refuse(members, beams, "is released so far that it moves freely; keep one end fixed")
        shapes = np.zeros((int(chosen.sum()), 12, 12))
        shapes[:, kept, kept] = 1.0
        shapes[:, out[:, None], kept] = -np.linalg.solve(
            own, stiffness[chosen][:, out[:, None], kept]
        )
        for matrix in (stiffness, mass):
            matrix[chosen] = np.swapaxes(shapes, 1, 2) @ matrix[chosen] @ shapes
    return stiffness, mass


def _local_matrices(length: Floats, beams: Beams) -> tuple[Floats, Floats]:
    """Stiffness and mass in local axes, (n, 12, 12) each."""
    stiffness, mass = np.zeros((2, len(beams), 12, 12))
    shear_modulus = 0.5 * beams.youngs_modulus / (1.0 + beams.poisson_ratio)
    axial = beams.youngs_modulus * beams.area / length
    torsion = shear_modulus * beams.torsion_constant / length
    polar = beams.inertia_y + beams.inertia_z
    stiffness[:, _AXIAL[:, None], _AXIAL] = _bar(axial, 1.0, -1.0)
    stiffness[:, _TORSION[:, None], _TORSION] = _bar(torsion, 1.0, -1.0)
    line = beams.density * length / 6.0
    mass[:, _AXIAL[:, None], _AXIAL] = _bar(line * beams.area, 2.0, 1.0)
    mass[:, _TORSION[:, None], _TORSION] = _bar(line * polar, 2.0, 1.0)
    for index, sign, inertia, shear_area in (
        (_PLANE_XY, np.ones(4), beams.inertia_z, beams.shear_area_y),
        (_PLANE_XZ, _SIGN_XZ, beams.inertia_y, beams.shear_area_z),
    ):
        flexural = beams.youngs_modulus * inertia
        ratio = 12.0 * flexural / (shear_modulus * shear_area * length**2)
        flip = np.outer(sign, sign)
        where = (slice(None), index[:, None], index)
        stiffness[where] = flip * _bending_stiffness(length, flexural, ratio)
        translation = _translational_mass(length, beams.density * beams.area, ratio)
        mass[where] = flip * (translation + _rotary_mass(length, beams.density * inertia, ratio))
    return stiffness, mass


def _bar(scale: Floats, diagonal: float, other: float) -> Floats:
    return scale[:, None, None] * np.array([[diagonal, other], [other, diagonal]])


def _plane_matrix(rows: tuple[tuple[Floats, ...], ...]) -> Floats:
    """Full (n, 4, 4) matrices from the rows of their upper triangle."""
    matrix = np.zeros((len(rows[0][0]), 4, 4))
    for i, row in enumerate(rows):
        for j, value in enumerate(row, start=i):
            matrix[:, i, j] = matrix[:, j, i] = value
    return matrix


def _bending_stiffness(length: Floats, flexural: Floats, ratio: Floats) -> Floats:
    """Deflection and slope at both ends, (n, 4, 4); ratio = 12 E I / (G A_s L^2)."""
    one = np.ones_like(length)
    matrix = _plane_matrix(
        (
            (12.0 * one, 6.0 * length, -12.0 * one, 6.0 * length),
            ((4.0 + ratio) * length**2, -6.0 * length, (2.0 - ratio) * length**2),
            (12.0 * one, -6.0 * length),
            ((4.0 + ratio) * length**2,),
        )
    )
    return (flexural / ((1.0 + ratio) * length**3))[:, None, None] * matrix


def _translational_mass(length: Floats, line_mass: Floats, ratio: Floats) -> Floats:
    """Mass of the deflection, (n, 4, 4) (Friedman and Kosmatka 1993)."""
    square = ratio**2
    own = 70.0 * square + 147.0 * ratio + 78.0
    tilt = (35.0 * square + 77.0 * ratio + 44.0) * length / 4.0
    cross = 35.0 * square + 63.0 * ratio + 27.0
    cross_tilt = (35.0 * square + 63.0 * ratio + 26.0) * length / 4.0
    slope = (7.0 * square + 14.0 * ratio + 8.0) * length**2 / 4.0
    cross_slope = (7.0 * square + 14.0 * ratio + 6.0) * length**2 / 4.0
    matrix = _plane_matrix(
        ((own, tilt, cross, -cross_tilt), (slope, cross_tilt, -cross_slope), (own, -tilt), (slope,))
    )
    return (line_mass * length / (210.0 * (1.0 + ratio) ** 2))[:, None, None] * matrix


def _rotary_mass(length: Floats, line_inertia: Floats, ratio: Floats) -> Floats:
    """Mass of the rotation of the sections, (n, 4, 4) (Friedman and Kosmatka 1993)."""
    own = 36.0 * np.ones_like(length)
    tilt = (3.0 - 15.0 * ratio) * length
    slope = (10.0 * ratio**2 + 5.0 * ratio + 4.0) * length**2
    cross_slope = (5.0 * ratio**2 - 5.0 * ratio - 1.0) * length**2
    matrix = _plane_matrix(
        ((own, tilt, -own, tilt), (slope, -tilt, cross_slope), (own, -tilt), (slope,))
    )
    return (line_inertia / (30.0 * length * (1.0 + ratio) ** 2))[:, None, None] * matrix


def _axes(coordinates: Floats, length: Floats, beams: Beams) -> Floats:
    """Local axes as rows, (n, 3, 3)."""
    size = np.abs(coordinates).max(axis=(1, 2), initial=0.0)
    _refuse(~(length > 1e-9 * size), beams, "has no length; its ends must be two distinct points")
    x = (coordinates[:, 1] - coordinates[:, 0]) / length[:, None]
    across = beams.up - np.einsum("nd,nd->n", beams.up, x)[:, None] * x
    width = np.linalg.norm(across, axis=1)
    parallel = ~(width > _PARALLEL * np.linalg.norm(beams.up, axis=1))
    _refuse(parallel, beams, "has `up` along its axis; give a direction across the beam")
    z = across / width[:, None]
    return np.stack([x, np.cross(z, x), z], axis=1)


def _check_properties(beams: Beams) -> None:
    for name in ("area", "inertia_y", "inertia_z", "torsion_constant", "youngs_modulus"):
        values = getattr(beams, name)
        demand = f"needs a positive {name.replace('_', ' ')}"
        _refuse(~((values > 0.0) & np.isfinite(values)), beams, demand)
    for name in ("shear_area_y", "shear_area_z"):
        demand = f"needs a positive {name.replace('_', ' ')} (infinity for no shear flexibility)"
        _refuse(~(getattr(beams, name) > 0.0), beams, demand)
    fine = (beams.poisson_ratio > -1.0) & (beams.poisson_ratio <= 0.5)
    _refuse(~fine, beams, "needs a Poisson's ratio between -1 and 0.5")
    fine = (beams.density >= 0.0) & np.isfinite(beams.density)
    _refuse(~fine, beams, "needs a density that is zero or positive")


def _refuse(bad: np.ndarray, beams: Beams, complaint: str) -> None:
    if bad.any():
        first = int(bad.argmax())
        ends = " and ".join(map(str, beams.nodes[first].tolist()))
        raise ModelError(f"beam {first} (nodes {ends}) {complaint}")
