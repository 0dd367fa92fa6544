"""Names what moves freely in a structure that cannot stand."""

import numpy as np
from scipy.sparse import csc_matrix, diags

from femupdate.arrays import Flags, Floats
from femupdate.errors import StructureError
from femupdate.fe.assembly import AffineOperators
from femupdate.fe.factorization import Factorization, SingularMatrixError, factorize
from femupdate.fe.model import DOF_NAMES, DOF_PER_NODE

_FREE = "moves along {} with nothing to resist it; add a support or a connection there"
# Stiffness of the softest pattern over that of single degrees of freedom. Rounding leaves up to
# 3e-16 to a mechanism; a beam 10 000 times as long as its elements are deep still has 3e-14.
_ROUNDING = 10.0 * float(np.finfo(np.float64).eps)
_PUSHED = "is pushed along {} by a negative stiffness; check the parameters and the springs there"


def factorize_supported(operators: AffineOperators, stiffness: csc_matrix) -> Factorization:
    """Factorise the stiffness matrix of a structure that must stand by itself.

    Args:
        operators: where the matrix comes from, to name nodes.
        stiffness: (n_free, n_free).

    Raises:
        StructureError: something moves freely, or is pushed away by a negative stiffness; the
            message names a node and a direction.
    """
    factorization = factorize_held(operators, stiffness)
    refuse_negative(operators, factorization)
    return factorization


def factorize_held(operators: AffineOperators, stiffness: csc_matrix) -> Factorization:
    """As `factorize_supported`, but what a negative stiffness pushes away is not noticed."""
    diagonal = stiffness.diagonal()
    node, way = np.divmod(operators.free, DOF_PER_NODE)
    along = np.zeros(len(operators.model.nodes))  # how stiff each node is held
    np.maximum.at(along, node[way < 3], diagonal[way < 3])
    loose = (diagonal <= 0.0) | ((way < 3) & (diagonal < _ROUNDING * along[node]))
    if loose.any():
        worst = diagonal[loose].min()
        raise _error(operators, loose & (diagonal == worst), _PUSHED if worst < 0.0 else _FREE)
    try:
        factorization = factorize(stiffness)
    except SingularMatrixError:
        factorization = factorize((stiffness + 1e-10 * diags(diagonal)).tocsc())
        raise _error(operators, _softest(factorization, diagonal)[0], _FREE) from None
    softest, ratio = _softest(factorization, diagonal)
    if abs(ratio) < _ROUNDING:
        raise _error(operators, softest, _FREE)
    return factorization


def refuse_negative(operators: AffineOperators, factorization: Factorization) -> None:
    """Look at the signs of the pivots; see `factorize_supported`.

    Raises:
        StructureError: one is negative.
    """
    pivots = factorization.pivots()
    if pivots is None or (pivots < 0.0).any():
        diagonal = factorization.matrix.diagonal()
        softest, _ = _softest(factorization, diagonal)
        culprit = softest if pivots is None else np.maximum(-pivots / diagonal, 0.0)
        raise _error(operators, culprit, _PUSHED)


def _softest(factorization: Factorization, diagonal: Floats) -> tuple[Floats, float]:
    """Softest pattern of motion, and its stiffness where the diagonal is scaled to one."""
    scale = np.sqrt(diagonal)
    pattern = np.random.default_rng(7).standard_normal(len(scale))
    ratio = 1.0
    for _ in range(3):
        pattern /= np.linalg.norm(pattern)
        image = scale * factorization.apply(scale * pattern)
        ratio = 1.0 / float(pattern @ image)
        pattern = image
    return pattern / scale, ratio


def _error(operators: AffineOperators, motion: Floats | Flags, reason: str) -> StructureError:
    node, direction = np.divmod(operators.free, DOF_PER_NODE)
    points, names = operators.model.nodes, operators.model.names
    size = float(np.ptp(points, axis=0).max()) or 1.0
    # A hundredth of the size makes a rotation comparable to a displacement.
    magnitude = np.abs(motion) * np.where(direction < 3, 1.0, 0.01 * size)
    most = int((magnitude >= 0.999 * magnitude.max()).argmax())
    place = ", ".join(f"{value:g}" for value in points[node[most]])
    name = ("" if names is None else names[node[most]]) or f"node {node[most]}"
    return StructureError(
        f"the structure is a mechanism: {name} at ({place}) m "
        + reason.format(DOF_NAMES[direction[most]])
    )
