"""The search for what a model lacks, from its fit to its diagnosis, wherever theta may lie."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.building.document import Building, without_effects
from femupdate.building.kinds import FrameBuilding, MeshBuilding
from femupdate.building.split_mesh import is_large
from femupdate.discrepancy.diagnose import diagnose, too_few
from femupdate.discrepancy.findings import AMBIGUOUS, NAMED, PARTLY, UNKNOWN, Diagnosis
from femupdate.discrepancy.fit import (
    FAR_STEPS,
    RIGHT,
    Fit,
    about,
    error_left,
    extended,
    fit,
    fit_baseline,
    log_posterior,
    settle,
)
from femupdate.discrepancy.global_search import global_fit, promising
from femupdate.discrepancy.mesh_error import MeshError, corrected, left_open
from femupdate.discrepancy.score import candidates
from femupdate.discrepancy.thresholds import MESH_ERROR, VERDICT, DiagnosisSettings
from femupdate.dynamics.damping import damping_law
from femupdate.dynamics.force_response import rest_about
from femupdate.dynamics.local_basis import SPREAD, Sized, local_structure
from femupdate.dynamics.reduced import ReducedModel, ReducedStructure, lumped, reduced_on
from femupdate.dynamics.system import System
from femupdate.effects.effect import Placed
from femupdate.effects.registry import building_effects, check_places
from femupdate.effects.structure import Structure, structure_of
from femupdate.errors import BuildingError
from femupdate.inference.frf_data import FrfData
from femupdate.inference.likelihood import Data, Likelihood, joint_error, likelihood_of
from femupdate.inference.parameters import (
    Parameters,
    damping_parameter,
    reduction_target,
    theta_prior,
)
from femupdate.progress import SILENT, Progress

Bases = Callable[[Structure, Floats, float, Callable[[], Floats]], Floats]
"""Gives the basis (n, r) kept of a structure for theta (p,) and zeta, else makes and keeps it."""


@dataclass(frozen=True, eq=False)
class FinderModel:
    """What serves every observation of a building.

    Attributes:
        building: as its file says.
        plain: the structure on the building's own basis, which knows the story factors alone.
        structure: the full model in which effects act.
        mesh: error of its mesh where it is a frame's, or None.
        bases: keeps the basis near a fit; None keeps none.
    """

    building: Building
    plain: ReducedStructure
    structure: Structure
    mesh: MeshError | None = None
    bases: Bases | None = None


def finder_structure(building: Building) -> Structure:
    """The full model in which effects act, on a mesh finer than the study's.

    The study's mesh is chosen for a hundred thousand responses; here some twenty solutions are
    needed, and half of the error of a mesh is worth them. One that was read is split where that
    does not make it large.
    """
    plain = without_effects(building)
    structure = structure_of(plain, finder_mesh_size(building))
    if isinstance(plain, MeshBuilding) and structure.mesh and not is_large(structure.mesh, 4):
        return structure_of(plain, halved=True)
    return structure


def finder_mesh_size(building: Building) -> float | None:
    """Of the finder's mesh, m; None for what is not meshed here."""
    return MESH_ERROR.finer * building.mesh.size if isinstance(building, FrameBuilding) else None


def plain_structure(building: Building, reduced: ReducedModel) -> ReducedStructure:
    """The structure on the basis of a reduced model, which knows the story factors alone."""
    structure = structure_of(without_effects(building))
    if structure.is_stick:
        return lumped(structure)
    return ReducedStructure(structure, reduced, np.zeros((len(structure.axis), 0)))


def problem_of(reduced: ReducedStructure, building: Building, data: Sequence[Data]) -> Likelihood:
    """A building and what was observed of it, for the effect finder."""
    system = System(reduced.model, damping_law(building))
    prior = theta_prior(building) + Parameters((damping_parameter(building),))
    return likelihood_of(data, system, prior, reduced=reduced)


def check_sizes(building: Building, system: System, values: Sequence[float]) -> None:
    """Make sure that effects of sizes that a building lists leave it stiff in every direction.

    Raises:
        BuildingError: they do not; two effects may each be possible and take too much together.
    """
    theta = torch.ones(1, system.factors, dtype=torch.float64)
    inverse = system.modes(theta, torch.tensor([list(values)], dtype=torch.float64)).inverse
    if not torch.isfinite(inverse).all():
        listed = ", ".join(placed.label for placed in system.placed)
        raise BuildingError(
            f"{building.name}: effects: {listed}: together they take away more stiffness than "
            "there is; give smaller changes, or remove one that says the same"
        )


def with_rest_about(
    data: Sequence[Data], structure: Structure, reduced: ReducedModel, theta: Floats
) -> tuple[Data, ...]:
    """The data with what a basis about theta (p,) lacks under forces; that of a stick nothing."""
    forced = any(isinstance(kind, FrfData) and kind.forced for kind in data)
    if structure.operators is None or not forced:
        return tuple(data)
    rest = rest_about(structure, reduced, theta)
    return tuple(kind.with_rest(rest) if isinstance(kind, FrfData) else kind for kind in data)


