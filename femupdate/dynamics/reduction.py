"""Reduced models that keep K affine in theta and follow the FRFs over the whole prior box.

Most modes of a building with slabs are vertical slab modes that a horizontal base motion hardly
drives. The basis is therefore taken from responses: at samples of theta the response of the whole
structure to the base motion, and to a force at each observed floor (the dual problem: a Galerkin
FRF errs by the product of the two errors), over the whole frequency grid, each frequency weighted
by how small the response of the floors is there, since it is the logarithm that must be right.
The responses are compressed by their weighted Gram matrix (proper orthogonal decomposition).
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np
from scipy.linalg import eigh, solve_triangular
from scipy.stats import qmc

from femupdate.arrays import Floats, Integers
from femupdate.dynamics.full_response import (
    FloorModes,
    FloorSensors,
    FullModes,
    floor_sensors,
    full_modes,
    superposition_log_frf,
)
from femupdate.dynamics.reduced import ReducedModel
from femupdate.errors import ModelError
from femupdate.fe.assembly import AffineOperators
from femupdate.fe.model import DOF_PER_NODE
from femupdate.processors import everywhere
from femupdate.progress import SILENT, Progress

TOP = 1.3  # times the top of the grid: modes that shapes are taken from
_SIZES = (40, 60, 80, 100, 120, 140, 160, 180, 200, 230, 260, 300)
_CHOOSE = 4  # unseen theta by which the number of shapes is chosen
_CERTIFY = 29  # others by which the choice is judged: 90 % of the box with a confidence of 95 %
_ROUNDS = 3
_JOIN = 8  # of them whose responses join the basis where it fails
CONFIDENCE = 0.95
STATIC_WEIGHT = 1e-2  # of the static response among the snapshots
T = TypeVar("T")
Snapshots = Callable[[AffineOperators, FloorSensors, Floats, "ReductionTarget"], Floats]


@dataclass(frozen=True)
class ReductionTarget:
    """What the reduced model must reproduce.

    Attributes:
        lower, upper: (p,) prior box of theta.
        frequency_hz: (k,) grid.
        zeta: lowest damping ratio of interest, the hardest.
        tolerance: rms difference of ln|H| allowed, over floors, grid and unseen theta.
        samples: parameter samples that the basis is taken from.
        seed: of samples and checks.
    """

    lower: Floats
    upper: Floats
    frequency_hz: Floats
    zeta: float
    tolerance: float
    samples: int = 48
    seed: int = 0


@dataclass(frozen=True)
class Reduction:
    """A reduced model and how well it does at parameters that its basis has not seen.

    The theta of the checks were drawn evenly from the box after the number of shapes was chosen,
    and the full model was solved at each.

    Attributes:
        model: the reduced model.
        rms_error: rms difference of ln|H| at the lowest damping, over all checks.
        largest_error: largest difference of ln|H| at the lowest damping, anywhere.
        checks: number of parameter vectors checked; 0 for what is its own reduction.
        worst_error: rms difference of ln|H| over floors and grid at the worst of them.
    """

    model: ReducedModel
    rms_error: float
    largest_error: float
    checks: int
    worst_error: float = 0.0

    @property
    def share(self) -> float:
        """Share of the box that is no worse than `worst_error`, with a confidence of 95 %.

        Were the share smaller, n independent draws would all lie in it with a probability below
        share^n = 5 % (Wilks 1941); nothing is assumed of how the errors are distributed.
        """
        return float((1.0 - CONFIDENCE) ** (1.0 / self.checks)) if self.checks else 1.0


def reduce_operators(
    operators: AffineOperators,
    floor_nodes: Mapping[str, Integers],
    story_levels: Floats,
    direction: int,
    target: ReductionTarget,
    progress: Progress = SILENT,
) -> Reduction:
    """Reduce a frame's operators; see the module's text for how.

    Args:
        operators: of the full model.
        floor_nodes: sensor nodes of every observed floor, bottom to top.
        story_levels: (s + 1,) heights of the base and of every floor, m.
        direction: 0 for motion along x, 1 along y.
        target: what must be met.
        progress: advances by one a full eigenproblem.

    Raises:
        ModelError: no basis of up to 300 shapes meets the tolerance.
    """
    sensors = floor_sensors(operators, floor_nodes, direction)
    rng = np.random.default_rng(target.seed + 1)
    thetas = _samples(target)
    progress.start("Reducing the model", len(thetas) + _CHOOSE + _CERTIFY)

    def fit(size: int) -> ReducedModel:
        return project(operators, basis[:, :size], floor_nodes, story_levels, sensors)

    shapes = list(_everywhere(response_shapes, operators, sensors, thetas, target, progress))
    least = 0
    for last in (*[False] * (_ROUNDS - 1), True):
        basis = _compress(operators, np.concatenate(shapes, axis=1), _SIZES[-1])
        unseen = _unseen(target, rng, _CHOOSE + _CERTIFY)
        full = list(_everywhere(_reference, operators, sensors, unseen, target, progress))
        model = _smallest(fit, basis.shape[1], least, unseen[:_CHOOSE], full[:_CHOOSE], target)
        errors = _log_errors(model, unseen[_CHOOSE:], full[_CHOOSE:], target)
        each = np.sqrt((errors**2).mean(axis=(1, 2)))
        rms = float(np.sqrt((each**2).mean()))
        if rms <= target.tolerance:
            largest = float(np.abs(errors).max())
            return Reduction(model, rms, largest, len(each), float(each.max()))
        if last:
            break
        least = model.size + 1
        worst = unseen[_CHOOSE:][np.argsort(each)[-_JOIN:]]
        progress.start("Reducing the model, on more samples", len(worst) + _CHOOSE + _CERTIFY)
        shapes += _everywhere(response_shapes, operators, sensors, worst, target, progress)
    raise ModelError(
        f"a reduced model of {model.size} shapes still differs from the full one by {rms:.2g} rms "
        f"in ln|H|, more than the tolerance {target.tolerance:g}; raise reduction.tolerance or "
        "lower the top of the frequency grid"
    )


def _smallest(
    fit: Callable[[int], ReducedModel],
    most: int,
    least: int,
    thetas: Floats,
    full: list[FloorModes],
    target: ReductionTarget,
) -> ReducedModel:
    """The smallest model from `least` shapes up that a few theta do not object to, or the largest.

    A few checks see half as much as many do (50 theta: 1.5 times the rms of four).
    """
    for size in (s for s in _SIZES if least <= s < most):
        model = fit(size)
        errors = _log_errors(model, thetas, full, target)
        if np.sqrt((errors**2).mean()) <= 0.5 * target.tolerance:
            return model
    return fit(most)


def response_basis(
    operators: AffineOperators,
    sensors: FloorSensors,
    thetas: Floats,
    target: ReductionTarget,
    progress: Progress = SILENT,
    *,
    task: "Snapshots | None" = None,
    size: int = _SIZES[-1],
) -> Floats:
    """M-orthonormal basis (n_free, r) of the responses at thetas (n, p), best first.

    Args:
        operators: of the full model.
        sensors: what drives it and where it is seen.
        thetas: stiffness factors, one a term of the operators, or what `task` takes.
        target: grid and damping.
        progress: advances by one a full eigenproblem.
        task: makes the shapes at one theta; `response_shapes` where None.
        size: largest r.
    """
    solved = _everywhere(task or response_shapes, operators, sensors, thetas, target, progress)
    shapes = list(solved)
    return _compress(operators, np.concatenate(shapes, axis=1), size)


def reduce_lumped(stiffness_terms: Floats, mass: Floats, floors: tuple[str, ...]) -> ReducedModel:
    """A shear building as a reduced model; nothing is left out.

    Args:
        stiffness_terms: (p, n, n), N/m, in displacements relative to the base.
        mass: (n, n) diagonal, kg.
        floors: n names, bottom to top.
    """
    masses = np.diag(mass)
    basis = np.diag(masses**-0.5)
    count = len(masses)
    above = np.triu(np.ones((count, count)))  # row i: floors above story i
    drift = np.eye(count) - np.eye(count, k=-1)
    return ReducedModel(
        stiffness_terms=basis.T @ stiffness_terms @ basis,
        stiffness_constant=np.zeros((count, count)),
        excitation=basis.T @ masses,
        floor_shapes=basis.copy(),
        floors=floors,
        story_inertia=(above * masses) @ basis,
        story_mass=above @ masses,
        story_drift=drift @ basis,
    )


def _everywhere(
    task: Callable[[AffineOperators, FloorSensors, Floats, ReductionTarget], T],
    operators: AffineOperators,
    sensors: FloorSensors,
    thetas: Floats,
    target: ReductionTarget,
    progress: Progress,
) -> Iterator[T]:
    """Do one thing at every theta, on all processors, in order."""
    job = partial(_at_theta, task, operators, sensors, target)
    for result in everywhere(job, list(thetas), operators.mass.shape[0]):
        progress.advance()
        yield result


def _at_theta(
    task: Callable[[AffineOperators, FloorSensors, Floats, ReductionTarget], T],
    operators: AffineOperators,
    sensors: FloorSensors,
    target: ReductionTarget,
    theta: Floats,
) -> T:
    return task(operators, sensors, theta, target)


def _reference(
    operators: AffineOperators, sensors: FloorSensors, theta: Floats, target: ReductionTarget
) -> FloorModes:
    """What the reduced model is compared with at one theta."""
    # Eight terms leave (1 / 1.8)^16 of the static share of the modes above; their damping, which
    # the series has not, matters where a zero of H lies near the top: nearer tops show it.
    top = 1.8 * float(target.frequency_hz[-1])
    return full_modes(operators, sensors, theta, top, terms=8).felt


def _samples(target: ReductionTarget) -> Floats:
    """Parameter vectors (n, p) for the basis.

    Soft stories have most modes below the top of the grid: the basis samples theta evenly in its
    logarithm.
    """
    low, high = np.log(target.lower), np.log(target.upper)
    sobol = qmc.Sobol(len(target.lower), seed=np.random.default_rng(target.seed))
    # The sequence is balanced over powers of two only.
    power = max(target.samples - 1, 0).bit_length()
    return np.exp(low + (high - low) * sobol.random_base2(power)[: target.samples])


def _unseen(target: ReductionTarget, rng: np.random.Generator, count: int) -> Floats:
    """Parameter vectors (n, p) for checks, even over the box."""
    return target.lower + (target.upper - target.lower) * rng.random((count, len(target.lower)))


def response_shapes(
    operators: AffineOperators, sensors: FloorSensors, theta: Floats, target: ReductionTarget
) -> Floats:
    """Weighted shapes (n_free, c) that span the responses at one theta over the grid."""
    modes = full_modes(operators, sensors, theta, TOP * float(target.frequency_hz[-1]))
    return snapshots(modes, target)


def snapshots(modes: FullModes, target: ReductionTarget) -> Floats:
    """Weighted shapes (n_free, c) that span the responses of these modes over the grid."""
    combined = combinations(modes.felt, modes.participation, modes.floors, target)
    return np.column_stack([modes.shapes @ combined, STATIC_WEIGHT * modes.static])


def combinations(
    felt: FloorModes,
    participation: Floats,
    floors: Floats,
    target: ReductionTarget,
    least: float = 1e-9,
) -> Floats:
    """Weighted combinations (m, c) of modes that span their responses over the grid.

    Args:
        felt: the modes as the floors feel them.
        participation: (m,) participation factors.
        floors: (f, m) floor shapes.
        target: grid and damping.
        least: energy of a combination, of the largest, that is kept.
    """
    omega = felt.omega[:, None]
    grid = target.frequency_hz[::2]
    w = 2.0 * np.pi * grid
    size = np.exp(felt.log_frf(grid, target.zeta)).clip(1e-3)
    response = 1.0 / (omega**2 - w**2 + 2j * target.zeta * omega * w)
    primal = participation[:, None] * response * (w**2 / size.min(axis=0))
    # Duals matter less than the motion itself: a twentieth of its weight was best of those tried.
    dual = [
        0.05**0.5 * shape[:, None] * response * (w**2 / one)
        for shape, one in zip(floors, size, strict=True)
    ]
    gram = sum((c @ c.conj().T).real for c in (primal, *dual))
    energy, directions = eigh(gram)
    kept = energy > least * energy[-1]
    return directions[:, kept] * np.sqrt(energy[kept] / energy[-1])


def _compress(operators: AffineOperators, snapshots: Floats, size: int) -> Floats:
    """M-orthonormal basis (n_free, r) of the snapshots, most energetic first."""
    gram = snapshots.T @ (operators.mass @ snapshots)
    energy, directions = eigh(gram)
    kept = np.flatnonzero(energy > 1e-14 * energy[-1])[::-1][:size]
    basis = snapshots @ (directions[:, kept] / np.sqrt(energy[kept]))
    # Once more: the energies span many decades and the first pass loses orthogonality with them.
    factor = np.linalg.cholesky(basis.T @ (operators.mass @ basis))
    return solve_triangular(factor, basis.T, lower=True).T


def project(
    operators: AffineOperators,
    basis: Floats,
    floor_nodes: Mapping[str, Integers],
    story_levels: Floats,
    sensors: FloorSensors,
) -> ReducedModel:
    """The reduced model on a mass-orthonormal basis (n_free, r)."""

    def onto(matrix: object) -> Floats:
        projected = basis.T @ (matrix @ basis)  # type: ignore[operator]
        return 0.5 * (projected + projected.T)

    floor_shapes = sensors.rows @ basis
    story_inertia, story_mass = _above(operators, basis, story_levels, sensors.direction)
    full = operators.expand(basis).reshape(-1, DOF_PER_NODE, basis.shape[1])
    return ReducedModel(
        stiffness_terms=np.stack([onto(term) for term in operators.stiffness_terms]),
        stiffness_constant=onto(operators.stiffness_constant),
        excitation=basis.T @ sensors.excitation,
        floor_shapes=floor_shapes,
        floors=tuple(floor_nodes),
        story_inertia=story_inertia,
        story_mass=story_mass,
        story_drift=np.diff(floor_shapes, axis=0, prepend=np.zeros((1, basis.shape[1]))),
        node_shapes=full[:, :3].astype(np.float32),
    )


def _above(
    operators: AffineOperators, basis: Floats, story_levels: Floats, direction: int
) -> tuple[Floats, Floats]:
    """Inertia rows (s, r) and masses (s,) of what lies above the middle of each story."""
    low, high = story_levels[:-1, None], story_levels[1:, None]
    above = operators.nodes[:, 2] - 0.5 * (low + high)
    # A node at mid-height carries as much from above as from below: rounding must not decide.
    at_middle = np.abs(above) < 1e-6 * (high - low)
    selector = np.zeros((len(above), operators.dof))
    selector[:, direction::DOF_PER_NODE] = np.where(at_middle, 0.5, above > 0.0)
    weighted = (operators.mass_full @ selector.T).T
    everything = operators.rigid_translation(direction)
    return weighted @ operators.expand(basis), weighted @ everything


def _log_errors(
    model: ReducedModel, thetas: Floats, full: list[FloorModes], target: ReductionTarget
) -> Floats:
    """Reduced less full ln|H| (n, f, k) at the lowest damping, one a theta."""
    squared, vectors = np.linalg.eigh(model.stiffness(thetas))
    nothing = np.zeros((len(model.floors), 0))
    errors = []
    for one, shapes, found in zip(squared, vectors, full, strict=True):
        effect = (model.floor_shapes @ shapes) * (shapes.T @ model.excitation)
        ours = superposition_log_frf(
            np.sqrt(one), effect, nothing, target.frequency_hz, target.zeta
        )
        errors.append(ours - found.log_frf(target.frequency_hz, target.zeta))
    return np.stack(errors)
