"""Draws of a fitted model's posterior, by importance sampling about its most probable parameters.

For a posterior with one mode, which a model fitted to many floors has, this costs a thousand
responses where tempering costs fifty thousand; the effective number of draws says how far to trust
them.
"""

from dataclasses import dataclass

from torch import Tensor

from femupdate.arrays import Floats
from femupdate.discrepancy.fit import Fit
from femupdate.discrepancy.likelihood import EffectLikelihood, likelihood_about
from femupdate.discrepancy.problem import Problem
from femupdate.errors import InferenceError
from femupdate.inference.importance import WeightedDraws
from femupdate.inference.maxima import draws_about, found_from
from femupdate.seeds import Seed, spawn


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws of a fitted model's posterior.

    Attributes:
        likelihood: of its parameters, and their prior.
        weighted: the draws with their weights.
        parameters: (n, p) equally weighted ones.
        log_likelihood: (n,) of these.
    """

    likelihood: EffectLikelihood
    weighted: WeightedDraws
    parameters: Tensor
    log_likelihood: Tensor

    @property
    def theta(self) -> Floats:
        """(n, q) stiffness factors."""
        return self.likelihood.prior.split(self.parameters).theta.numpy()


def draw(problem: Problem, fitted: Fit, count: int, seed: Seed = 0) -> Draws:
    """Draw from the posterior of a fitted model.

    Args:
        problem: structure and data.
        fitted: the model at its most probable parameters.
        count: number of draws, and of weighted ones behind them.
        seed: of everything random.

    Raises:
        InferenceError: no draw about the fit is possible.
    """
    weighing, choosing = spawn(seed, 2)
    likelihood = likelihood_about(problem, fitted)
    prior, start = likelihood.prior, likelihood.parameters_of(fitted)
    found = found_from(prior, likelihood.residuals, start)
    weighted = draws_about(prior, likelihood, found, count, weighing, least=0.0)
    if weighted is None:
        raise InferenceError("no draw about the fit is possible; the data say too little")
    return Draws(likelihood, weighted, *weighted.resample(count, choosing))