def structure_near(
    structure: Structure,
    building: Building,
    theta: Floats,
    zeta: float,
    progress: Progress = SILENT,
    present: Sequence[Sized] | None = None,
    bases: Bases | None = None,
) -> ReducedStructure:
    """The structure on a basis for the neighbourhood of theta, in which effects may act.

    A basis for the whole prior, members and torsion apart, needs some nine hundred shapes; near one
    theta two hundred do, from some thirty solutions of the full model, or from ten where only the
    effects that are present need act. A stick comes back as it is.

    Args:
        structure: the full model.
        building: whose grid and damping the basis serves.
        theta: (p,) story factors; zeta: the damping ratio.
        present: see `local_structure`.
        bases: keeps the last basis in which every effect may act; None keeps nothing.
    """
    whole = reduction_target(building)
    damping = math.exp(0.3 * round(math.log(zeta) / 0.3))
    target = replace(whole, zeta=max(damping, whole.zeta))
    if present is not None or structure.operators is None:
        return local_structure(structure, theta, target, progress, present=present)
    middle = np.exp(0.1 * np.round(np.log(theta) / 0.1))  # a basis serves .2 to both sides

    def make() -> Floats:
        # As it is kept, in single precision: the next run gives the same to the last digit.
        return local_structure(structure, middle, target, progress).basis.astype(np.float32)

    basis = make() if bases is None else bases(structure, middle, target.zeta, make)
    return reduced_on(structure, basis.astype(np.float64))


def prepared(
    model: FinderModel, data: Sequence[Data], seed: int = 0, progress: Progress = SILENT
) -> tuple[Likelihood, Fit]:
    """The problem with its mesh error, and the model as it is fitted to it.

    The stiffness factors of a frame are found on the study's own basis; then it gets one that
    serves near them and lets effects act.
    """
    effects, plain = building_effects(model.building), model.plain
    check_places(plain.structure, effects)
    progress.start("Fitting the model as it is", 1)
    problem = problem_of(plain, model.building, data)
    if plain.structure.operators is None:
        check_sizes(model.building, problem.with_effects(effects.placed).system, effects.values)
        base = fit_baseline(problem, effects.placed, effects.values, seed)[0]
        progress.advance()
        return problem, base
    problem = replace(problem, search=plain.first(100))
    rough = fit_baseline(problem.for_search(), seed=seed)[0]
    middle, searched = rough, problem.for_search()
    if error_left(searched, rough) >= RIGHT:
        # Under a wrong name theta is drawn to where nothing found in its neighbourhood would be
        # right: the exchange of channels is taken that explains far more.
        exchanges = [placed for placed in candidates(searched) if placed.exchange]
        for share, placed, z in promising(problem, rough, exchanges, seed)[:1]:
            if share <= 0.5:
                middle = fit(searched, (placed,), z, FAR_STEPS)
    progress.advance()
    # An exchange that is not in the building's file is for the finder to name.
    known = middle if set(middle.placed) <= set(effects.placed) else rough
    start = extended(problem, known, effects.placed, effects.values)
    problem, base = _around(model, problem, middle, (effects.placed, start), progress)
    if not effects.placed:
        return problem, base
    check_sizes(model.building, problem.with_effects(effects.placed).system, effects.values)
    # Theta where it lies with the listed effects, as large as the file says: the search without
    # them may have ended far from there.
    tried = fit_baseline(problem, effects.placed, effects.values, seed, samples=192, starts=4)[0]
    if log_posterior(problem, tried) < log_posterior(problem, base) + VERDICT.clearly:
        return problem, base
    return refined(model, problem, tried, progress)


def doubted(found: Diagnosis) -> bool:
    """Whether more than a little of the misfit is left, whatever the verdict."""
    left = found.verdict in (UNKNOWN, PARTLY)
    first = found.leading if found.verdict == NAMED else None
    return left or (first is not None and first.removes(found.base) < VERDICT.most)


