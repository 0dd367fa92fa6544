"""Tempered sequential Monte Carlo with a mixture-independence move.

The sampler walks from the prior (or from a cheap likelihood already sampled) to the posterior by
raising a likelihood to powers beta from 0 to 1 (Del Moral, Doucet & Jasra 2006; Ching & Chen 2007
for the random walk of covariance b^2 S). Every level: next beta by the effective sample size,
systematic resampling, then Metropolis-Hastings moves of all particles in one batch.
"""

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from femupdate.errors import InferenceError
from femupdate.inference.mixture import StudentMixture, fit_mixture
from femupdate.inference.prior import UniformPrior
from femupdate.inference.tempering import effective_sample_size, next_increment, systematic_rows
from femupdate.seeds import Seed, torch_generator

logger = logging.getLogger(__name__)

# Distinct particles that a component of the fitted mixture needs, a coordinate and its weight.
_DISTINCT_PER_COORDINATE = 5
# The mixture reaches beyond the particles, which lag behind where the likelihood moves on.
_FREEDOM, _WIDEN = 4, 1.5
# More particles than this a component do not make the mixture better.
_FITTED_PER_COMPONENT = 500

LogLikelihood = Callable[[Tensor], Tensor]
"""Log likelihood (n,) of parameters theta (n, p)."""


@dataclass(frozen=True)
class SmcSettings:
    """Settings of the sampler; see also `PAPER` and `THOROUGH`.

    Attributes:
        ess_target: effective sample size that a tempering step keeps, as a share of the particles.
        moves: Metropolis-Hastings moves a level.
        walk_scale: b of the random walk's covariance b^2 S, S that of the particles.
        independence_moves: how many of the moves propose from a fitted Gaussian mixture instead.
        components: Gaussians in that mixture.
        most_levels: give up after so many levels.
        unmoved: stop the moves of a level once no more than this share of the particles has yet
            to move (the adaptive number of moves of Buchholz, Chopin & Jacob 2021); 0 for always
            all moves.
    """

    ess_target: float = 0.5
    moves: int = 10
    walk_scale: float = 0.2
    independence_moves: int = 6
    components: int = 8
    most_levels: int = 200
    unmoved: float = 0.1


PAPER = SmcSettings(ess_target=0.8, independence_moves=0, unmoved=0.0)
"""The published sampler: ten random-walk moves a level, b = .2, 80 % effective."""

THOROUGH = SmcSettings(ess_target=0.8, unmoved=0.0)
"""Five to seven times the likelihoods of the default, hardly less spread over runs."""


@dataclass(frozen=True)
class Level:
    """What happened at one tempering level."""

    beta: float
    ess: float
    acceptance_walk: float
    acceptance_independence: float
    unique: float


@dataclass(frozen=True)
class SmcState:
    """Everything needed to go on: particles, likelihoods, power, evidence and random state.

    Attributes:
        xi: (n, p) particles in standard normal coordinates.
        base: (n,) log likelihood that the walk starts from (zero for the prior).
        target: (n,) log likelihood that it goes to.
        beta: power reached.
        log_evidence: log of the ratio of normalising constants so far.
        levels: one record a level done.
        evaluations: of the target likelihood, one a particle and move.
        invalid: how many of them gave no finite number.
        random_state: state of the generator.
    """

    xi: Tensor
    base: Tensor
    target: Tensor
    beta: float
    log_evidence: float
    levels: tuple[Level, ...]
    evaluations: int
    invalid: int
    random_state: Tensor

    @property
    def done(self) -> bool:
        """Whether the posterior is reached."""
        return self.beta >= 1.0


@dataclass(frozen=True)
class SmcResult:
    """Equally weighted draws from the posterior.

    Attributes:
        theta: (n, p).
        log_likelihood: (n,) of the target.
        log_evidence: log of the target's evidence (relative to the base's).
        levels: one record a level.
        evaluations: target likelihoods evaluated.
        invalid: evaluations that gave no finite number; all count as impossible.
    """

    theta: Tensor
    log_likelihood: Tensor
    log_evidence: float
    levels: tuple[Level, ...]
    evaluations: int
    invalid: int


