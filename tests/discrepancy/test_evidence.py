"""Evidence and posterior of small models against numerical integration over their prior."""

from copy import copy
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.integrate import simpson
from scipy.stats import norm

from femupdate.discrepancy import likelihood_about, parameters_at
from femupdate.discrepancy.evidence import laplace
from femupdate.discrepancy.fit import fit
from femupdate.inference import found_from
from femupdate.inference.likelihood import joint_error
from femupdate.progress import SILENT
from femupdate.workflow import CalibrationSettings, sampling
from tests.discrepancy.posed import building_of, observe, place, pose

MASS, SPRING, ZETA = 2.0, 3000.0, 0.05
GRID = np.linspace(0.5, 12.0, 40)
SD = 0.25


def frf(theta, gain=0.0, damper=0.0):
    """Floor over base of one story, by hand; `damper` as the catalogue counts it."""
    omega, own = 2 * np.pi * GRID, np.sqrt(theta * SPRING / MASS)
    rate = 2.0 * ZETA * own + 2.0 * damper * np.sqrt(SPRING / MASS)
    # Modal damping and the dashpot both act on the motion relative to the base.
    return (1.0 + gain) * (own**2 + 1j * omega * rate) / (own**2 - omega**2 + 1j * omega * rate)


class Quadrature:
    """Integrals over theta in [0.5, 2], uniform, and the normal prior of a size."""

    def __init__(self, observation, name=None, scale=0.0, lower=-np.inf):
        self.theta = np.linspace(0.85, 1.55, 401)  # all of the likelihood lies there
        first = lower if np.isfinite(lower) else -6 * scale
        self.size = np.linspace(first, 6 * scale, 101) if name else np.zeros(1)
        self.chi2 = np.array(
            [[self._chi2(observation, t, s, name) for s in self.size] for t in self.theta]
        )
        self.prior = np.full(len(self.size), -np.log(1.5))
        if name:
            share = 1.0 - norm.cdf(lower / scale)
            self.prior += norm.logpdf(self.size, 0.0, scale) - np.log(share)
        self.log = self.prior - 0.5 * self.chi2

    @staticmethod
    def _chi2(observation, theta, size, name):
        own = frf(theta, **({name: size} if name else {}))
        amplitude = observation.log_frf[0] - np.log(np.abs(own))
        turn = np.angle(np.exp(1j * (observation.phase[0] - np.angle(own))))
        # Points further off than eight sd are held there (only far from the peak of this).
        whole = np.clip(np.concatenate([amplitude, turn]) / SD, -8.0, 8.0)
        return (whole**2).sum()

    def by(self, level, points):
        """The same by a row of the table of errors that holds noise alone."""
        other = copy(self)
        constant = level.log_weight - points * np.log(level.noise)
        other.log = self.prior + constant - 0.5 * self.chi2 / level.noise**2
        return other

    def mean(self, what):
        peak = self.log.max()
        weight = np.exp(self.log - peak) * what
        inner = simpson(weight, x=self.size, axis=1) if self.size.size > 1 else weight[:, 0]
        return simpson(inner, x=self.theta), peak

    @property
    def log_evidence(self):
        value, peak = self.mean(1.0)
        return peak + np.log(value)

    def moments(self, what):
        total = self.mean(1.0)[0]
        mean = self.mean(what)[0] / total
        return mean, np.sqrt(self.mean((what - mean) ** 2)[0] / total)


CASES = {
    # label, name by hand, true size, prior sd, lower limit
    "one factor": (None, None, 0.0, 0.0, 0.0),
    "gain": ("channel_gain@RF", "gain", 0.08, 0.05, -np.inf),
    "damper": ("story_damper@RF", "damper", 0.03, 0.02, 0.0),
    "damper that is not there": ("story_damper@RF", "damper", 0.0, 0.02, 0.0),
}


@pytest.fixture(scope="module", params=CASES, ids=list(CASES))
def case(request):
    """A fitted model of one story, its problem, and its integrals."""
    label, name, truth, scale, lower = CASES[request.param]
    seen = frf(1.2, **({name: truth} if name else {}))[None]
    observation = observe(("RF",), GRID, seen, SD, 11)
    problem = pose(building_of([MASS], [SPRING], zeta=None, ratio=ZETA), observation)
    placed = place(label) if label else ()
    integrals = Quadrature(observation, name, scale, lower)
    return (*fitted_by(problem, placed, 0), integrals)


def fitted_by(problem, placed, row):
    """A problem that knows one row of the table of errors alone, and the fit by it."""
    alone = problem.at_row((row,)).kept(((row,),))
    return alone, fit(alone, placed, torch.zeros(1 + len(placed), dtype=torch.float64), 40)


def test_laplace_evidence(case):
    """The posteriors are nearly normal; a limit at the mode halves, which this knows."""
    problem, fitted, quadrature = case
    assert laplace(problem, fitted) == pytest.approx(quadrature.log_evidence, abs=0.25)


def test_evidence_where_the_noise_is_larger_than_stated(case):
    problem, fitted, quadrature = case
    whole = replace(problem, error=joint_error(problem.data))
    (table,) = whole.error.parts
    row = next(k for k, one in enumerate(table.levels) if one.noise > 1.0)
    wide, fitted = fitted_by(whole, fitted.placed, row)
    expected = quadrature.by(table.levels[row], problem.effective).log_evidence
    assert laplace(wide, fitted) == pytest.approx(expected, abs=0.35)


def test_evidence_is_summed_over_what_the_model_may_err_by(case):
    """Each row alone weighs less than the table, and none of a right model more than it has."""
    problem, fitted, _ = case
    whole = replace(problem, error=joint_error(problem.data))
    summed = laplace(whole, fitted)
    alone = laplace(problem, fitted)
    assert alone < summed < alone + np.log(2.0)


def target_of(fitted):
    """What is drawn about the maximum that a fit leads to."""
    likelihood = likelihood_about(fitted)
    maxima = found_from(likelihood.prior, likelihood.residuals, parameters_at(fitted))
    return sampling.Target(likelihood, maxima, sampling.FROM_FIT)


@pytest.mark.parametrize("by_trajectories", [False, True])
def test_draws_have_the_moments_of_the_posterior(case, by_trajectories):
    (_, fitted, quadrature), settings = case, CalibrationSettings(particles=2000)

    def draw():
        if by_trajectories:
            return sampling.sampled_by_trajectories(target_of(fitted), settings, 4, SILENT)
        return sampling.sampled_about_maxima(target_of(fitted), 2000, 4)

    draws = draw()
    assert by_trajectories or draws.drawn.effective_sample_size > 500
    away = draws.drawn.log_evidence - quadrature.log_evidence
    # That of four groups of 32 scatters by .15 from seed to seed.
    assert abs(away) < (0.6 if by_trajectories else 0.1)
    values = draws.parameters.split(draws.theta)
    columns = [(values.theta[:, 0].numpy(), quadrature.theta[:, None])]
    if values.sizes.numel():
        columns.append((values.sizes[:, 0].numpy(), quadrature.size[None]))
    for sample, grid in columns:
        mean, sd = quadrature.moments(grid)
        # 500 effective draws: means scatter by sd / 22, sds by 3 %; four times that.
        assert sample.mean() == pytest.approx(mean, abs=0.18 * sd)
        assert sample.std() == pytest.approx(sd, rel=0.14)
    chi2 = -2.0 * draws.runs[0].log_likelihood.numpy()
    assert chi2.min() > fitted.chi2 - 1.0
    assert torch.equal(draw().theta, draws.theta)
