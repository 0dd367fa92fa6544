"""The flat three-node shell: Felippa's optimal membrane triangle and the plate triangle DKMT."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.fe.membrane import integrate, plane_stress
from femupdate.fe.model import ElementMatrices, area_vectors, repeated, rows
from femupdate.fe.plate import SHEAR_CORRECTION
from femupdate.fe.surface import Surface

_SIDES = np.array([[0, 1], [1, 2], [2, 0]])
# Sides that meet in each corner: the one that starts there and the one that ends there.
_LEAVING, _ARRIVING = (0, 1, 2), (2, 0, 1)
_MIDDLES = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]])  # area coordinates

_LUMPING = 1.5  # alpha_b of Felippa (2003): how drilling rotations share the basic stiffness
# beta_1 ... beta_9 of Felippa (2003), table 2, as the rows of Q at the three corners.
_Q = np.array(
    [
        [[1.0, 2.0, 1.0], [0.0, 1.0, -1.0], [-1.0, -1.0, -2.0]],
        [[-2.0, -1.0, -1.0], [1.0, 1.0, 2.0], [-1.0, 0.0, 1.0]],
        [[1.0, -1.0, 0.0], [-1.0, -2.0, -1.0], [2.0, 1.0, 1.0]],
    ]
)


@dataclass(frozen=True, kw_only=True)
class Triangles(Surface):
    """Three-node shells.

    Membrane with drilling rotations: the optimal triangle of Felippa (2003), Comput. Methods Appl.
    Mech. Engrg. 192, 2125-2168. Plate: DKMT, discrete Kirchhoff-Mindlin (Katili 1993), Int. J.
    Numer. Meth. Engng 36, 1859-1883, for thin and thick plates. Inertias are those of the
    four-node shell.
    """

    name: ClassVar[str] = "triangle"
    cell_type: ClassVar[str] = "triangle"
    standard: ClassVar[bool] = True
    opensees_types: ClassVar[tuple[str, ...]] = ("ASDShellT3",)

    nodes: Integers = rows(3, dtype=np.int64)

    def matrices(self, points: Floats) -> ElementMatrices:
        """As `Elements.matrices`, (n, 18, 18)."""
        self.check(points)
        shape = _Shape.of(self.corners(points))
        stiffness = np.zeros((len(self), 18, 18))
        for directions, part in (
            (self.directions(0, 1, 5), _membrane(shape, *self.elastic)),
            (self.directions(2, 3, 4), _plate(shape, *self.elastic)),
        ):
            stiffness[:, directions[:, None], directions] = part
        local = ElementMatrices(stiffness, self._mass(shape.area))
        return local.moved_by(repeated(shape.axes, 6))

    def check(self, points: Floats) -> None:
        """As `Elements.check`; a triangle needs an area as well."""
        super().check(points)
        corners = self.corners(points)
        sides = np.linalg.norm(corners[:, _SIDES[:, 1]] - corners[:, _SIDES[:, 0]], axis=2)
        twice = 2.0 * np.linalg.norm(area_vectors(corners), axis=1)
        # A triangle of less height, over the longest side, has no area.
        self.refuse(
            ~(twice > 1e-6 * sides.max(axis=1, initial=0.0) ** 2),
            "has no area; its three nodes must not lie on one line",
        )

    def _mass(self, area: Floats) -> Floats:
        """Consistent mass in local axes, (n, 18, 18)."""
        product = area[:, None, None] / 12.0 * (np.ones((3, 3)) + np.eye(3))
        mass = np.zeros((len(area), 3, 6, 3, 6))
        for direction, inertia in enumerate(self.inertia().T):
            mass[:, :, direction, :, direction] = inertia[:, None, None] * product
        return mass.reshape(-1, 18, 18)


@dataclass(frozen=True)
class _Shape:
    """Triangles in their own planes."""

    axes: Floats  # (n, 3, 3) rows are the local x, y and z axes
    plane: Floats  # (n, 3, 2) corners, counter-clockwise, m
    area: Floats  # (n,) m2
    length: Floats  # (n, 3) of the sides 1-2, 2-3 and 3-1, m
    direction: Floats  # (n, 3, 2) unit vectors along them

    @classmethod
    def of(cls, corners: Floats) -> "_Shape":
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        x = first / np.linalg.norm(first, axis=1, keepdims=True)
        z = np.cross(first, second)
        twice = np.linalg.norm(z, axis=1, keepdims=True)
        z = z / twice
        axes = np.stack([x, np.cross(z, x), z], axis=1)
        centred = corners - corners.mean(axis=1, keepdims=True)
        plane = np.einsum("nij,nkj->nki", axes, centred)[..., :2]
        side = plane[:, _SIDES[:, 1]] - plane[:, _SIDES[:, 0]]
        length = np.linalg.norm(side, axis=2)
        return cls(axes, plane, 0.5 * twice[:, 0], length, side / length[..., None])


def _membrane(
    shape: _Shape, thickness: Floats, youngs_modulus: Floats, poisson_ratio: Floats
) -> Floats:
    """Stiffness against in-plane motion and drilling, (n, 9, 9): u, v, rotation node by node.

    The basic part makes the patch test; the higher-order part bends exactly in its plane where two
    triangles make a rectangle, whatever its sides (Felippa 2003, sections 4 to 6).
    """
    volume = shape.area * thickness
    elasticity = plane_stress(youngs_modulus, poisson_ratio)
    lumping = _lumping(shape.plane, thickness)
    basic = lumping @ elasticity @ np.swapaxes(lumping, 1, 2) / volume[:, None, None]
    deviation = _deviatoric_rotation(shape)
    x, y = np.moveaxis(shape.direction, -1, 0)
    # Cartesian strains per unit strain along the three sides, (n, 3, 3).
    natural = np.linalg.inv(np.stack([x * x, y * y, x * y], axis=2))
    elastic = np.swapaxes(natural, 1, 2) @ elasticity @ natural
    per_length = (2.0 / 3.0 * shape.area[:, None] / shape.length**2)[:, None, :, None]
    corner = _Q * per_length
    middle = 0.5 * (corner + np.roll(corner, -1, axis=1))
    # (1 - 4 nu^2) / 2, Felippa's beta_0, must not vanish.
    weight = np.maximum(0.5 * (1.0 - 4.0 * poisson_ratio**2), 0.01)
    of_rotation = integrate(middle, elastic[:, None] @ middle, np.ones((len(volume), 3)))
    of_rotation *= (0.75 * weight * volume)[:, None, None]
    return basic + np.swapaxes(deviation, 1, 2) @ of_rotation @ deviation


def _lumping(plane: Floats, thickness: Floats) -> Floats:
    """Forces at the nodes that stand for constant stresses, (n, 9, 3)."""
    matrix = np.zeros((len(plane), 9, 3))
    for node in range(3):
        after, before = (node + 1) % 3, (node + 2) % 3
        # Sides across (after - before) and those that meet in the node.
        across = plane[:, after] - plane[:, before]
        start, end = plane[:, node] - plane[:, before], plane[:, after] - plane[:, node]
        x, y = -across[:, 0], across[:, 1]
        row = 3 * node
        matrix[:, row, 0] = matrix[:, row + 1, 2] = y
        matrix[:, row, 2] = matrix[:, row + 1, 1] = x
        (dx_in, dy_in), (dx_out, dy_out) = start.T, end.T
        matrix[:, row + 2, 0] = _LUMPING / 6.0 * y * (dy_in - dy_out)
        matrix[:, row + 2, 1] = _LUMPING / 6.0 * x * (dx_out - dx_in)
        matrix[:, row + 2, 2] = _LUMPING / 3.0 * (-dx_in * dy_in + dx_out * dy_out)
    return 0.5 * thickness[:, None, None] * matrix


def _deviatoric_rotation(shape: _Shape) -> Floats:
    """Corner rotations less the mean rotation of the triangle, (n, 3, 9)."""
    plane = shape.plane
    matrix = np.zeros((len(plane), 3, 9))
    for node in range(3):
        after, before = (node + 1) % 3, (node + 2) % 3
        across = (plane[:, before] - plane[:, after]) / (4.0 * shape.area[:, None])
        matrix[:, :, 3 * node] = across[:, :1]
        matrix[:, :, 3 * node + 1] = across[:, 1:]
        matrix[:, node, 3 * node + 2] = 1.0
    return matrix


def _plate(
    shape: _Shape, thickness: Floats, youngs_modulus: Floats, poisson_ratio: Floats
) -> Floats:
    """Stiffness against bending and transverse shear, (n, 9, 9): w, rx, ry node by node.

    Rotations are quadratic along the sides; their middle values follow from the side's own
    equilibrium as a Timoshenko beam (Katili 1993), which makes thin and thick plates alike exact
    for constant moments.
    """
    bending = plane_stress(youngs_modulus, poisson_ratio) * (thickness**3 / 12.0)[:, None, None]
    rigidity = SHEAR_CORRECTION * thickness * 0.5 * youngs_modulus / (1.0 + poisson_ratio)
    extra = _middle_rotations(shape, thickness, poisson_ratio)
    area = np.repeat(shape.area[:, None] / 3.0, 3, axis=1)
    curvature = _plate_curvature(shape, extra)
    stiffness = integrate(curvature, bending[:, None] @ curvature, area)
    flexible = _shear_flexibility(shape, thickness, poisson_ratio)
    shear = _plate_shear(shape.direction, flexible, extra)
    return stiffness + integrate(shear, rigidity[:, None, None, None] * shear, area)


def _shear_flexibility(shape: _Shape, thickness: Floats, poisson_ratio: Floats) -> Floats:
    """phi = 12 D / (k G t L^2) of each side, (n, 3), in which Young's modulus cancels."""
    flexibility = 2.0 * thickness**2 / (SHEAR_CORRECTION * (1.0 - poisson_ratio))
    return flexibility[:, None] / shape.length**2


