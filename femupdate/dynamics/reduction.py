"""Reduced models that keep K affine in theta and follow the FRFs over the whole prior box.

Most modes of a building with slabs are vertical slab modes that a horizontal base motion hardly
drives. The basis is therefore taken from responses: at samples of theta the response of the whole
structure to the base motion, and to a force at each observed floor (the dual problem: a Galerkin
FRF errs by the product of the two errors), over the whole frequency grid, each frequency weighted
by how small the response of the floors is there, since it is the logarithm that must be right.
The responses are compressed by their weighted Gram matrix (proper orthogonal decomposition).
"""

import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.stats import qmc

from femupdate.dynamics.reduced import ReducedModel
from femupdate.errors import ModelError
from femupdate.fe.assembly import AffineOperators
from femupdate.fe.model import DOF_PER_NODE
from femupdate.fe.solve import Modes, lowest_modes, static_displacement

Floats = NDArray[np.float64]
_SIZES = (40, 60, 80, 100, 120, 140, 160, 180, 200, 230, 260, 300)
_CHECKS = 6


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
    samples: int = 64
    seed: int = 0


@dataclass(frozen=True)
class Reduction:
    """A reduced model and how well it does at parameters that its basis has not seen.

    Attributes:
        model: the reduced model.
        rms_error: rms difference of ln|H| at the lowest damping.
        largest_error: largest difference of ln|H| at the lowest damping.
        checks: number of parameter vectors checked.
    """

    model: ReducedModel
    rms_error: float
    largest_error: float
    checks: int


@dataclass(frozen=True)
class _Reference:
    """The full model's response at one theta."""

    theta: Floats
    omega: Floats
    effect: Floats  # (f, m)
    static: Floats  # (f,) displacement of the floors that the modes kept miss, s2


@dataclass(frozen=True)
class _Sensors:
    """Rows (f, n_free) that average the sensor points of each floor, and the base's force."""

    rows: Floats
    excitation: Floats
    direction: int


def reduce_operators(
    operators: AffineOperators,
    floor_nodes: Mapping[str, NDArray[np.int64]],
    story_levels: Floats,
    direction: int,
    target: ReductionTarget,
    progress: Callable[[int, int], None] | None = None,
) -> Reduction:
    """Reduce a frame's operators; see the module's text for how.

    Args:
        operators: of the full model.
        floor_nodes: sensor nodes of every observed floor, bottom to top.
        story_levels: (s + 1,) heights of the base and of every floor, m.
        direction: 0 for motion along x, 1 along y.
        target: what must be met.
        progress: called with (done, total) full eigenproblems.

    Raises:
        ModelError: no basis of up to 300 shapes meets the tolerance.
    """
    sensors = _sensors(operators, floor_nodes, direction)
    box = np.log(target.lower), np.log(target.upper)
    sobol = qmc.Sobol(len(target.lower), seed=np.random.default_rng(target.seed))
    # Soft stories have most modes below the top of the grid: sample theta evenly in its logarithm.
    thetas = np.exp(box[0] + (box[1] - box[0]) * sobol.random(target.samples))
    rng = np.random.default_rng(target.seed + 1)
    unseen = target.lower + (target.upper - target.lower) * rng.random((_CHECKS, thetas.shape[1]))
    total, done = target.samples + _CHECKS, 0

    def tick() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, total)

    def snapshot(theta: Floats) -> Floats:
        shapes = _snapshots(operators, sensors, theta, target)
        tick()
        return shapes

    def reference(theta: Floats) -> _Reference:
        found = _reference(operators, sensors, theta, target)
        tick()
        return found

    with ThreadPoolExecutor(max_workers=max(1, len(os.sched_getaffinity(0)))) as pool:
        snapshots = np.concatenate(list(pool.map(snapshot, thetas)), axis=1)
        references = list(pool.map(reference, unseen))
    basis, energy = _compress(operators, snapshots)
    for size in (*(s for s in _SIZES if s < len(energy)), len(energy)):
        if size > _SIZES[-1]:
            break
        model = _project(operators, basis[:, :size], floor_nodes, story_levels, sensors)
        errors = np.stack([_log_error(model, found, target) for found in references])
        rms = float(np.sqrt((errors**2).mean()))
        if rms <= 0.75 * target.tolerance:
            return Reduction(model, rms, float(np.abs(errors).max()), _CHECKS)
    raise ModelError(
        f"a reduced model of {min(len(energy), _SIZES[-1])} shapes still differs from the full one "
        f"by {rms:.2g} rms in ln|H|, more than the tolerance {target.tolerance:g}; raise "
        "reduction.tolerance or lower the top of the frequency grid"
    )


def reduce_lumped(
    stiffness_terms: Floats, mass: Floats, floors: tuple[str, ...]
) -> ReducedModel:
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


def superposition_log_frf(
    omega: Floats, effect: Floats, static: Floats, frequency_hz: Floats, zeta: float
) -> Floats:
    """ln|H| (f, k) from the modes of one model, with a static correction for those left out.

    Args:
        omega: (m,) rad/s.
        effect: (f, m) floor shape times participation factor.
        static: (f,) displacement under unit base acceleration that the modes miss, s2.
        frequency_hz: (k,).
        zeta: damping ratio of all modes.
    """
    w = 2.0 * np.pi * frequency_hz
    flexibility = omega[:, None] ** 2 - w**2 + 2j * zeta * omega[:, None] * w
    response = 1.0 + effect @ (w**2 / flexibility) + static[:, None] * w**2
    return np.log(np.abs(response))


