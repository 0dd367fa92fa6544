"""Shapes in which given forces move a structure, without the modes that they do not drive.

K^-1 M is applied again and again to the static shapes under the forces, and the results are made
orthogonal (Wilson, Yuan and Dickens, Earthquake Engineering and Structural Dynamics 10, 1982). A
horizontal force drives few of the many modes of a building's slabs: a hundred such shapes replace
three hundred modes.
"""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from scipy.sparse import csc_matrix

from femupdate.arrays import Floats
from femupdate.errors import StructureError
from femupdate.fe.products import along, combined, diagonal, orthonormal, symmetric_times
from femupdate.fe.solve import NaturalModes

_POINTS = 400  # frequencies at which it is checked


class Factored(Protocol):
    """A symmetric matrix (n, n), and linear systems with it."""

    def apply(self, rhs: Floats) -> Floats:
        """Solve for (n, m)."""

    def times(self, shapes: Floats) -> Floats:
        """The matrix times (n, m)."""


def driven_shapes(
    factorization: Factored,
    mass: csc_matrix,
    forces: Floats,
    rows: Floats,
    top_hz: float,
    *,
    watched: Sequence[Floats] = (),
) -> NaturalModes:
    """Shapes that give the response to some forces up to a frequency, diagonal as modes are.

    Shapes are added until sixteen more change the response to every force by less than the
    tolerance. With them, the six-story frame errs by 2e-6 rms (1e-4 at most), since convergence
    quickens. Those that have converged are natural modes.

    Args:
        factorization: of the stiffness (n, n), which is symmetric.
        rows: (o, n) that observe the motion.
        watched: groups of further rows (w, n) whose response must be right, such as the forces of
            a member each. They start no shapes. What is small beside the largest of its group, as a
            force that symmetry makes zero, may err by as much as that.

    Raises:
        StructureError: 1200 shapes are not enough, or a stiffness is negative.
    """
    # The observed rows start shapes as well: the error of a response is the product of both errors.
    loads = np.column_stack([forces, rows.T])
    most, tolerance = 1200, 1e-2  # of shapes; rms change of ln of the response, of every group
    # What has no mass would grow in the shapes unseen. A share of the stiffness, the mass of what
    # moves at ten thousand times the top, shows it, changes no mode and leads where mass does.
    share = (2.0 * np.pi * 1e4 * top_hz) ** -2
    basis = np.empty((len(forces), most + loads.shape[1]), order="F")
    small = np.zeros((basis.shape[1],) * 2)  # the stiffness on the basis
    last: list[Floats] | None = None
    count, looked = 0, 0

    def weigh(shapes: Floats) -> Floats:
        return symmetric_times(mass, shapes) + share * factorization.times(shapes)

    while count < most:
        fresh = factorization.apply(loads)
        moved = symmetric_times(mass, fresh) + share * loads
        block, loads = orthonormal(fresh, basis[:, :count], weigh, moved)
        exhausted = block.shape[1] == 0
        basis[:, count : count + block.shape[1]] = block
        count += block.shape[1]
        # The response is checked every sixteen shapes.
        if exhausted or count >= looked + 16:
            new = slice(looked, count)
            pulled = factorization.times(basis[:, new])
            small[:count, new] = along(basis[:, :count], pulled)
            small[new, :count] = small[:count, new].T
            omega, vectors = diagonal(small[:count, :count])
            driven = vectors.T @ along(basis[:, :count], forces)
            # Of watched rows nobody looks for a hundredth of what is smaller than the largest.
            w = 2.0 * np.pi * top_hz * np.arange(1, _POINTS + 1) / _POINTS
            flexible = 1.0 / (omega[:, None] ** 2 - w**2 + 2j * 0.01 * omega[:, None] * w)
            alone = np.abs(flexible)
            response = []  # ln of the motion (c, o, k) under every force, of each group
            for group, least in ((rows, 0.0), *((some, 1e-3) for some in watched)):
                seen = (group @ basis[:, :count]) @ vectors
                size = np.abs(np.stack([(seen * force) @ flexible for force in driven.T]))
                # Beside its bound by Cauchy and Schwarz, what symmetry makes zero is rounding.
                bound = (driven**2).T[:, None] @ alone * (seen**2 @ alone)
                floor = least * size.max(axis=(1, 2), keepdims=True) + 1e-6 * np.sqrt(bound)
                floor += 1e-300
                response.append(np.asarray(np.log(size + floor)))
            moves = [  # mean square change of each force's response, of each group of rows
                ((after - before) ** 2).mean(axis=(1, 2))
                for after, before in zip(response, last or (), strict=False)
            ]
            if exhausted or (moves and float(np.sqrt(np.max(moves))) < tolerance):
                return NaturalModes(omega / (2.0 * np.pi), combined(basis[:, :count], vectors))
            last, looked = response, count
    raise StructureError(f"{most} shapes do not give the response up to {top_hz:g} Hz; lower that")