def _middle_rotations(shape: _Shape, thickness: Floats, poisson_ratio: Floats) -> Floats:
    """Rotation along each side that exceeds the linear one at its middle, (n, 3, 9).

    With the section's rotation b along the side s (u = z b), shear g = w,s + b and
    g = -2/3 phi d on every side, where 4 x (1 - x) d is the quadratic part of b:
    2/3 L (1 + phi) d = w_i - w_j - L/2 (b_i + b_j).
    """
    length, direction = shape.length, shape.direction
    flexible = _shear_flexibility(shape, thickness, poisson_ratio)
    matrix = np.zeros((len(length), 3, 9))
    for number, (first, second) in enumerate(_SIDES):
        matrix[:, number, 3 * first], matrix[:, number, 3 * second] = 1.0, -1.0
        for node in (first, second):
            # u = z ry, v = -z rx: the rotation along the side is ry cos - rx sin.
            matrix[:, number, 3 * node + 2] = -0.5 * length[:, number] * direction[:, number, 0]
            matrix[:, number, 3 * node + 1] = 0.5 * length[:, number] * direction[:, number, 1]
    return matrix * (1.5 / (length * (1.0 + flexible)))[..., None]


def _plate_curvature(shape: _Shape, extra: Floats) -> Floats:
    """Curvatures (x, y, twice xy) at the middles of the sides, (n, 3, 3, 9)."""
    count = len(extra)
    across = shape.plane[:, [1, 2, 0]] - shape.plane[:, [2, 0, 1]]
    # Gradients of the area coordinates, (n, 2, 3).
    slopes = np.stack([across[..., 1], -across[..., 0]], axis=1)
    slopes = slopes / (2.0 * shape.area[:, None, None])
    linear = np.zeros((count, 1, 3, 9))
    for node in range(3):
        x, y = slopes[:, 0, node], slopes[:, 1, node]
        linear[:, 0, 0, 3 * node + 2] = x
        linear[:, 0, 1, 3 * node + 1] = -y
        linear[:, 0, 2, 3 * node + 2] = y
        linear[:, 0, 2, 3 * node + 1] = -x
    # Gradients of 4 L_i L_j at the three points, (n, point, side, 2).
    bubble = np.zeros((count, 3, 3, 2))
    for number, (first, second) in enumerate(_SIDES):
        for point, share in enumerate(_MIDDLES):
            bubble[:, point, number] = 4.0 * (
                share[first] * slopes[:, :, second] + share[second] * slopes[:, :, first]
            )
    cosine, sine = shape.direction[:, None, :, 0], shape.direction[:, None, :, 1]
    quadratic = np.stack(
        [
            bubble[..., 0] * cosine,
            bubble[..., 1] * sine,
            bubble[..., 1] * cosine + bubble[..., 0] * sine,
        ],
        axis=2,
    )
    return linear + quadratic @ extra[:, None]


def _plate_shear(direction: Floats, flexible: Floats, extra: Floats) -> Floats:
    """Shear (xz, yz) at the middles of sides (n, 3, 2, 9), linear between that of the corners."""
    along = -2.0 / 3.0 * flexible[..., None] * extra  # (n, side, 9)
    corners = []
    for leaving, arriving in zip(_LEAVING, _ARRIVING, strict=True):
        sides = [leaving, arriving]
        corners.append(np.linalg.solve(direction[:, sides], along[:, sides]))
    return np.einsum("gi,niab->ngab", _MIDDLES, np.stack(corners, axis=1))
