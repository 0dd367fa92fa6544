"""The full equations of a structure with effects of given sizes, and their response.

The effects' stiffness and mass are put into the full matrices; what moves is followed by the
shapes that the forces in the changed structure drive. What effects do besides (ground, damping,
lines, instruments) is added to the response on those shapes, which is exact.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from scipy.sparse import csc_matrix

from femupdate.arrays import Floats
from femupdate.dynamics.damping import DampingLaw
from femupdate.dynamics.reduced import BaseRotation, ReducedModel, dashpots_on, reduce_terms
from femupdate.dynamics.system import System
from femupdate.effects.effect import UNSCALED, Placed, SpringTerms, Terms
from femupdate.effects.structure import ACROSS, ROTATION, TRANSLATION, Structure
from femupdate.fe.driven import Factored, driven_shapes
from femupdate.fe.factorization import factorize
from femupdate.fe.mechanism import factorize_held


@dataclass(frozen=True, eq=False)
class Equations:
    """M u'' + K u = -force y'', y = (translation, rotation, motion across) of the base."""

    stiffness: csc_matrix  # (n, n); the stiffness without the springs
    springs: SpringTerms  # between sums over many degrees of freedom
    mass: csc_matrix
    force: Floats  # (n, 3)
    rigid_mass: Floats  # (3, 3)
    story_inertia: Floats  # (s, n) and story_rigid (s, 3), as those of a `Structure`
    story_rigid: Floats


@dataclass(frozen=True, eq=False)
class WithSprings:
    """A factorised stiffness with springs, which fill no matrix (Woodbury's formula, 1950)."""

    without: Factored  # the stiffness without them
    springs: SpringTerms  # c of them

    def apply(self, rhs: Floats) -> Floats:
        """Displacement (n, m) under forces (n, m)."""
        free, rows = self.without.apply(rhs), self.springs.rows
        if not len(rows):
            return free
        given = rows @ self.moved
        held = np.linalg.solve(np.diag(1.0 / self.springs.stiffness) + given, rows @ free)
        return np.asarray(free - self.moved @ held)

    def times(self, shapes: Floats) -> Floats:
        """Forces (n, m) that hold shapes (n, m)."""
        rows = self.springs.rows
        if not len(rows):
            return self.without.times(shapes)
        pulled = rows.T @ (self.springs.stiffness[:, None] * (rows @ shapes))
        return np.asarray(self.without.times(shapes) + pulled)

    @cached_property
    def moved(self) -> Floats:
        """(n, c) displacement under unit forces along the springs."""
        return self.without.apply(np.ascontiguousarray(self.springs.rows.T))


@dataclass(frozen=True, eq=False)
class SensorRows:
    """What is observed of the full model along the motion."""

    names: tuple[str, ...]  # of the floor that each sensor stands on
    rows: Floats  # (c, n) displacement of each sensor
    levels: Floats  # (c,) heights above the base, m
    # groups of further rows (w, n) whose response must be right (see `driven_shapes`)
    watched: tuple[Floats, ...] = ()


@dataclass(frozen=True, eq=False)
class DrivenSystem:
    """The full model at one sample, on the shapes that forces drive."""

    system: System  # without stiffness factors, with what effects do beside stiffness and mass
    equations: Equations  # of the full model
    frequency_hz: Floats  # (r,) of the shapes; a natural frequency where one has converged
    shapes: Floats  # (n, r) orthonormal in the mass


def first_sizes(placed: Sequence[Placed], sizes: Floats) -> list[float]:
    """The parameter that each effect's terms scale with; one for an effect without parameters."""
    found, first = [], 0
    for listed in placed:
        count = len(listed.effect.parameters)
        found.append(float(sizes[first]) if count else 1.0)
        first += count
    return found


def equations_at(
    structure: Structure, theta: Floats, added: Sequence[tuple[Terms, float]] = ()
) -> Equations:
    """The full equations at stiffness factors theta (p,) with terms of some sizes."""
    stiffness, mass = structure.stiffness(theta), structure.mass
    force, rigid = structure.rigid_force, structure.rigid_mass
    inertia, story_rigid = structure.story_inertia, structure.story_rigid
    rows, springs = [np.zeros((0, mass.shape[0]))], [np.zeros(0)]
    for terms, size in added:
        if terms.springs is not None and size != 0.0:
            rows.append(terms.springs.rows)
            springs.append(size * terms.springs.stiffness)
        for story, matrix, series in terms.stiffness:
            factor = size / (1.0 + series * size)
            stiffness = stiffness + factor * (1.0 if story == UNSCALED else theta[story]) * matrix
        if terms.hinges is not None:
            at = torch.from_numpy(theta[None]), torch.tensor([size], dtype=torch.float64)
            stiffness = stiffness - csc_matrix(terms.hinges.softening(*at)[0].numpy())
        if terms.mass is not None:
            mass = mass + size * terms.mass.matrix
            force = force + size * terms.mass.force
            rigid = rigid + size * terms.mass.rigid
            inertia = inertia + size * terms.mass.above
            story_rigid = story_rigid + size * terms.mass.above_rigid
    between = SpringTerms(np.concatenate(rows), np.concatenate(springs))
    known = csc_matrix(stiffness), between, csc_matrix(mass)
    return Equations(*known, force, rigid, inertia, story_rigid)


def driven_system(
    structure: Structure,
    added: Sequence[tuple[Placed, Terms]],
    theta: Floats,
    sizes: Floats,
    top_hz: float,
    law: DampingLaw,
    sensors: SensorRows | None = None,
    columns: int = 1,
) -> DrivenSystem:
    """Solve the full model at one sample.

    Args:
        added: effects, each with its terms.
        sizes: (q,) parameters of the effects.
        top_hz: up to where the response to every force must be right.
        sensors: what is observed; the floors where None.
        columns: of the base's motion that are driven (see `Excitation`).

    Raises:
        StructureError: the structure is a mechanism, or too many shapes would be needed.
    """
    placed, terms = tuple(listed for listed, _ in added), [terms_of for _, terms_of in added]
    whole = equations_at(
        structure, theta, list(zip(terms, first_sizes(placed, sizes), strict=True))
    )
    if any(terms_of.pitch or terms_of.flexibility[ROTATION] for terms_of in terms):
        columns = max(columns, 2)
    ports = [terms_of.port.row for terms_of in terms if terms_of.port is not None]
    forces = np.column_stack([whole.force[:, :columns], *ports, *structure.dashpots])
    held = structure.operators
    factors = factorize(whole.stiffness) if held is None else factorize_held(held, whole.stiffness)
    sprung = WithSprings(factors, whole.springs)
    seen = sensors or SensorRows(structure.floors, structure.floor_rows, structure.levels)
    found = driven_shapes(
        sprung, whole.mass, forces, structure.floor_rows, top_hz, watched=seen.watched
    )
    shapes = found.shapes
    size, force = shapes.shape[1], shapes.T @ whole.force
    model = ReducedModel(  # without stiffness factors, diagonal
        stiffness_terms=np.zeros((0, size, size)),
        stiffness_constant=np.diag((2.0 * np.pi * found.frequency_hz) ** 2),
        excitation=force[:, TRANSLATION],
        floor_shapes=seen.rows @ shapes,
        floors=seen.names,
        story_inertia=whole.story_inertia @ shapes,
        story_mass=whole.story_rigid[:, TRANSLATION],
        story_drift=structure.drift_rows @ shapes,
        across=force[:, ACROSS] if columns > 2 else None,
        rotation=BaseRotation(
            force=force[:, ROTATION],
            mass=whole.rigid_mass[:2, :2],
            story_moment=whole.story_rigid[:, ROTATION],
            levels=seen.levels,
            story_height=structure.building.over_foot(structure.levels),
        ),
        dashpots=dashpots_on(structure, shapes),
    )
    rest = tuple(
        reduce_terms(shapes, replace(terms_of, stiffness=(), springs=None, mass=None))
        for terms_of in terms
    )
    return DrivenSystem(System(model, law, placed, rest), whole, found.frequency_hz, shapes)
