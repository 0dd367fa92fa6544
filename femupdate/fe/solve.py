"""Static displacement and the lowest modes of the full model."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csc_matrix

from femupdate.arrays import Floats, Integers
from femupdate.errors import StructureError
from femupdate.fe.assembly import AffineOperators
from femupdate.fe.factorization import Factorization, factorize
from femupdate.fe.mechanism import factorize_held, factorize_supported, refuse_negative
from femupdate.fe.products import combined, orthonormal, symmetric_times


@dataclass(frozen=True)
class NaturalModes:
    """Natural modes, lowest first."""

    frequency_hz: Floats  # (count,) Hz
    # (n_free, count) normalised to unit modal mass; the largest component is positive
    shapes: Floats


def static_displacement(operators: AffineOperators, theta: Floats, load: Floats) -> Floats:
    """Displacement under loads at the nodes, in m and rad.

    Args:
        load: (6N,) or (6N, m) N and N m; what acts on supports is ignored.

    Raises:
        StructureError: the structure is a mechanism, or the load has another length.
    """
    load = np.asarray(load, dtype=float)
    if load.shape[0] != operators.dof:
        raise StructureError(
            f"the load has {load.shape[0]} rows; it needs {operators.dof}, six per node"
        )
    factorization = factorize_supported(operators, operators.stiffness(theta))
    return operators.expand(factorization.solve(operators.gather(load)))


def lowest_modes(
    operators: AffineOperators, theta: Floats, count: int, shift_hz: float | None = None
) -> NaturalModes:
    """Lowest natural modes by the shift-invert Lanczos method.

    A Sturm count confirms that no mode below the highest ones returned is missing.

    Args:
        shift_hz: None for a structure that stands by itself; a small negative value, such as -1.0,
            admits free structures, whose rigid motions come out with zero frequency.

    Raises:
        StructureError: the structure is a mechanism (without shift), count exceeds the degrees of
            freedom that carry mass, or the solution does not converge.
    """
    _check_request(_massive(operators), count, shift_hz)
    stiffness = operators.stiffness(theta)
    shift = 0.0 if shift_hz is None else -((2.0 * np.pi * shift_hz) ** 2)
    shifted = stiffness if shift_hz is None else (stiffness - shift * operators.mass).tocsc()
    factorization = factorize_held(operators, shifted)
    return _lowest(operators, _Problem(stiffness, operators.mass, factorization, shift), count)


def _massive(operators: AffineOperators) -> int:
    """Number of free degrees of freedom that carry mass."""
    return int(np.count_nonzero(operators.mass.diagonal() > 0.0))


def _lowest(
    operators: AffineOperators, problem: "_Problem", count: int, below: float = np.inf
) -> NaturalModes:
    """The lowest modes; exactly `count` eigenvalues are known to lie under a finite `below`."""
    massive = _massive(operators)
    # Up to 500 degrees of freedom with mass a dense solution is as fast as Lanczos.
    if massive <= max(500, 3 * count):
        refuse_negative(operators, problem.factorization)
        return _modes(problem, *_condensed(problem, count))
    complaint = "did not converge"
    # Of modes that are repeated as many copies are found as a block has vectors.
    for times in (1, 4, 16):
        pairs = _lanczos(problem, count, times * min(6, 2 + count // 8))
        if pairs is None:
            continue
        values, shapes = pairs
        image = symmetric_times(problem.mass, shapes)
        elastic = symmetric_times(problem.stiffness, shapes)
        error = np.linalg.norm(elastic - values * image, axis=0)
        size = np.linalg.norm(elastic - problem.shift * image, axis=0)
        residual = float((error / size).max())
        # Solutions without trouble stay below a tenth of it.
        if not residual < 3e-5:
            complaint = f"left a relative residual of {residual:.1e}"
        elif values[-1] < below < np.inf or _complete(problem, values):
            return _modes(problem, *pairs)
        else:
            refuse_negative(operators, problem.factorization)
            complaint = "missed a mode"
    raise StructureError(f"the eigenvalue solver {complaint} every time; ask for a few modes more")


@dataclass(frozen=True)
class _Problem:
    """K phi = lambda M phi with K - shift M factorised."""

    stiffness: csc_matrix
    mass: csc_matrix
    factorization: Factorization
    shift: float


def modes_below(
    operators: AffineOperators,
    theta: Floats,
    top_hz: float,
    factorization: Factorization | None = None,
) -> NaturalModes:
    """Return all modes below a frequency, at least one.

    How many there are is known beforehand: as many as K - w^2 M has negative pivots (Sylvester's
    law of inertia).

    Args:
        factorization: of K at theta, where there is one.

    Raises:
        StructureError: the structure is a mechanism, or the modes cannot be counted.
    """
    _check_request(_massive(operators), 1, None)
    stiffness = operators.stiffness(theta)
    factors = factorization or factorize_held(operators, stiffness)
    problem = _Problem(stiffness, operators.mass, factors, 0.0)
    for nudge in (1.0, 1.003, 1.01):  # beside a natural frequency the pivots have no sure sign
        shift = (2.0 * np.pi * top_hz * nudge) ** 2
        count = _count_negative((stiffness - shift * operators.mass).tocsc(), factors.order())
        if count is not None:
            return _lowest(operators, problem, max(1, count), shift if count else np.inf)
    raise StructureError(
        f"the modes below {top_hz:g} Hz cannot be counted; choose a slightly different frequency"
    )


def _check_request(massive: int, count: int, shift_hz: float | None) -> None:
    if not massive:
        raise StructureError(
            "no free degree of freedom carries mass; give densities or point masses"
        )
    if not 1 <= count <= massive:
        raise StructureError(
            f"{count} modes were asked for, but {massive} free degrees of freedom carry mass; "
            f"ask for 1 to {massive}"
        )
    if shift_hz is not None and not shift_hz < 0.0:
        raise StructureError(f"shift_hz is {shift_hz}; give a negative frequency, or None")


def _condensed(problem: _Problem, count: int) -> tuple[Floats, Floats]:
    """Modes by R^T K^-1 R, M = R R^T, where few degrees of freedom carry mass."""
    massive = np.flatnonzero(problem.mass.diagonal() > 0.0)
    masses, directions = eigh(problem.mass[massive][:, massive].toarray())
    root = np.zeros((problem.mass.shape[0], len(massive)))
    root[massive] = directions * np.sqrt(np.maximum(masses, 0.0))
    flexible = problem.factorization.apply(root)
    flexibility = root.T @ flexible
    inverse, coordinates = eigh(0.5 * (flexibility + flexibility.T))
    inverse, coordinates = inverse[::-1][:count], coordinates[:, ::-1][:, :count]
    if not inverse[-1] > 1e-14 * inverse[0]:
        raise StructureError(
            f"{count} modes were asked for, but fewer motions carry mass; ask for fewer"
        )
    return problem.shift + 1.0 / inverse, flexible @ coordinates


def _lanczos(problem: _Problem, count: int, width: int) -> tuple[Floats, Floats] | None:
    """Block Lanczos method that keeps all vectors (Golub and Underwood 1977)."""
    mass, apply = problem.mass, problem.factorization.apply
    weigh = partial(symmetric_times, mass)
    size, most, look = mass.shape[0], 10 * (count + 2 * width), 1.4 * count
    basis, small, done = np.empty((size, most), order="F"), np.zeros((most, most)), 0
    start = np.random.default_rng(20240).standard_normal((size, width))
    before, (block, image) = start[:, :0], orthonormal(apply(mass @ start), start[:, :0], weigh)
    while len(block.T) and done + len(block.T) <= most:
        new = slice(done, done + len(block.T))
        basis[:, new], ahead = block, apply(image)
        small[new, new], small[done - len(before.T) : done, new] = image.T @ ahead, before.T @ ahead
        before, done = image, new.stop
        block, image = orthonormal(ahead, basis[:, :done], weigh)
        if done < count or (done < look and len(block.T)):
            continue
        inverse, inside = eigh(small[:done, :done], lower=False)
        largest = np.argsort(-np.abs(inverse), kind="stable")[:count]
        inverse, inside = inverse[largest], inside[:, largest]
        # One step of inverse iteration goes beyond the basis (Ericsson and Ruhe 1980).
        rest = image.T @ ahead @ inside[new] / inverse
        if np.linalg.norm(rest, axis=0).max() <= 1e-8:
            values = problem.shift + 1.0 / inverse
            order = np.argsort(values, kind="stable")
            return values[order], (combined(basis[:, :done], inside) + block @ rest)[:, order]
        look = 1.05 * done
    return None


def _complete(problem: _Problem, values: Floats) -> bool:
    """Whether as many eigenvalues lie below the highest gap as were found below it."""
    edges = np.concatenate([[problem.shift], values])
    gaps = np.diff(edges) / (values - problem.shift)
    # Pivots are counted between eigenvalues that lie so far apart.
    clear = np.flatnonzero(gaps >= 1e-3)  # the highest gap leaves least unseen above it
    top = int(clear[-1]) if len(clear) else int(gaps.argmax())
    # Nearer to an eigenvalue the signs of the pivots are not certain.
    if gaps[top] < 1e-4:
        top = 0
    between = 0.5 * (edges[top] + edges[top + 1])
    shifted = (problem.stiffness - between * problem.mass).tocsc()
    below = _count_negative(shifted, problem.factorization.order())
    return below is None or below == top


def _count_negative(matrix: csc_matrix, order: Integers | None) -> int | None:
    """Number of negative eigenvalues, None where the pivots do not show it."""
    if order is not None:
        matrix = matrix[order][:, order].tocsc()
    pivots = factorize(matrix, ordered=order is not None).pivots()
    return None if pivots is None else int(np.count_nonzero(pivots < 0.0))


def _modes(problem: _Problem, values: Floats, shapes: Floats) -> NaturalModes:
    image = symmetric_times(problem.mass, shapes)
    norm = np.sqrt(np.einsum("ij,ij->j", shapes, image))
    magnitude = np.abs(shapes)
    # Of components as close as this to the largest, the first decides the sign.
    largest = (magnitude >= (1.0 - 1e-6) * magnitude.max(axis=0)).argmax(axis=0)
    sign = np.sign(shapes[largest, np.arange(len(values))])
    return NaturalModes(np.sqrt(np.maximum(values, 0.0)) / (2.0 * np.pi), shapes * (sign / norm))
