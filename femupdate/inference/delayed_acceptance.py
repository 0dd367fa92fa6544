"""Draws of a dear likelihood whose trajectories a cheap one finds.

Delayed acceptance (Christen & Fox 2005, J. Comput. Graph. Stat. 14, 795): what the cheap likelihood
accepts the dear one judges once more, so that the draws are the dear one's.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.inference.annealed import Told
from femupdate.inference.population import (
    AnnealedSettings,
    Population,
    State,
    Walk,
    grouped,
    metric,
)
from femupdate.inference.prior import UniformPrior
from femupdate.inference.smc import LogLikelihood
from femupdate.seeds import Seed


@dataclass(frozen=True)
class CorrectedDraws:
    """Draws of a dear likelihood whose trajectories a cheap one has found.

    Attributes:
        theta: (g, m, p).
        log_likelihood: (g, m), dear.
        acceptance: mean over the kept states, of both likelihoods.
        gradients: of the cheap log likelihood taken in all.
        dear: dear likelihoods taken.
    """

    theta: Tensor
    log_likelihood: Tensor
    acceptance: float
    gradients: int
    dear: int


def corrected_draws(
    prior: UniformPrior,
    cheap: LogLikelihood,
    dear: LogLikelihood,
    start: Population,
    draws: int,
    seed: Seed,
    settings: AnnealedSettings | None = None,
    told: Told | None = None,
) -> CorrectedDraws:
    """Draw at least so many states from prior times a dear likelihood that a cheap one resembles.

    Trajectories follow the cheap likelihood, and where they end the dear one is asked (delayed
    acceptance, Christen & Fox 2005, J. Comput. Graph. Stat. 14, 795): the draws are the dear
    likelihood's, at one of it a move and none of its slopes.

    Args:
        prior: of the parameters.
        cheap: log likelihood that the start is drawn with, differentiable by torch.
        dear: log likelihood.
        start: population.
        draws: to keep in all; every particle gives as many.
        seed: of everything random.
        settings: see `AnnealedSettings`.
        told: see `Told`.
    """
    chosen = settings or AnnealedSettings()
    walk = Walk(prior, cheap, None, chosen, seed)
    judge = _Judge(walk, dear, start)
    while judge.beta < 1.0:
        walk.check_levels(judge.beta)
        judge.raise_power()
        for _ in range(chosen.moves):
            judge.move()
    for _ in range(chosen.settle):
        judge.move()
    kept, shares = [], []
    turns = -(-draws // len(start.xi))
    for turn in range(turns):
        shares.append(judge.move())
        kept.append((walk.theta(judge.state.xi), judge.state.target + judge.gain))
        if told is not None:
            told((turn + 1) / turns)
    return CorrectedDraws(
        grouped([theta for theta, _ in kept], chosen.groups),
        grouped([value for _, value in kept], chosen.groups),
        sum(shares) / len(shares),
        start.gradients + walk.gradients,
        judge.asked,
    )


class _Judge:
    """A population that moves along the cheap likelihood and is judged by the dear one.

    Attributes:
        state: of the cheap likelihood.
        gain: (n,) dear less cheap log likelihood.
        beta: power that the gain is raised to.
        asked: dear likelihoods.
    """

    def __init__(self, walk: Walk, dear: LogLikelihood, start: Population) -> None:
        self._walk, self._dear = walk, dear
        self.state, self.beta, self.asked = walk.at_target(start), 0.0, 0
        self._factor = metric(self.state.xi, self.state.slope())
        self.gain = self._asked(self.state)

    def raise_power(self) -> None:
        """Go on to the next power."""
        found = self._walk.resampled(self.gain, 1.0 - self.beta)
        self.state, self.gain = self.state.rows(found.rows), self.gain[found.rows]
        self.beta = min(self.beta + found.increment, 1.0)

    def move(self) -> float:
        """One trajectory of every particle; the share that is accepted by both likelihoods."""
        tried, _ = self._walk.trajectory(self.state, self._factor)
        moved = (tried.xi != self.state.xi).any(dim=1)
        gain = self.gain.clone()
        gain[moved] = self._asked(tried.rows(moved.nonzero()[:, 0]))
        chance = (self.beta * (gain - self.gain)).clamp_max(0.0).exp()
        take = moved & (self._walk.uniform(len(chance)) < chance)
        self.state, self.gain = self.state.where(take, tried), torch.where(take, gain, self.gain)
        return float(take.double().mean())

    def _asked(self, state: State) -> Tensor:
        self.asked += len(state.xi)
        gain = self._dear(self._walk.theta(state.xi)).to(torch.float64) - state.target
        return torch.nan_to_num(gain, nan=-torch.inf, posinf=-torch.inf, neginf=-torch.inf)


__all__ = ["CorrectedDraws", "corrected_draws"]