class TemperedSmc:
    """Sampler for prior x base^(1 - beta) x target^beta.

    Args:
        prior: uniform prior; particles live in its standard normal coordinates.
        target: log likelihood wanted.
        base: log likelihood to start from; None for the prior alone.
        settings: see `SmcSettings`.
    """

    def __init__(
        self,
        prior: UniformPrior,
        target: LogLikelihood,
        base: LogLikelihood | None = None,
        settings: SmcSettings | None = None,
    ) -> None:
        self.prior = prior
        self._target = target
        self._base = base
        self.settings = settings or SmcSettings()

    def init(self, particles: int, seed: Seed, start: Tensor | None = None) -> SmcState:
        """Draw the first particles, or take them from draws of the base.

        Args:
            particles: how many to draw from the prior; not used where `start` is given.
            seed: of everything random.
            start: (n, p) theta drawn from prior times base.

        Raises:
            InferenceError: no particle has a finite likelihood, there are fewer than two, or a
                start lies outside the prior's box.
        """
        generator = torch_generator(seed, self.prior.lower.device)
        if start is None:
            xi = torch.randn(
                particles,
                self.prior.size,
                generator=generator,
                dtype=torch.float64,
                device=self.prior.lower.device,
            )
        else:
            xi = self._started(start)
        if len(xi) < 2:
            raise InferenceError(f"the sampler cannot work with {len(xi)} particles; use hundreds")
        base, target, invalid = self._evaluate(xi)
        if not bool(torch.isfinite(_difference(target, base)).any()):
            raise InferenceError(
                f"none of the {len(xi)} first parameter sets has a finite likelihood for this "
                "observation; check that the file and the building belong together, or use more "
                "particles"
            )
        return SmcState(xi, base, target, 0.0, 0.0, (), len(xi), invalid, generator.get_state())

    def step(self, state: SmcState) -> SmcState:
        """Go one tempering level up."""
        generator = torch.Generator(device=state.xi.device)
        generator.set_state(state.random_state)
        gain = _difference(state.target, state.base)
        increment = next_increment(gain, 1.0 - state.beta, self.settings.ess_target)
        log_weight = increment * gain
        beta = min(state.beta + increment, 1.0)
        rows = systematic_rows(torch.softmax(log_weight, dim=0), generator)
        moved = replace(
            state,
            xi=state.xi[rows],
            base=state.base[rows],
            target=state.target[rows],
            beta=beta,
            log_evidence=state.log_evidence
            + float(torch.logsumexp(log_weight, dim=0))
            - math.log(len(log_weight)),
        )
        moved, accepted = self._move(moved, generator)
        level = Level(
            beta,
            effective_sample_size(log_weight),
            *accepted,
            unique=_distinct(moved.xi) / len(moved.xi),
        )
        logger.debug("level %d: %s", len(state.levels) + 1, level)
        return replace(moved, levels=(*state.levels, level), random_state=generator.get_state())

    def run(
        self,
        particles: int,
        seed: Seed,
        *,
        start: Tensor | None = None,
        state: SmcState | None = None,
        progress: Callable[[SmcState], None] | None = None,
    ) -> SmcResult:
        """Sample to the end; `progress` sees the state after every level.

        A `state` from an earlier run is gone on from; particles, seed and start then do not count.

        Raises:
            InferenceError: no finite likelihood, or too many levels.
        """
        state = self.init(particles, seed, start) if state is None else state
        while not state.done:
            if len(state.levels) >= self.settings.most_levels:
                raise InferenceError(
                    f"the sampler reached only beta = {state.beta:.3g} in "
                    f"{self.settings.most_levels} levels; use more particles"
                )
            state = self.step(state)
            if progress is not None:
                progress(state)
        return SmcResult(
            self.prior.from_normal(state.xi),
            state.target,
            state.log_evidence,
            state.levels,
            state.evaluations,
            state.invalid,
        )

    def _started(self, start: Tensor) -> Tensor:
        """Standard normal coordinates of draws in the box, finite on its very bounds too."""
        unit = self.prior.to_unit(start.to(self.prior.lower))
        # Rounding alone can carry a draw past a bound.
        if not bool(((unit > -1e-6) & (unit < 1.0 + 1e-6)).all()):
            raise InferenceError(
                "the draws to start from leave the box of the prior; draw them under this prior"
            )
        least = torch.finfo(unit.dtype).eps / 2.0
        return torch.special.ndtri(unit.clamp(least, 1.0 - least))

    def _evaluate(self, xi: Tensor) -> tuple[Tensor, Tensor, int]:
        theta = self.prior.from_normal(xi)
        target = self._target(theta).to(torch.float64)
        base = torch.zeros_like(target) if self._base is None else self._base(theta)
        wrong = torch.isnan(target) | torch.isposinf(target)
        target = torch.where(wrong, -torch.inf, target)
        return base.to(torch.float64), target, int((wrong | torch.isneginf(target)).sum())

    def _log_density(self, xi: Tensor, base: Tensor, target: Tensor, beta: float) -> Tensor:
        tempered = base + beta * _difference(target, base)
        return self.prior.log_density_normal(xi) + tempered

    def _move(
        self, state: SmcState, generator: torch.Generator
    ) -> tuple[SmcState, tuple[float, float]]:
        """Run the moves of a level; return the state and the mean acceptance of each kind."""
        settings = self.settings
        independent = max(0, min(settings.independence_moves, settings.moves))
        mixture = self._fit(state.xi, generator) if independent else None
        factor = settings.walk_scale * _covariance_factor(state.xi)
        accepted: dict[bool, list[float]] = {True: [], False: []}
        # Copies of few points need all moves to part.
        enough = settings.unmoved if _distinct(state.xi) > 0.25 * len(state.xi) else 0.0
        start, unmoved = state.xi, 1.0
        for move in range(settings.moves):
            if unmoved < enough:
                break
            by_mixture = mixture is not None and move < independent
            if by_mixture:
                assert mixture is not None
                proposal = mixture.sample(len(state.xi), generator)
                correction = mixture.log_density(state.xi) - mixture.log_density(proposal)
            else:
                noise = torch.randn(
                    state.xi.shape,
                    generator=generator,
                    dtype=state.xi.dtype,
                    device=state.xi.device,
                )
                proposal = state.xi + noise @ factor.T
                correction = torch.zeros_like(state.target)
            state, share = self._accept(state, proposal, correction, generator)
            accepted[by_mixture].append(share)
            unmoved = float((state.xi == start).all(dim=1).to(torch.float64).mean())
        return state, (_mean(accepted[False]), _mean(accepted[True]))

    def _fit(self, xi: Tensor, generator: torch.Generator) -> StudentMixture:
        """A mixture of the particles, of fewer components where few of them are distinct.

        Resampling of a small share leaves many copies: components on a few points each would
        propose those points again and again.
        """
        distinct = _distinct(xi)
        most = max(1, distinct // (_DISTINCT_PER_COORDINATE * (xi.shape[1] + 1)))
        components = min(self.settings.components, most)
        some = _FITTED_PER_COMPONENT * self.settings.components
        if len(xi) > some:
            xi = xi[torch.randperm(len(xi), generator=generator, device=xi.device)[:some]]
        fitted = fit_mixture(xi, components, generator)
        return StudentMixture(fitted.widened(_WIDEN), _FREEDOM)

    def _accept(
        self,
        state: SmcState,
        proposal: Tensor,
        correction: Tensor,
        generator: torch.Generator,
    ) -> tuple[SmcState, float]:
        base, target, invalid = self._evaluate(proposal)
        log_ratio = (
            self._log_density(proposal, base, target, state.beta)
            - self._log_density(state.xi, state.base, state.target, state.beta)
            + correction
        )
        uniform = torch.rand(
            len(log_ratio), generator=generator, dtype=log_ratio.dtype, device=log_ratio.device
        )
        take = uniform.log() < torch.nan_to_num(log_ratio, nan=-torch.inf)
        moved = replace(
            state,
            xi=torch.where(take[:, None], proposal, state.xi),
            base=torch.where(take, base, state.base),
            target=torch.where(take, target, state.target),
            evaluations=state.evaluations + len(target),
            invalid=state.invalid + invalid,
        )
        return moved, float(take.to(torch.float64).mean())


def _difference(target: Tensor, base: Tensor) -> Tensor:
    """target - base, minus infinity where either says impossible."""
    possible = torch.isfinite(target) & torch.isfinite(base)
    return torch.where(possible, target - base, -torch.inf)


def _covariance_factor(xi: Tensor) -> Tensor:
    """Lower factor of the particles' covariance, with a ridge for degenerate sets."""
    covariance = torch.cov(xi.T).reshape(xi.shape[1], xi.shape[1])
    ridge = 1e-10 * torch.eye(xi.shape[1], dtype=xi.dtype, device=xi.device)
    return torch.linalg.cholesky(covariance + ridge)


def _distinct(xi: Tensor) -> int:
    """Number of different rows; a row's first coordinate tells it from all others."""
    return len(torch.unique(xi[:, 0]))


def _mean(values: list[float]) -> float:
    return sum(values) / len(values) if values else math.nan
