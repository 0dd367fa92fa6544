"""Static displacement and the lowest modes of the full model."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

from femupdate.errors import ModelError
from femupdate.fe.assembly import AffineOperators
from femupdate.fe.factorization import Factorization, factorize
from femupdate.fe.lanczos import block_size, largest_of_inverse
from femupdate.fe.mechanism import factorize_held, factorize_supported, refuse_negative
from femupdate.fe.model import Floats

__all__ = [
    "Factorization",
    "Modes",
    "factorize",
    "lowest_modes",
    "modes_below",
    "static_displacement",
]

_FEW = 500  # degrees of freedom with mass up to which a dense solution is as fast as Lanczos
_NO_MASS = 1e-14
_TOLERANCE = 1e-7  # of residuals; the frequencies have twice as many digits
_ARPACK_TOLERANCE = 1e-8
_RESIDUAL = 1e-6  # relative; sound problems leave 1e-7 at most
_SEED = 20240
_CLEAR = 1e-3  # relative distance of two modes between which pivots are counted
_GAP = 1e-4  # relative; nearer to a mode the signs of the pivots are not sure
_CLOSE = 1e-6  # relative; components this close to the largest tie for the sign


@dataclass(frozen=True)
class Modes:
    """Natural modes, lowest first.

    Attributes:
        frequency_hz: (count,) Hz.
        shapes: (n_free, count) normalised to unit modal mass; the largest component is positive.
    """

    frequency_hz: Floats
    shapes: Floats


def static_displacement(operators: AffineOperators, theta: Floats, load: Floats) -> Floats:
    """Displacement under loads at the nodes.

    Args:
        operators: the assembled model.
        theta: (p,) stiffness parameters.
        load: (6N,) or (6N, m) N and N m; what acts on supports is ignored.

    Returns:
        the displacement in m and rad, in the shape of `load`.

    Raises:
        ModelError: the structure is a mechanism, or the load has another length.
    """
    load = np.asarray(load, dtype=float)
    if load.shape[0] != operators.dof:
        raise ModelError(f"the load has {load.shape[0]} rows; it needs {operators.dof}, six a node")
    factorization = factorize_supported(operators, operators.stiffness(theta))
    return operators.expand(factorization.solve(operators.gather(load)))


def lowest_modes(
    operators: AffineOperators, theta: Floats, count: int, shift_hz: float | None = None
) -> Modes:
    """Lowest natural modes by the shift-invert Lanczos method.

    A Sturm count confirms that no mode below the highest ones returned is missing.

    Args:
        operators: the assembled model.
        theta: (p,) stiffness parameters.
        count: number of modes.
        shift_hz: None for a structure that stands by itself; a small negative value, such as -1.0,
            admits free structures, whose rigid motions come out with zero frequency.

    Raises:
        ModelError: the structure is a mechanism (without shift), count exceeds the degrees of
            freedom that carry mass, or the solution does not converge.
    """
    return _lowest(operators, theta, count, shift_hz)


def _lowest(
    operators: AffineOperators,
    theta: Floats,
    count: int,
    shift_hz: float | None = None,
    below: float = np.inf,
) -> Modes:
    """As `lowest_modes`; exactly `count` eigenvalues are known to lie under a finite `below`."""
    massive = int(np.count_nonzero(operators.mass.diagonal() > 0.0))
    _check_request(massive, count, shift_hz)
    stiffness = operators.stiffness(theta)
    shift = 0.0 if shift_hz is None else -((2.0 * np.pi * shift_hz) ** 2)
    shifted = stiffness if shift_hz is None else (stiffness - shift * operators.mass).tocsc()
    factorization = factorize_held(operators, shifted)
    problem = _Problem(stiffness, operators.mass, factorization, shift)
    if massive <= max(_FEW, 3 * count):
        refuse_negative(operators, factorization)
        return _modes(problem, *_condensed(problem, count))
    complaint = "did not converge"
    for attempt in (_own_lanczos, _arpack, _sharp_arpack):
        found = attempt(problem, count)
        if found is None:
            continue
        residual = _residual(problem, *found)
        if not residual < _RESIDUAL:
            complaint = f"left a relative residual of {residual:.1e}"
        elif found[0][-1] < below < np.inf or _complete(problem, found[0]):
            return _modes(problem, *found)
        else:
            refuse_negative(operators, factorization)
            complaint = "missed a mode"
    raise ModelError(f"the eigenvalue solver {complaint} every time; ask for a few modes more")


@dataclass(frozen=True)
class _Problem:
    """K phi = lambda M phi with K - shift M factorised."""

    stiffness: csc_matrix
    mass: csc_matrix
    factorization: Factorization
    shift: float


def modes_below(operators: AffineOperators, theta: Floats, top_hz: float) -> Modes:
    """Return all modes below a frequency, at least one.

    How many there are is known beforehand: as many as K - w^2 M has negative pivots (Sylvester's
    law of inertia).

    Raises:
        ModelError: the structure is a mechanism, or the modes cannot be counted.
    """
    stiffness = operators.stiffness(theta)
    for nudge in (1.0, 1.003, 1.01):  # beside a natural frequency the pivots have no sure sign
        shift = (2.0 * np.pi * top_hz * nudge) ** 2
        pivots = _indefinite(stiffness - shift * operators.mass).pivots()
        if pivots is not None:
            count = int(np.count_nonzero(pivots < 0.0))
            return _lowest(operators, theta, max(1, count), below=shift if count else np.inf)
    raise ModelError(
        f"the modes below {top_hz:g} Hz cannot be counted; choose a slightly different frequency"
    )


def _check_request(massive: int, count: int, shift_hz: float | None) -> None:
    if not massive:
        raise ModelError("no free degree of freedom carries mass; give densities or point masses")
    if not 1 <= count <= massive:
        raise ModelError(
            f"{count} modes were asked for, but {massive} free degrees of freedom carry mass; "
            f"ask for 1 to {massive}"
        )
    if shift_hz is not None and not shift_hz < 0.0:
        raise ModelError(f"shift_hz is {shift_hz}; give a negative frequency, or None")


def _condensed(problem: _Problem, count: int) -> tuple[Floats, Floats]:
    """Modes from the flexibility of the few degrees of freedom that carry mass.

    With M = R R^T the eigenvalues of R^T K^-1 R are those of K^-1 M that are not zero.
    """
    massive = np.flatnonzero(problem.mass.diagonal() > 0.0)
    own, directions = eigh(problem.mass[massive][:, massive].toarray())
    root = np.zeros((problem.mass.shape[0], len(massive)))
    root[massive] = directions * np.sqrt(np.maximum(own, 0.0))
    flexible = problem.factorization.apply(root)
    flexibility = root.T @ flexible
    inverse, coordinates = eigh(0.5 * (flexibility + flexibility.T))
    inverse, coordinates = inverse[::-1][:count], coordinates[:, ::-1][:, :count]
    if not inverse[-1] > _NO_MASS * inverse[0]:
        raise ModelError(
            f"{count} modes were asked for, but fewer motions carry mass; ask for fewer"
        )
    return problem.shift + 1.0 / inverse, flexible @ coordinates


def _own_lanczos(problem: _Problem, count: int) -> tuple[Floats, Floats] | None:
    size = problem.stiffness.shape[0]
    start = np.random.default_rng(_SEED).standard_normal((size, block_size(count)))
    found = largest_of_inverse(problem.factorization.apply, problem.mass, start, count, _TOLERANCE)
    return None if found is None else (problem.shift + 1.0 / found[0], found[1])


def _arpack(
    problem: _Problem, count: int, tolerance: float = _ARPACK_TOLERANCE, vectors: int | None = None
) -> tuple[Floats, Floats] | None:
    size = problem.stiffness.shape[0]
    start = np.random.default_rng(_SEED).standard_normal(size)
    inverse = LinearOperator((size, size), matvec=problem.factorization.apply, dtype=float)
    try:
        values, shapes = eigsh(
            problem.stiffness,
            k=count,
            M=problem.mass,
            sigma=problem.shift,
            OPinv=inverse,
            v0=start,
            tol=tolerance,
            ncv=vectors,
        )
    except ArpackError:
        return None
    order = np.argsort(values, kind="stable")
    return values[order], shapes[:, order]


def _sharp_arpack(problem: _Problem, count: int) -> tuple[Floats, Floats] | None:
    return _arpack(problem, count, 0.0, min(problem.stiffness.shape[0], 3 * count + 40))


def _complete(problem: _Problem, values: Floats) -> bool:
    """Whether as many eigenvalues lie below the highest gap as were found below it."""
    edges = np.concatenate([[problem.shift], values])
    gaps = np.diff(edges) / (values - problem.shift)
    clear = np.flatnonzero(gaps >= _CLEAR)  # the highest gap leaves least unseen above it
    top = int(clear[-1]) if len(clear) else int(gaps.argmax())
    if gaps[top] < _GAP:
        top = 0
    between = 0.5 * (edges[top] + edges[top + 1])
    pivots = _indefinite(problem.stiffness - between * problem.mass).pivots()
    return pivots is None or np.count_nonzero(pivots < 0.0) == top


def _indefinite(matrix: csc_matrix) -> Factorization:
    return factorize(matrix.tocsc(), definite=False)


def _modes(problem: _Problem, values: Floats, shapes: Floats) -> Modes:
    image = problem.mass @ shapes
    norm = np.sqrt(np.einsum("ij,ij->j", shapes, image))
    magnitude = np.abs(shapes)
    largest = (magnitude >= (1.0 - _CLOSE) * magnitude.max(axis=0)).argmax(axis=0)
    sign = np.sign(shapes[largest, np.arange(len(values))])
    frequency = np.sqrt(np.maximum(values, 0.0)) / (2.0 * np.pi)
    return Modes(frequency, shapes * (sign / norm))


def _residual(problem: _Problem, values: Floats, shapes: Floats) -> float:
    """Largest relative residual of the modes."""
    image = problem.mass @ shapes
    elastic = problem.stiffness @ shapes
    error = np.linalg.norm(elastic - values * image, axis=0)
    size = np.linalg.norm(elastic - problem.shift * image, axis=0)
    return float((error / size).max())
