"""A small basis for the neighbourhood of one theta, where effects are tried one at a time.

A basis that serves stiffness factors over a range of nine, members apart, with torsion, needs many
hundred shapes, too many to be evaluated thousands of times. Near the most probable theta far fewer
do, when the responses they are taken from are those of the finder's own questions: the structure
itself, its neighbours, and each effect alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csc_matrix
from scipy.stats import qmc

from femupdate.arrays import Floats
from femupdate.dynamics.effect_reduction import structure_on
from femupdate.dynamics.effect_response import ReducedStructure
from femupdate.dynamics.full_response import FloorSensors, floor_sensors
from femupdate.dynamics.nearby import nearby_shapes
from femupdate.dynamics.reduction import TOP, ReductionTarget, response_basis
from femupdate.effects.effect import UNSCALED, Effect, Placed, Terms
from femupdate.effects.registry import CATALOGUE
from femupdate.effects.structure import TRANSLATION, Structure
from femupdate.fe.assembly import AffineOperators, with_terms
from femupdate.fe.solve import modes_below
from femupdate.progress import SILENT, Progress

SPREAD = 0.2  # of ln theta to both sides
_SIZE = 220
_NEIGHBOURS = 8
_CHANGED = 0.2  # share of its size by which an effect that is present is changed


Sized = tuple[tuple[Placed, float], ...]


@dataclass(frozen=True, eq=False)
class Question:
    """What effects of some sizes add: stiffness by story and mass.

    Attributes:
        stiffness: (story, matrix).
        mass: matrix and force per unit base acceleration.
    """

    stiffness: tuple[tuple[int, csc_matrix], ...] = ()
    mass: tuple[tuple[csc_matrix, Floats], ...] = ()

    def changed(
        self, operators: AffineOperators, sensors: FloorSensors, theta: Floats
    ) -> tuple[AffineOperators, FloorSensors]:
        """The full model at theta with the effects, as one without stiffness factors."""
        stiffness, mass, force = operators.stiffness(theta), operators.mass, sensors.excitation
        for story, matrix in self.stiffness:
            stiffness = stiffness + _factor(theta, story) * matrix
        for matrix, own in self.mass:
            mass, force = mass + matrix, force + own
        own_operators = replace(operators, stiffness_constant=csc_matrix(stiffness), mass=mass)
        return with_terms(own_operators, ()), replace(sensors, excitation=force)


def local_structure(
    structure: Structure,
    theta: Floats,
    target: ReductionTarget,
    progress: Progress = SILENT,
    *,
    spread: float = SPREAD,
    size: int = _SIZE,
    present: Sequence[Sized] | None = None,
) -> ReducedStructure:
    """A frame on a basis for the neighbourhood of theta, from its full model.

    One full eigenproblem, and for some questions one step each from there: some thirty where every
    effect of the catalogue may act, each alone; ten where only those that are present do, all
    together. A stick is its own reduction and comes back as it is.

    Args:
        structure: the full model.
        theta: (p,) story factors.
        target: grid and damping.
        progress: a bar of full solutions.
        spread: half width of the neighbourhood in ln theta.
        size: number of shapes.
        present: effects that the model has, and the first parameter of each, where no others need
            act; several such sets where it may have one or another; None for the catalogue.
    """
    if structure.operators is None or structure.mesh is None:
        return structure_on(structure, np.diag(structure.points.mass**-0.5))
    asked = _questions(structure) if present is None else _about(structure, present)
    sensors = floor_sensors(structure.operators, structure.mesh.floor_nodes, structure.direction)
    draws = _draws(theta, len(asked), spread)
    middle = asked[0].changed(structure.operators, sensors, theta)[0]
    known = modes_below(middle, np.zeros(0), TOP * float(target.frequency_hz[-1]))
    progress.start("Reducing the model for effects", len(draws))
    task = _NearbyShapes(asked, known.shapes)
    basis = response_basis(
        structure.operators, sensors, draws, target, progress, task=task, size=size
    )
    return structure_on(structure, basis)


def _questions(structure: Structure) -> tuple[Question, ...]:
    """No effect, and every effect of stiffness or mass in its widest places, to both sides."""
    return (Question(), *(_question(structure, (one,)) for one in _asked_places(structure)))


def _about(structure: Structure, sets: Sequence[Sized]) -> tuple[Question, ...]:
    """All effects of each set as they are, and with the size of one after the other changed."""
    return tuple(one for present in sets for one in _changes(structure, present))


def _changes(structure: Structure, present: Sized) -> list[Question]:
    asked = [_question(structure, present)]
    for number, (placed, size) in enumerate(present):
        own = placed.effect.parameters[0] if placed.effect.parameters else None
        if own is None or not _acts(placed.effect.terms(structure, placed.place)):
            continue
        step = max(_CHANGED * abs(size), 0.5 * own.scale)
        for other in (size - step, size + step):
            if own.lower <= other <= own.upper:
                moved = (*present[:number], (placed, other), *present[number + 1 :])
                asked.append(_question(structure, moved))
    return asked


def _asked_places(structure: Structure) -> list[tuple[Placed, float]]:
    """Every effect of stiffness or mass in its widest places, with sizes to both sides."""
    found = []
    for effect in CATALOGUE.values():
        for place in _wide(effect, structure):
            placed = Placed(effect, place)
            if _acts(placed.effect.terms(structure, place)):
                found += [(placed, size) for size in _sizes(effect)]
    return found


def _acts(terms: Terms) -> bool:
    """Whether an effect changes the shapes that a basis must hold."""
    return bool(terms.stiffness) or terms.mass is not None


def _wide(effect: Effect, structure: Structure) -> tuple[str, ...]:
    """Places that are not one floor or story of several."""
    places = effect.places(structure)
    narrow = (*structure.floors, *structure.building.story_names)
    if effect.instrument or len(places) == 1:
        return () if effect.instrument else places
    return tuple(place for place in places if place not in narrow and "/" not in place)


def _sizes(effect: Effect) -> tuple[float, ...]:
    one = effect.parameters[0]
    both = (one.neutral - one.scale, one.neutral + one.scale)
    return tuple(size for size in both if one.lower <= size <= one.upper)


def _question(structure: Structure, sized: Sized) -> Question:
    stiffness: list[tuple[int, csc_matrix]] = []
    mass: list[tuple[csc_matrix, Floats]] = []
    for placed, size in sized:
        terms = placed.effect.terms(structure, placed.place)
        stiffness += [(story, size * matrix) for story, matrix in terms.stiffness]
        if terms.mass is not None:
            mass.append((size * terms.mass.matrix, size * terms.mass.force[:, TRANSLATION]))
    return Question(tuple(stiffness), tuple(mass))


def _neighbours(theta: Floats, spread: float) -> Floats:
    """Some theta (n, p) around one, evenly within the half width in ln theta."""
    sobol = qmc.Sobol(len(theta), seed=np.random.default_rng(3)).random(_NEIGHBOURS)
    return np.asarray(theta * np.exp(spread * (2.0 * sobol - 1.0)))


def _draws(theta: Floats, asked: int, spread: float) -> Floats:
    """(n, 1 + p) the number of a question, and theta; the neighbours ask the first."""
    numbers = np.concatenate([np.arange(asked), np.zeros(_NEIGHBOURS)])
    thetas = np.concatenate([np.tile(theta, (asked, 1)), _neighbours(theta, spread)])
    return np.column_stack([numbers, thetas])


@dataclass(frozen=True, eq=False)
class _NearbyShapes:
    """Shapes of the full model at one draw; a task for `response_basis`.

    Attributes:
        questions: that the draws name.
        known: (n_free, m) modes in the middle of the neighbourhood.
    """

    questions: tuple[Question, ...]
    known: Floats

    def __call__(
        self,
        operators: AffineOperators,
        sensors: FloorSensors,
        draw: Floats,
        target: ReductionTarget,
    ) -> Floats:
        own, seen = self.questions[int(draw[0])].changed(operators, sensors, draw[1:])
        return nearby_shapes(own, seen, self.known, target)


def _factor(theta: Floats, story: int) -> float:
    return 1.0 if story == UNSCALED else float(theta[story])
