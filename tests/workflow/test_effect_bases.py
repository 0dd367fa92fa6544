"""The basis of a frame in which effects act, about where theta ended."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from scipy.linalg import eigh

from femupdate.discrepancy import FinderModel, plain_structure, prepared, refined
from femupdate.discrepancy.fit import extended, fit, fit_baseline
from femupdate.discrepancy.score import score
from femupdate.discrepancy.search import problem_of, structure_near
from femupdate.dynamics import System, local_structure, reduced_on
from femupdate.effects import CATALOGUE, Placed, with_effect
from femupdate.errors import BuildingError
from femupdate.inference import COARSE_ERROR, reduction_target
from femupdate.inference.frf_data import frf_data
from femupdate.measurement import Observation
from femupdate.study import Study
from femupdate.workflow import open_study
from femupdate.workflow.effects import finder_basis

THETA, ZETA, MASS, NOISE = np.array([0.8, 1.5]), 0.03, 0.25, 0.01
FAR = np.array([1.35, 0.9])
HEAVY = (Placed(CATALOGUE["added_mass"], "RF"),)


@pytest.fixture(scope="module")
def cabin(cabin_built):
    model = open_study(cabin_built)
    plain = plain_structure(model.building, model.reduced)
    stiffness = plain.structure.stiffness(np.ones(2)).toarray()
    modes = eigh(stiffness, plain.structure.mass.toarray())[1]
    exact = reduced_on(plain.structure, modes)
    return SimpleNamespace(
        model=model,
        building=model.building,
        plain=plain,
        exact=exact,
        grid=model.building.frequency_grid.frequencies_hz(),
    )


def frf(cabin, reduced, theta, placed=(), sizes=()):
    """Complex FRFs (f, k) of a reduced cabin with effects."""
    terms = tuple(reduced.terms(one) for one in placed)
    system = System(reduced.model, cabin.model.law, placed, terms)
    values = [torch.tensor(np.atleast_2d(v), dtype=torch.float64) for v in (theta, sizes)]
    zeta = torch.tensor([ZETA], dtype=torch.float64)
    return system.frf(values[0], zeta, values[1], torch.from_numpy(cabin.grid))[0].numpy()


def error(cabin, reduced, theta, placed=(), sizes=()):
    """Root mean square error of ln|H|."""
    both = [np.abs(frf(cabin, one, theta, placed, sizes)) for one in (reduced, cabin.exact)]
    return float(np.sqrt((np.log(both[0] / both[1]) ** 2).mean()))


def observed(cabin, mass, seed):
    """The full model with mass on its roof, with errors of a hundredth of |H| and the phase."""
    seen = frf(cabin, cabin.exact, THETA, HEAVY, [mass])
    noise = NOISE * np.random.default_rng(seed).standard_normal((2, *seen.shape))
    return Observation(
        cabin.grid,
        cabin.exact.model.floors,
        np.log(np.abs(seen)) + noise[0],
        np.full(seen.shape, NOISE),
        np.ones(seen.shape, dtype=bool),
        np.angle(seen) + noise[1],
        None,
        float(cabin.grid[1] - cabin.grid[0]),
    )


def finder_model(cabin, building=None):
    structure = cabin.plain.structure
    return FinderModel(building or cabin.building, cabin.plain, structure)


def posed(reduced, cabin, seen):
    return problem_of(
        reduced, cabin.building, (frf_data(seen, cabin.building.floors, table=COARSE_ERROR),)
    )


@pytest.fixture(scope="module")
def observation(cabin):
    return observed(cabin, MASS, 4)


def test_refined_moves_the_basis_to_where_theta_ended(cabin, observation):
    """From a few shapes about factors that are off by two thirds, and a fit on them."""
    model = finder_model(cabin)
    target = reduction_target(cabin.building)
    away = local_structure(cabin.plain.structure, FAR, target, size=16)
    problem = posed(cabin.plain, cabin, observation).without_effects_on(away)
    base = fit_baseline(problem)[0]
    fitted = fit(problem, HEAVY, extended(problem, base, HEAVY, [0.1]))
    moved, after = refined(model, problem, fitted)
    (ended, _), (mass, _) = after.theta(), after.sizes()
    assert after.placed == HEAVY
    assert after.system.model is moved.reduced.model
    assert error(cabin, moved.reduced, ended, HEAVY, mass) < 0.01
    assert error(cabin, away, ended, HEAVY, mass) > 0.03
    assert (np.abs(ended - THETA) < 0.01 * THETA).all()
    assert mass[0] == pytest.approx(MASS, abs=0.01)


@pytest.fixture
def gone(cabin):
    """Two effects of the same members; each leaves them, both together take them away."""
    columns = CATALOGUE["cracked_columns"]
    return tuple(Placed(columns, place) for place in columns.places(cabin.plain.structure)[:2])


def test_listed_effects_that_leave_no_structure_are_refused(cabin, gone):
    building = cabin.building
    for placed in gone:
        building = with_effect(building, placed, np.array([-0.9]))
    model = finder_model(cabin, building)
    with pytest.raises(BuildingError, match="together they take away more stiffness"):
        prepared(model, (frf_data(observed(cabin, 0.0, 3), building.floors, table=COARSE_ERROR),))


def test_a_trial_that_leaves_no_structure_counts_nothing(cabin, gone):
    """An effect of members that are nearly gone is tested half a prior sd further."""
    problem = posed(cabin.exact, cabin, observed(cabin, MASS, 3))
    base = fit_baseline(problem)[0]
    start = extended(problem, base, gone[:1], [-0.9])
    weak = fit(problem, gone[:1], start, iterations=0)
    found = score(problem, weak, gone[1])
    assert (found.statistic, found.strength, found.direction) == (0.0, 0.0, None)
    further = fit(problem, gone, extended(problem, weak, gone, [-0.9, -0.9]), iterations=3)
    assert further.misfit == np.inf


def test_one_kept_basis_serves_the_fits_nearby(cabin, tmp_path):
    """It is the same with a study and without one, to the last digit."""
    structure, made = cabin.plain.structure, []

    def study(structure, theta, zeta, make):
        def counted():
            made.append(theta)
            return make()

        return finder_basis(Study(tmp_path), cabin.building, structure, theta, zeta, counted)

    near = [
        structure_near(structure, cabin.building, theta, ZETA, bases=kept)
        for theta, kept in (
            (THETA, None),
            (THETA, study),
            (1.01 * THETA, study),
            (1.2 * THETA, study),
        )
    ]
    assert len(made) == 2
    np.testing.assert_array_equal(near[0].basis, near[1].basis)
    np.testing.assert_array_equal(near[1].basis, near[2].basis)
    assert np.abs(np.log(made[-1] / (1.2 * THETA))).max() <= 0.05 + 1e-9
    exact = error(cabin, near[2], 1.01 * THETA, HEAVY, [MASS])
    assert exact < 0.01
