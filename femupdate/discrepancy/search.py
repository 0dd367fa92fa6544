"""The search for what a model lacks, from its fit to its diagnosis, wherever theta may lie."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from torch import Tensor

from femupdate.discrepancy.diagnose import AMBIGUOUS, PARTLY, UNKNOWN, Diagnosis, diagnose
from femupdate.discrepancy.exchange import promising
from femupdate.discrepancy.finder_model import (
    FinderModel,
    check_sizes,
    problem_of,
    with_rest_about,
)
from femupdate.discrepancy.fit import (
    Fit,
    about,
    error_left,
    extended,
    fit,
    fit_baseline,
    log_posterior,
    settle,
)
from femupdate.discrepancy.global_search import global_fit
from femupdate.discrepancy.mesh_error import corrected
from femupdate.discrepancy.mesh_scatter import left_open
from femupdate.discrepancy.near_basis import structure_near
from femupdate.discrepancy.score import candidates
from femupdate.discrepancy.thresholds import FIT, SEARCH, VERDICT, DiagnosisSettings
from femupdate.dynamics.local_basis import SPREAD, Sized
from femupdate.effects.effect import Placed
from femupdate.effects.registry import BuildingEffects, building_effects, check_places
from femupdate.inference.data import Data
from femupdate.inference.joint_error import joint_error
from femupdate.inference.likelihood import Likelihood
from femupdate.progress import Progress, Silent


def prepared(
    model: FinderModel,
    data: Sequence[Data],
    settings: DiagnosisSettings | None = None,
    progress: Progress | None = None,
) -> tuple[Likelihood, Fit]:
    """The problem with its mesh error, and the model as it is fitted to it.

    The stiffness factors of a frame are found on the study's own basis; then it gets one that
    serves near them and lets effects act.
    """
    show = progress or Silent()
    seed = settings.seed if settings is not None else 0
    effects = building_effects(model.building)
    plain = model.plain
    check_places(plain.structure, effects)
    show.start("Fitting the model as it is", 1)
    problem = problem_of(plain, model.building, data)
    if plain.structure.operators is None:
        check_sizes(model.building, problem.with_effects(effects.placed).system, effects.values)
        base = fit_baseline(problem, effects.placed, effects.values, seed)[0]
        show.advance()
        return problem, base
    problem = replace(problem, search=plain.first(FIT.rough_shapes))
    rough = fit_baseline(problem.for_search(), seed=seed)[0]
    middle = _rightly_named(problem, rough, seed)
    show.advance()
    # An exchange that is not in the building's file is for the finder to name.
    listed = set(middle.placed) <= set(effects.placed)
    known = middle if listed else rough
    start = extended(problem, known, effects.placed, np.array(effects.values))
    problem, base = _around(model, problem, middle, (effects.placed, start), show)
    if not effects.placed:
        return problem, base
    check_sizes(model.building, problem.with_effects(effects.placed).system, effects.values)
    return _as_listed(model, problem, base, effects, show, seed)


def _as_listed(
    model: FinderModel,
    problem: Likelihood,
    base: Fit,
    effects: BuildingEffects,
    show: Progress,
    seed: int,
) -> tuple[Likelihood, Fit]:
    """Theta where it lies with the listed effects, as large as the file says.

    The search without them may have ended far from there.
    """
    tried = fit_baseline(
        problem, effects.placed, effects.values, seed, FIT.listed_draws, FIT.listed_starts
    )[0]
    if log_posterior(problem, tried) < log_posterior(problem, base) + VERDICT.clearly:
        return problem, base
    return refined(model, problem, tried, show)


def sought(
    model: FinderModel,
    problem: Likelihood,
    base: Fit,
    settings: DiagnosisSettings | None = None,
    progress: Progress | None = None,
) -> tuple[Likelihood, Fit, Diagnosis]:
    """What a model lacks; far from its most probable theta, too, where nothing near it explains
    the data, or it takes two effects, or several do about equally well.

    Args:
        model: of the building.
        problem: the likelihood of the data.
        base: the model as it is, fitted.
        settings: of the diagnosis.
        progress: told about the steps.

    Returns:
        Likelihood, base and diagnosis; the first two anew where something was found far off.
    """
    show, chosen = progress or Silent(), settings or DiagnosisSettings()

    first = diagnose(problem, chosen, base, show)
    near = _run_off(model, problem, base, first, chosen, show)
    if near[2].verdict not in (UNKNOWN, AMBIGUOUS, PARTLY):
        return near
    show.advance(note="searching far from the model as it is")
    leading = [one.placed for one in first.findings]
    far = global_fit(problem, base, first.scores, leading, chosen.seed)
    if far is None:
        return near
    there, far = refined(model, problem, far, show)
    moved = fit(there, base.placed, base.z)
    again = diagnose(there, chosen, moved, show, far)
    if again.verdict == UNKNOWN or _best(again) < _best(near[2]) + VERDICT.clearly:
        return near
    return _run_off(model, there, moved, again, chosen, show)


def _run_off(
    model: FinderModel,
    problem: Likelihood,
    base: Fit,
    found: Diagnosis,
    settings: DiagnosisSettings,
    show: Progress,
) -> tuple[Likelihood, Fit, Diagnosis]:
    """Of a frame's leading effects that are close, each on a basis that serves them alone.

    What one basis for all effects leaves of each is a few hundredths of ln|H|, and not of all the
    same.
    """
    close = found.close
    if problem.reduced.structure.operators is None or len(close) < 2:
        return problem, base, found

    sets = [_sized(one.fitted) for one in close]
    problem, first = _around(model, problem, close[0].fitted, (base.placed, base.z), show, sets)
    labels = frozenset(one.placed.label for one in close)
    again = diagnose(problem, settings, first, show, close[0].fitted, among=labels)
    others = (one for one in found.findings if one.placed.label not in labels)
    # What all effects show is told by the basis that serves them all.
    told = replace(
        again,
        findings=(*again.findings, *others),
        scores=found.scores,
        unobservable=found.unobservable,
    )
    return problem, first, told


def _best(found: Diagnosis) -> float:
    """Log density of the data by the best of the fits."""
    fits = [found.base, *(one.fitted for one in found.findings)]
    return max(log_posterior(one.likelihood, one) for one in fits)


def _rightly_named(problem: Likelihood, rough: Fit, seed: int) -> Fit:
    """A rough fit, or that with the channels exchanged which explains far more.

    Under a wrong name theta is drawn to where nothing found in its neighbourhood would be right.
    """
    searched = problem.for_search()
    if error_left(searched, rough) < SEARCH.right:
        return rough
    exchanges = [one for one in candidates(searched) if one.exchange]
    found = promising(problem, rough, exchanges, seed)
    if not found or found[0].share > VERDICT.obvious:
        return rough
    return fit(searched, (found[0].placed,), found[0].z, FIT.far_steps)


def refined(
    model: FinderModel,
    problem: Likelihood,
    fitted: Fit,
    progress: Progress | None = None,
    *,
    alone: bool = False,
) -> tuple[Likelihood, Fit]:
    """The problem around a fit with effects, whose theta may be far from the first one's.

    Where theta leaves the neighbourhood that the new basis serves, it is followed.

    Args:
        model: of the building.
        problem: as the effects were found.
        fitted: with the effects.
        progress: told about the steps.
        alone: no other effects need act in it; then it serves these better, and costs a third.
    """
    if problem.reduced.structure.operators is None:
        return problem, fitted
    show = progress or Silent()
    for _ in range(FIT.most_bases):
        middle = fitted
        start = (fitted.placed, fitted.z)
        sets = [_sized(middle)] if alone else None
        problem, fitted = _around(model, problem, middle, start, show, sets)
        if np.abs(np.log(fitted.theta()[0] / middle.theta()[0])).max() < SPREAD:
            break
    return problem, fitted


def _around(
    model: FinderModel,
    problem: Likelihood,
    middle: Fit,
    start: tuple[tuple[Placed, ...], Tensor],
    show: Progress,
    present: Sequence[Sized] | None = None,
) -> tuple[Likelihood, Fit]:
    """A frame's problem on a basis about a fit, with its mesh error there, and a fit from there."""
    theta, zeta = middle.theta()[0], middle.zeta
    near = structure_near(model.structure, model.building, theta, zeta, show, present, model.bases)
    data = with_rest_about(problem.data, model.structure, near.model, theta)
    if model.mesh is not None:
        near = corrected(near, model.mesh)
    # Rows of the tables stay; what is known beforehand does not.
    error = joint_error(data).with_rows_of(problem.error)
    known = None if model.mesh is None else left_open(model.mesh, near, by_modes=True)
    problem = replace(problem.without_effects_on(near), data=data, error=error, known=known)
    # Where the fit was, the errors of the mesh are as straight lines have them.
    begun = fit(problem.at_row(problem.error.start), *start)
    problem = about(problem, begun)
    fitted = settle(problem, begun)
    return fitted.likelihood, fitted


def _sized(fitted: Fit) -> Sized:
    """The effects of a fit, each with its first parameter."""
    values, found, first = fitted.sizes()[0], [], 0
    for placed in fitted.placed:
        count = len(placed.effect.parameters)
        found.append((placed, float(values[first]) if count else 1.0))
        first += count
    return tuple(found)
