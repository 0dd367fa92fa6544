"""What a coarse mesh makes too stiff, learned from a finer one of the same building.

A coarse mesh does to ln|H| what stiffer members do: factors on the members of each kind and story
that make the coarse model respond like the finer one are found at some theta of the prior. Their
mean, carried on towards an infinitely fine mesh (Richardson 1911), corrects the model; how they
scatter from theta to theta is what the correction leaves open: errors that all points share. They
widen the intervals and weaken the evidence for whatever they could pass for, or else the finder
would name effects that only make up for a mesh.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from femupdate.discrepancy.fit import Fit
from femupdate.discrepancy.problem import Problem
from femupdate.dynamics.damping import ConstantDamping
from femupdate.dynamics.effect_reduction import structure_on
from femupdate.dynamics.effect_response import EffectSystem, ReducedStructure
from femupdate.effects.effect import Placed
from femupdate.effects.registry import CATALOGUE
from femupdate.effects.structure import TRANSLATION, Structure
from femupdate.fe.driven import driven_shapes
from femupdate.fe.factorization import factorize

Floats = NDArray[np.float64]
FINER = 2.0 / 3.0  # mesh size of the finer mesh, of the model's own
# The mean error is between what the finer mesh shows and Richardson's limit, which for errors of
# second order is 9/5 of it: the middle, and 0.6 of the distance to both sides as its deviation.
_SHARE, _SHARE_SD = 1.4, 0.25
_MEMBERS = (
    "wall_stiffness",
    "slab_participation",
    "flexible_diaphragm",
    "cracked_beams",
    "cracked_columns",
)
_DAMPING = 0.05  # wide peaks: a shift of frequency shows in proportion
_STEP = 0.02
_WIDE = 0.1  # prior standard deviation of the mean factors
_ROUNDS = 100
_ALIKE = 30.0  # numbers of a theta that err alike: neighbours, floors, amplitude and phase


@dataclass(frozen=True)
class MeshError:
    """Changes of stiffness that stand for refining a mesh.

    Attributes:
        labels: (q,) of the effects that change the members of one kind in one story.
        mean: (q,) what the finer mesh does, as sizes of those effects.
        sd: (q,) scatter of it from theta to theta.
        left: rms of ln|H| that no such change follows.
    """

    labels: tuple[str, ...]
    mean: tuple[float, ...]
    sd: tuple[float, ...]
    left: float

    @property
    def placed(self) -> tuple[Placed, ...]:
        """The effects."""
        parts = (label.split("@") for label in self.labels)
        return tuple(Placed(CATALOGUE[name], place) for name, place in parts)


@dataclass(frozen=True, eq=False)
class _Lesson:
    """One theta: sums of products of the change by each factor (n, q) and of what is sought (n,).

    Attributes:
        normal: (q, q).
        right: (q,).
        square: of what is sought.
        points: n.
    """

    normal: Floats
    right: Floats
    square: float
    points: int


def learn_mesh_error(
    fine: Structure,
    near: Callable[[Floats], ReducedStructure],
    thetas: Floats,
    frequency_hz: Floats,
    progress: Callable[[int, int], None] | None = None,
) -> MeshError:
    """Compare a model with that of a finer mesh.

    Args:
        fine: the building on the finer mesh.
        near: the model on a basis for the neighbourhood of a theta.
        thetas: (n, p) at which they are compared.
        frequency_hz: (k,) where.
        progress: told (done, total).
    """
    placed = _members(fine)
    lessons = []
    for number, theta in enumerate(thetas):
        lessons.append(_lesson(fine, near(theta), placed, theta, frequency_hz))
        if progress is not None:
            progress(number + 1, len(thetas))
    kinds = [one.effect.name for one in placed]
    mean, sd, left = _estimate(lessons, kinds)
    labels = tuple(one.label for one in placed)
    return MeshError(labels, tuple(mean.tolist()), tuple(sd.tolist()), left)


def corrected(reduced: ReducedStructure, mesh: MeshError) -> ReducedStructure:
    """The reduced structure with the stiffness that a fine mesh would give it."""
    terms = reduced.model.stiffness_terms.copy()
    for placed, value in zip(mesh.placed, mesh.mean, strict=True):
        for story, matrix in reduced.terms(placed).stiffness:
            terms[story] += _SHARE * value * matrix.numpy()
    return replace(reduced, model=replace(reduced.model, stiffness_terms=terms))


def with_mesh_error(problem: Problem, mesh: MeshError, base: Fit) -> Problem:
    """The problem with what the correction leaves open as errors that its residuals share.

    Args:
        problem: of the corrected model.
        mesh: the error.
        base: fit about which it is linear.
    """
    system = problem.system((*base.placed, *mesh.placed))
    steps = np.vstack([np.zeros(len(mesh.mean)), np.diag(mesh.sd)])
    steps = np.vstack([steps, _SHARE_SD * np.asarray(mesh.mean)])
    count = len(steps)
    theta, zeta, known = base.coordinates.split(base.z.expand(count, -1), problem.fixed_zeta)
    sizes = torch.cat([known, torch.from_numpy(steps)], dim=1)
    residual = problem.residuals(system, theta, zeta, sizes)
    return replace(problem, shared=(residual[1:] - residual[0]).T)


def _members(structure: Structure) -> tuple[Placed, ...]:
    """The effects on the members of one kind in one story."""
    names = structure.building.story_names
    effects = [CATALOGUE[name] for name in _MEMBERS]
    return tuple(
        Placed(effect, place)
        for effect in effects
        for place in effect.places(structure)
        if place in names
    )


def _lesson(
    fine: Structure,
    coarse: ReducedStructure,
    placed: tuple[Placed, ...],
    theta: Floats,
    frequency_hz: Floats,
) -> _Lesson:
    top = float(frequency_hz[-1])
    force = fine.rigid_force[:, [TRANSLATION]]
    factors = factorize(fine.stiffness(theta))
    found = driven_shapes(factors, fine.mass, force, fine.floor_rows, top)
    truth = _log_frf(structure_on(fine, found.shapes), (), theta, np.zeros((1, 0)), frequency_hz)[0]
    steps = np.vstack([np.zeros(len(placed)), _STEP * np.eye(len(placed))])
    ours = _log_frf(coarse, placed, theta, steps, frequency_hz)
    change = ours[1:] - ours[0]
    sought = truth - ours[0]
    slope = _real(change).T / _STEP
    right = _real(sought[None])[0]
    return _Lesson(slope.T @ slope, slope.T @ right, float(right @ right), len(right))


def _log_frf(
    reduced: ReducedStructure,
    placed: tuple[Placed, ...],
    theta: Floats,
    sizes: Floats,
    frequency_hz: Floats,
) -> NDArray[np.complex128]:
    """ln H (N, n), floors one after the other, of a structure with effects of some sizes (N, q)."""
    terms = tuple(reduced.terms(one) for one in placed)
    system = EffectSystem(reduced, ConstantDamping(), placed, terms)
    frf = system.frf(
        torch.from_numpy(np.tile(theta, (len(sizes), 1))),
        torch.full((len(sizes),), _DAMPING, dtype=torch.float64),
        torch.from_numpy(sizes),
        torch.from_numpy(frequency_hz),
    )
    return np.asarray(frf.log().flatten(1).numpy())


def _real(values: NDArray[np.complex128]) -> Floats:
    """Amplitude and phase (N, 2 n) of logarithms (N, n); a phase is within half a turn."""
    turn = np.remainder(values.imag + np.pi, 2.0 * np.pi) - np.pi
    return np.concatenate([values.real, turn], axis=1)


def _estimate(lessons: list[_Lesson], kinds: list[str]) -> tuple[Floats, Floats, float]:
    """Mean factors (q,) and their scatter (q,), alike within a kind, and the rms that is left.

    Factors are normal about their mean; mean, scatter and noise by the EM method (Laird and Ware,
    Biometrics 38, 1982).
    """
    size, groups = len(kinds), np.unique(kinds, return_inverse=True)[1]
    member = np.eye(groups.max() + 1)[groups]  # (q, kinds)
    variance, noise = np.full(size, 0.01**2), 0.01**2
    points = sum(one.points for one in lessons)
    for _ in range(_ROUNDS):
        each = _ALIKE * noise
        inside = [np.linalg.inv(one.normal / each + np.diag(1.0 / variance)) for one in lessons]
        normal, right = np.eye(member.shape[1]) / _WIDE**2, np.zeros(member.shape[1])
        for one, own in zip(lessons, inside, strict=True):
            weight = np.eye(size) - one.normal @ own / each
            normal += member.T @ weight @ one.normal @ member / each
            right += member.T @ weight @ one.right / each
        mean = member @ np.linalg.solve(normal, right)
        spread, squares = np.zeros(size), np.zeros(())
        for one, own in zip(lessons, inside, strict=True):
            deviation = own @ (one.right - one.normal @ mean) / each
            spread += deviation**2 + own.diagonal()
            total = mean + deviation
            left = one.square - 2.0 * total @ one.right + total @ one.normal @ total
            squares = squares + left + np.trace(own @ one.normal)
        alike = np.bincount(groups, spread) / np.bincount(groups) / len(lessons)
        variance, noise = alike[groups], max(float(squares) / points, 1e-8)
    return mean, np.sqrt(variance), float(np.sqrt(noise))


__all__ = ["FINER", "MeshError", "corrected", "learn_mesh_error", "with_mesh_error"]
