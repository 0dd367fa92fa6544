"""What a basis for effects must have seen: story factors, members, infill and eccentricity vary.

Forces of their own for every effect (base rotation, twist) would take more shapes than they are
worth; changes of stiffness and mass show in the response to base motion itself, with the weight
that they have there.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csc_matrix
from scipy.stats import qmc

from femupdate.arrays import Floats
from femupdate.dynamics.full_response import FloorSensors
from femupdate.dynamics.reduction import ReductionTarget, response_shapes
from femupdate.effects.effect import AddedMass
from femupdate.effects.registry import CATALOGUE
from femupdate.effects.structure import TRANSLATION, Structure
from femupdate.fe.assembly import AffineOperators

_KINDS = (("wall",), ("beam",), ("column",), ("slab",))
_MEMBERS = (0.6, 1.35)  # range of the factor on one kind of member
_INFILL = 0.4  # largest share of the stiffness of walls that only weigh
_SHIFT = 0.1  # largest eccentricity over the plan's depth, to both sides


@dataclass(frozen=True, eq=False)
class Variation:
    """The parts of a structure that vary.

    Attributes:
        terms: stiffness of each kind of member, and of the rest, of the first story, the second,
            ..., and then of each line's infill by story.
        stories: number of stories.
        infill: story of each infill term.
        lines: line of each infill term, counted from 0.
        mass: added mass of unit eccentricity, or None.
    """

    terms: tuple[csc_matrix, ...]
    stories: int
    infill: tuple[int, ...]
    lines: tuple[int, ...]
    mass: AddedMass | None

    def draw(self, low: Floats, high: Floats, count: int, seed: int) -> Floats:
        """(n, t + 1) factors on the terms and, last, the eccentricity; theta within a box (p,)."""
        kinds, lines = len(_KINDS), len(set(self.lines))
        sobol = qmc.Sobol(self.stories + kinds + lines + 1, seed=np.random.default_rng(seed))
        # The sequence is balanced over powers of two only.
        unit = sobol.random_base2(max(count - 1, 0).bit_length())[:count]
        own, members, shares = np.split(unit, [self.stories, self.stories + kinds], axis=1)
        # Soft stories have most modes below the top of the grid: evenly in the logarithm.
        theta = np.exp(np.log(low) + np.log(high / low) * own)
        members = np.exp(np.log(_MEMBERS[0]) + np.log(_MEMBERS[1] / _MEMBERS[0]) * members)
        members = np.column_stack([members, np.ones(count)])
        factors = (theta[:, :, None] * members[:, None, :]).reshape(count, -1)
        infill = _INFILL * shares[:, list(self.lines)] * theta[:, list(self.infill)]
        shift = _SHIFT * (2.0 * shares[:, -1:] - 1.0)
        return np.column_stack([factors, infill, shift])


@dataclass(frozen=True, eq=False)
class VariedShapes:
    """Snapshots of the full model at one draw; a task for `response_basis`."""

    mass: AddedMass | None

    def __call__(
        self,
        operators: AffineOperators,
        sensors: FloorSensors,
        draw: Floats,
        target: ReductionTarget,
    ) -> Floats:
        if self.mass is not None:
            shift = float(draw[-1])
            operators = replace(
                operators, mass=csc_matrix(operators.mass + shift * self.mass.matrix)
            )
            force = sensors.excitation + shift * self.mass.force[:, TRANSLATION]
            sensors = replace(sensors, excitation=force)
        return response_shapes(operators, sensors, draw[:-1], target)


def variation_of(structure: Structure) -> Variation:
    """What varies in a frame."""
    members = [structure.member_stiffness(kinds, False) for kinds in _KINDS]
    by_story = zip(structure.stiffness_terms, *members, strict=True)
    terms = [
        matrix
        for whole, *kinds in by_story
        for matrix in (*kinds, csc_matrix(whole - sum(kinds[1:], start=kinds[0])))
    ]
    names = list(dict.fromkeys(one.line for one in structure.infills))
    eccentricity = CATALOGUE["eccentricity"]
    movable = bool(eccentricity.places(structure))
    return Variation(
        (*terms, *(one.stiffness for one in structure.infills)),
        len(structure.stiffness_terms),
        tuple(one.story for one in structure.infills),
        tuple(names.index(one.line) for one in structure.infills),
        eccentricity.terms(structure, "all").mass if movable else None,
    )