def _sensors(
    operators: AffineOperators, floor_nodes: Mapping[str, NDArray[np.int64]], direction: int
) -> _Sensors:
    rows = np.zeros((len(floor_nodes), operators.dof))
    for row, nodes in zip(rows, floor_nodes.values(), strict=True):
        row[DOF_PER_NODE * np.asarray(nodes) + direction] = 1.0 / len(nodes)
    return _Sensors(rows[:, operators.free], operators.inertia(direction), direction)


def _modes_below(operators: AffineOperators, theta: Floats, top_hz: float) -> Modes:
    """All modes up to a frequency: ask for more until the last one lies above it."""
    count = min(80, len(operators.free) - 1)
    while True:
        modes = lowest_modes(operators, theta, count)
        if modes.frequency_hz[-1] >= top_hz or count >= len(operators.free) - 1:
            return modes
        growth = (top_hz / modes.frequency_hz[-1]) ** 1.2
        count = min(int(count * min(max(1.15 * growth, 1.25), 4.0)), len(operators.free) - 1)


def _static(
    operators: AffineOperators, sensors: _Sensors, theta: Floats, modes: Modes
) -> tuple[Floats, Floats]:
    """Static response to the base motion (n_free,), and what the modes miss at the floors."""
    load = np.zeros(operators.dof)
    load[operators.free] = sensors.excitation
    displacement = static_displacement(operators, theta, load)[operators.free]
    omega_squared = (2.0 * np.pi * modes.frequency_hz) ** 2
    in_modes = modes.shapes @ ((modes.shapes.T @ sensors.excitation) / omega_squared)
    return displacement, sensors.rows @ (displacement - in_modes)


def _snapshots(
    operators: AffineOperators, sensors: _Sensors, theta: Floats, target: ReductionTarget
) -> Floats:
    """Weighted shapes (n_free, c) that span the responses at one theta over the grid."""
    top = float(target.frequency_hz[-1])
    modes = _modes_below(operators, theta, 1.5 * top)
    omega = 2.0 * np.pi * modes.frequency_hz
    participation = modes.shapes.T @ sensors.excitation
    floors = sensors.rows @ modes.shapes
    static, missed = _static(operators, sensors, theta, modes)
    grid = target.frequency_hz[::2]
    w = 2.0 * np.pi * grid
    size = np.exp(
        superposition_log_frf(omega, floors * participation, missed, grid, target.zeta)
    ).clip(1e-3)
    response = 1.0 / (omega[:, None] ** 2 - w**2 + 2j * target.zeta * omega[:, None] * w)
    primal = participation[:, None] * response * (w**2 / size.min(axis=0))
    # Duals matter less than the motion itself: a twentieth of its weight was best of those tried.
    dual = [0.05**0.5 * shape[:, None] * response * (w**2 / one) for shape, one in zip(
        floors, size, strict=True)]
    gram = sum((c @ c.conj().T).real for c in (primal, *dual))
    energy, directions = np.linalg.eigh(gram)
    kept = energy > 1e-9 * energy[-1]
    shapes = modes.shapes @ (directions[:, kept] * np.sqrt(energy[kept] / energy[-1]))
    return np.column_stack([shapes, 1e-2 * static])


def _reference(
    operators: AffineOperators, sensors: _Sensors, theta: Floats, target: ReductionTarget
) -> _Reference:
    modes = _modes_below(operators, theta, 2.0 * float(target.frequency_hz[-1]))
    effect = (sensors.rows @ modes.shapes) * (modes.shapes.T @ sensors.excitation)
    _, missed = _static(operators, sensors, theta, modes)
    return _Reference(theta, 2.0 * np.pi * modes.frequency_hz, effect, missed)


def _compress(operators: AffineOperators, snapshots: Floats) -> tuple[Floats, Floats]:
    """M-orthonormal basis of the snapshots, most energetic first, and the energies."""
    gram = snapshots.T @ (operators.mass @ snapshots)
    energy, directions = np.linalg.eigh(gram)
    kept = np.flatnonzero(energy > 1e-14 * energy[-1])[::-1][: _SIZES[-1]]
    basis = snapshots @ (directions[:, kept] / np.sqrt(energy[kept]))
    # Once more: the energies span many decades and the first pass loses orthogonality with them.
    factor = np.linalg.cholesky(basis.T @ (operators.mass @ basis))
    return np.linalg.solve(factor, basis.T).T, energy[kept]


def _project(
    operators: AffineOperators,
    basis: Floats,
    floor_nodes: Mapping[str, NDArray[np.int64]],
    story_levels: Floats,
    sensors: _Sensors,
) -> ReducedModel:
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
    middle = 0.5 * (story_levels[1:] + story_levels[:-1])
    above = operators.nodes[:, 2] > middle[:, None]
    selector = np.zeros((len(middle), operators.dof))
    selector[:, direction::DOF_PER_NODE] = above
    weighted = (operators.mass_full @ selector.T).T
    everything = operators.rigid_translation(direction)
    return weighted[:, operators.free] @ basis, weighted @ everything


def _log_error(model: ReducedModel, found: _Reference, target: ReductionTarget) -> Floats:
    """Reduced less full ln|H| (f, k) at the lowest damping."""
    squared, vectors = torch.linalg.eigh(torch.from_numpy(model.stiffness(found.theta)))
    shapes = vectors.numpy()
    effect = (model.floor_shapes @ shapes) * (shapes.T @ model.excitation)
    omega = np.sqrt(squared.numpy())
    nothing = np.zeros(len(model.floors))
    ours = superposition_log_frf(omega, effect, nothing, target.frequency_hz, target.zeta)
    full = superposition_log_frf(
        found.omega, found.effect, found.static, target.frequency_hz, target.zeta
    )
    return ours - full