def sought(
    model: FinderModel,
    problem: Likelihood,
    base: Fit,
    settings: DiagnosisSettings | None = None,
    progress: Progress = SILENT,
) -> tuple[Likelihood, Diagnosis]:
    """What a model lacks; far from its most probable theta, too, where nothing near it explains
    the data, or it takes two effects, or several do about equally well.

    Args:
        base: the model as it is, fitted.

    Returns:
        Likelihood and diagnosis; the first anew where something was found far off.
    """
    chosen = settings or DiagnosisSettings()
    first = diagnose(problem, chosen, base, progress)
    near, found = _run_off(model, problem, base, first, chosen, progress)
    open_ = doubted(found) or found.verdict == AMBIGUOUS
    if not (open_ or (found.leading and found.leading.at_limit)) or too_few(found.base):
        return near, found
    starts = [(problem, base)]
    factors = torch.arange(len(base.z)) < base.steps.stories
    away = float(base.z[factors].abs().max()) > SPREAD
    if away and doubted(found) and not problem.reduced.structure.is_stick:
        # Under what is missing the factors of the model as it is may be far from right, and the
        # basis about them serves no others: those of the building's file come first.
        neutral = fit(problem, base.placed, torch.where(factors, 0.0, base.z), 0)
        starts.insert(0, _around(model, problem, neutral, (base.placed, neutral.z), progress))
    for around, start in starts:
        progress.advance(note="searching far from the model as it is")
        far = global_fit(around, start, first.scores, chosen.seed)
        if far is None:
            continue
        there, far = refined(model, around, far, progress)
        moved = fit(there, base.placed, base.z)
        again = diagnose(there, chosen, moved, progress, far)
        # Log density of the data by the best of the fits.
        now, then = (
            max(
                log_posterior(fitted.likelihood, fitted)
                for fitted in (told.base, *(finding.fitted for finding in told.findings))
            )
            for told in (again, found)
        )
        if again.verdict != UNKNOWN and now >= then + VERDICT.clearly:
            near, found = _run_off(model, there, moved, again, chosen, progress)
        if not doubted(found):
            break
    return near, found


def _run_off(
    model: FinderModel,
    problem: Likelihood,
    base: Fit,
    found: Diagnosis,
    settings: DiagnosisSettings,
    progress: Progress,
) -> tuple[Likelihood, Diagnosis]:
    """Of a frame's leading effects that are close, each on a basis that serves them alone.

    What one basis for all effects leaves of each is a few hundredths of ln|H|, and not of all the
    same.
    """
    close = found.close(settings)
    if problem.reduced.structure.operators is None or len(close) < 2:
        return problem, found
    sets = [_sized(finding.fitted) for finding in close]
    start = (base.placed, base.z)
    problem, first = _around(model, problem, close[0].fitted, start, progress, sets)
    labels = frozenset(finding.placed.label for finding in close)
    again = diagnose(problem, settings, first, progress, close[0].fitted, among=labels)
    others = (finding for finding in found.findings if finding.placed.label not in labels)
    # What all effects show is told by the basis that serves them all.
    return problem, replace(
        again,
        findings=(*again.findings, *others),
        scores=found.scores,
        unobservable=found.unobservable,
    )


def refined(
    model: FinderModel,
    problem: Likelihood,
    fitted: Fit,
    progress: Progress = SILENT,
    *,
    alone: bool = False,
) -> tuple[Likelihood, Fit]:
    """The problem around a fit with effects, whose theta may be far from the first one's.

    Where theta leaves the neighbourhood that the new basis serves, it is followed, four times at
    most.

    Args:
        problem: as the effects were found.
        fitted: with the effects.
        alone: no other effects need act in it; then it serves these better, and costs a third.
    """
    if problem.reduced.structure.operators is None:
        return problem, fitted
    for _ in range(4):
        middle, start = fitted, (fitted.placed, fitted.z)
        sets = [_sized(middle)] if alone else None
        problem, fitted = _around(model, problem, middle, start, progress, sets)
        if np.abs(np.log(fitted.theta()[0] / middle.theta()[0])).max() < SPREAD:
            break
    return problem, fitted


def _around(
    model: FinderModel,
    problem: Likelihood,
    middle: Fit,
    start: tuple[tuple[Placed, ...], Tensor],
    progress: Progress,
    present: Sequence[Sized] | None = None,
) -> tuple[Likelihood, Fit]:
    """A frame's problem on a basis about a fit, with its mesh error there, and a fit from there."""
    theta, zeta = middle.theta()[0], middle.zeta
    near = structure_near(
        model.structure, model.building, theta, zeta, progress, present, model.bases
    )
    data = with_rest_about(problem.data, model.structure, near.model, theta)
    if model.mesh is not None:
        near = corrected(near, model.mesh)
    # Rows of the tables stay; what is known beforehand does not.
    error = joint_error(data).with_rows_of(problem.error)
    known = None if model.mesh is None else left_open(model.mesh, near)
    problem = replace(problem.without_effects_on(near), data=data, error=error, known=known)
    # Where the fit was, the errors of the mesh are as straight lines have them.
    begun = fit(problem.at_row(problem.error.start), *start)
    problem = about(problem, begun)
    fitted = settle(problem, begun)
    return fitted.likelihood, fitted


def _sized(fitted: Fit) -> Sized:
    """The effects of a fit, each with its first parameter."""
    known = ((placed, fitted.known_of(number)) for number, placed in enumerate(fitted.placed))
    return tuple((placed, float(values[0]) if values.size else 1.0) for placed, values in known)
