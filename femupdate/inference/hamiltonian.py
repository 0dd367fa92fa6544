"""Hamiltonian Monte Carlo from Gaussians at the maxima of a posterior, many chains at once.

In dozens of dimensions the posterior of stiffness factors is a thin curved sheet: what the data
determine well bends along what they leave open, and no mixture of Gaussians covers it. Trajectories
of Hamiltonian dynamics (Neal 2011, Handbook of Markov Chain Monte Carlo, ch. 5) follow the bends;
the covariance at a maximum is their metric, and the step is adapted by dual averaging (Hoffman &
Gelman 2014, J. Mach. Learn. Res. 15, 1593, section 3.2).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.errors import InferenceError
from femupdate.inference.laplace import LaplaceStart
from femupdate.inference.prior import UniformPrior
from femupdate.inference.smc import LogLikelihood

# First step, in standard deviations of the Gaussian.
_FIRST_STEP = 0.1
# Dual averaging: shrinkage, delay and forgetting, as published.
_SHRINKAGE, _DELAY, _FORGETTING = 0.05, 10.0, 0.75


@dataclass(frozen=True)
class HamiltonianSettings:
    """How chains run.

    Attributes:
        warm_up: trajectories thrown away, in which the step is adapted.
        length: mean length of a trajectory, in standard deviations of the Gaussian at the maximum.
        acceptance: aimed at.
        most_steps: of a trajectory.
        rows: likelihoods whose derivatives are taken at a time; with responses of a building more
            do not go faster on a processor.
    """

    warm_up: int = 40
    length: float = 3.0
    acceptance: float = 0.7
    most_steps: int = 50
    rows: int = 8


@dataclass(frozen=True)
class HamiltonianResult:
    """Draws of chains that ran side by side.

    Attributes:
        theta: (c, n, p).
        log_likelihood: (c, n).
        acceptance: mean after the warm-up.
        step: in standard deviations of the Gaussian.
        gradients: of the log likelihood, one a chain and step.
    """

    theta: Tensor
    log_likelihood: Tensor
    acceptance: float
    step: float
    gradients: int


@dataclass(frozen=True)
class _State:
    """Whitened coordinates (c, p), log posterior (c,), log likelihood (c,) and slope (c, p)."""

    u: Tensor
    log_density: Tensor
    log_likelihood: Tensor
    slope: Tensor

    def where(self, take: Tensor, other: "_State") -> "_State":
        """Rows of `other` where `take` (c,), own rows elsewhere."""
        return _State(
            torch.where(take[:, None], other.u, self.u),
            torch.where(take, other.log_density, self.log_density),
            torch.where(take, other.log_likelihood, self.log_likelihood),
            torch.where(take[:, None], other.slope, self.slope),
        )


def hamiltonian_draws(
    prior: UniformPrior,
    log_likelihood: LogLikelihood,
    start: LaplaceStart,
    chains: int,
    draws: int,
    seed: int,
    settings: HamiltonianSettings | None = None,
    progress: Callable[[int], None] | None = None,
) -> HamiltonianResult:
    """Run `chains` side by side, each from one of the maxima, for `draws` kept states each.

    A chain seldom leaves a maximum that is well separated: chains share the maxima by the masses
    of their Gaussians.

    Args:
        prior: of the parameters.
        log_likelihood: differentiable by torch.
        start: Gaussians at the maxima.
        chains: how many.
        draws: kept states of each.
        seed: of everything random.
        settings: see `HamiltonianSettings`.
        progress: called with the number of trajectories done since the last call.

    Raises:
        InferenceError: no chain has a finite likelihood to start from.
    """
    chosen = settings or HamiltonianSettings()
    generator = torch.Generator(device=prior.lower.device).manual_seed(seed)
    target = _Target(prior, log_likelihood, start, chains, chosen.rows, generator)
    state = target(prior.lower.new_zeros(chains, prior.size))
    if not bool(torch.isfinite(state.log_density).any()):
        raise InferenceError("no chain has a finite likelihood near the maxima that were found")
    step, kept, shares = _StepSize(chosen.acceptance), [], []
    for turn in range(chosen.warm_up + draws):
        warming = turn < chosen.warm_up
        size = step.current if warming else step.settled
        state, share = _trajectory(target, state, size, chosen, generator)
        if warming:
            step.learn(share)
        else:
            kept.append((target.theta(state.u), state.log_likelihood))
            shares.append(share)
        if progress is not None:
            progress(1)
    return HamiltonianResult(
        torch.stack([theta for theta, _ in kept], dim=1),
        torch.stack([value for _, value in kept], dim=1),
        sum(shares) / len(shares),
        step.settled,
        target.count,
    )


class _Target:
    """Log posterior and its slope, in coordinates whitened by the Gaussian of each chain."""

    def __init__(
        self,
        prior: UniformPrior,
        log_likelihood: LogLikelihood,
        start: LaplaceStart,
        chains: int,
        rows: int,
        generator: torch.Generator,
    ) -> None:
        self._prior, self._log_likelihood, self._rows = prior, log_likelihood, rows
        mixture = start.proposal.gaussian
        # Systematic, so that the shares of the maxima are kept to one chain.
        places = torch.rand(1, generator=generator, dtype=torch.float64, device=mixture.mean.device)
        points = (torch.arange(chains).to(mixture.mean) + places) / chains
        edges = mixture.log_weight.exp().cumsum(0)
        member = torch.searchsorted(edges / edges[-1], points).clamp_max(len(edges) - 1)
        self._mean, self._factor = mixture.mean[member], mixture.cholesky[member]
        self.count = 0

    def normal(self, u: Tensor) -> Tensor:
        """Standard normal coordinates of the prior (c, p)."""
        return self._mean + (self._factor @ u[..., None])[..., 0]

    def theta(self, u: Tensor) -> Tensor:
        """Parameters (c, p)."""
        return self._prior.from_normal(self.normal(u).clamp(-8.0, 8.0))

    def __call__(self, u: Tensor) -> _State:
        self.count += len(u)
        xi = self.normal(u)
        parts = [self._likelihood(rows) for rows in xi.clamp(-8.0, 8.0).split(self._rows)]
        value = torch.cat([value for value, _ in parts])
        slope = torch.cat([slope for _, slope in parts]) - xi
        whitened = (self._factor.transpose(1, 2) @ slope[..., None])[..., 0]
        finite = torch.isfinite(value) & torch.isfinite(whitened).all(dim=1)
        density = torch.where(finite, value + self._prior.log_density_normal(xi), -torch.inf)
        return _State(u, density, value, torch.nan_to_num(whitened, 0.0, 0.0, 0.0))

    def _likelihood(self, xi: Tensor) -> tuple[Tensor, Tensor]:
        free = xi.detach().requires_grad_()
        value = self._log_likelihood(self._prior.from_normal(free)).to(torch.float64)
        (slope,) = torch.autograd.grad(value.sum(), free)
        return value.detach(), slope


def _trajectory(
    target: _Target,
    state: _State,
    size: float,
    settings: HamiltonianSettings,
    generator: torch.Generator,
) -> tuple[_State, float]:
    """One trajectory of every chain by the leapfrog rule; the states and the mean acceptance."""

    def uniform(shape: int) -> Tensor:
        return torch.rand(shape, generator=generator, dtype=state.u.dtype, device=state.u.device)

    # Lengths that vary keep trajectories from closing on themselves, short steps now and then get
    # chains out of sharp bends.
    length = settings.length * float(0.5 + uniform(1))
    size *= float(0.4 + 0.8 * uniform(1))
    steps = max(1, min(settings.most_steps, math.ceil(length / size)))
    velocity = torch.randn(
        state.u.shape, generator=generator, dtype=state.u.dtype, device=state.u.device
    )
    energy = state.log_density - 0.5 * velocity.square().sum(1)
    end = state
    for _ in range(steps):
        velocity = velocity + 0.5 * size * end.slope
        end = target(end.u + size * velocity)
        velocity = velocity + 0.5 * size * end.slope
    gain = end.log_density - 0.5 * velocity.square().sum(1) - energy
    chance = torch.nan_to_num(gain, nan=-torch.inf).clamp_max(0.0).exp()
    return state.where(uniform(len(chance)) < chance, end), float(chance.mean())


class _StepSize:
    """Dual averaging of the logarithm of the step, on the mean acceptance of all chains."""

    def __init__(self, acceptance: float) -> None:
        self._wanted, self._turn, self._error = acceptance, 0, 0.0
        self.current = self.settled = _FIRST_STEP

    def learn(self, share: float) -> None:
        """Take the acceptance of a trajectory in."""
        self._turn += 1
        weight = 1.0 / (self._turn + _DELAY)
        self._error += weight * (self._wanted - share - self._error)
        log_step = math.log(10.0 * _FIRST_STEP) - math.sqrt(self._turn) / _SHRINKAGE * self._error
        self.current = math.exp(log_step)
        forget = self._turn**-_FORGETTING
        self.settled = math.exp(forget * log_step + (1.0 - forget) * math.log(self.settled))
