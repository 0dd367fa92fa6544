"""Tempered sequential Monte Carlo; how particles move is given to it.

The sampler walks from the prior to the posterior by raising a likelihood to powers beta from 0 to 1
(Neal 2001, Statistics and Computing 11, 125; Del Moral, Doucet & Jasra 2006, J. R. Statist. Soc. B
68, 411). Every level: next beta by the effective sample size, systematic resampling, then
Metropolis-Hastings moves of all particles in one batch. Particles in several groups share beta and
moves, but are resampled apart: whether the groups agree tells how well the posterior is known.
"""

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from femupdate.errors import InferenceError
from femupdate.inference.moves import (
    Hamiltonian,
    MixtureIndependence,
    RandomWalk,
    Schedule,
    distinct_rows,
)
from femupdate.inference.parameters import Parameters
from femupdate.inference.tempering import (
    Level,
    LogLikelihood,
    Points,
    SamplerRun,
    Tempered,
    effective_sample_size,
    next_increment,
    systematic_rows,
)
from femupdate.seeds import Seed, torch_generator

logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class SmcSettings:
    """Settings of the sampler.

    Attributes:
        ess_target: share of the particles that stay effective in a step of tempering.
        moves: of every particle at a level, at most.
        walk_scale: b of the random walk of covariance b^2 S (Ching & Chen 2007).
        independence_moves: of these, the first ones, from a mixture fitted to the particles.
        components: Students of that mixture, at most.
        most_levels: after which the sampler gives up.
        unmoved: share of the particles yet to move at which the moves of a level end (Buchholz,
            Chopin & Jacob 2021); 0 for all moves.
        rows: likelihoods whose derivatives are taken at a time.
    """

    ess_target: float = 0.5
    moves: int = 10
    walk_scale: float = 0.2
    independence_moves: int = 6
    components: int = 8
    most_levels: int = 200
    unmoved: float = 0.1
    rows: int = 128

    def schedule(self) -> Schedule:
        """The moves of a level: from a mixture, then a random walk."""
        first = max(0, min(self.independence_moves, self.moves))
        return (
            (MixtureIndependence(self.components), first),
            (RandomWalk(self.walk_scale), self.moves - first),
        )


TRAJECTORIES: Schedule = ((Hamiltonian(), 3),)
"""Three Hamiltonian trajectories a level, for groups of a few dozen particles."""

# Moves at the whole likelihood before draws are kept, in which the tuning rests.
_SETTLE = 6


@dataclass(frozen=True, kw_only=True)
class SmcState:
    """Everything needed to go on: particles, likelihoods, power, evidence and random state.

    Attributes:
        points: particles, one group after the other.
        log_evidence: of each group, so far.
        tuning: of each kind of move, see `MoveState`.
        levels: one record a level done.
        evaluations: of the likelihood, one a particle and move.
        invalid: how many of them gave no finite number.
    """

    points: Points
    beta: float
    log_evidence: tuple[float, ...]
    tuning: tuple[float, ...]
    levels: tuple[Level, ...]
    evaluations: int
    invalid: int
    random_state: Tensor

    @property
    def done(self) -> bool:
        """Whether the posterior is reached."""
        return self.beta >= 1.0


class TemperedSmc:
    """Sampler for prior x likelihood^beta.

    Args:
        prior: particles live in its standard normal coordinates.
        moves: kinds of moves in their order, and how many of each at a level; those of the
            settings where None.
    """

    def __init__(
        self,
        prior: Parameters,
        log_likelihood: LogLikelihood,
        settings: SmcSettings | None = None,
        moves: Schedule | None = None,
    ) -> None:
        self.prior, self._log_likelihood = prior, log_likelihood
        self.settings = settings or SmcSettings()
        self.moves = self.settings.schedule() if moves is None else moves

    def init(self, particles: int, seed: Seed, groups: int = 1) -> SmcState:
        """Draw the first particles from the prior.

        Args:
            groups: of particles that are resampled apart.

        Raises:
            InferenceError: no particle of a group has a finite likelihood, or there are fewer than
                two.
        """
        if particles < 2:
            raise InferenceError(
                f"the sampler cannot work with {particles} particles; use hundreds"
            )
        device = self.prior.device
        generator = torch_generator(seed, device)
        shape = particles, self.prior.size
        xi = torch.randn(*shape, generator=generator, dtype=torch.float64, device=device)
        density = self._density(0.0)
        points = density.at(xi, any(move.slopes for move, _ in self.moves))
        possible = torch.isfinite(points.log_likelihood).unflatten(0, (groups, -1))
        if not bool(possible.any(dim=1).all()):
            raise InferenceError(
                f"none of the {possible.shape[1]} first parameter sets has a finite likelihood for "
                "this observation; check that the file and the building belong together, or use "
                "more particles"
            )
        return SmcState(
            points=points,
            beta=0.0,
            log_evidence=(0.0,) * groups,
            tuning=(math.nan,) * len(self.moves),
            levels=(),
            evaluations=density.evaluations,
            invalid=density.invalid,
            random_state=generator.get_state(),
        )

    def step(self, state: SmcState) -> SmcState:
        """Go one tempering level up: raise the power, resample every group, move."""
        generator = _restored(state)
        gain = state.points.log_likelihood.unflatten(0, (len(state.log_evidence), -1))
        left, each = 1.0 - state.beta, gain.shape[1]
        beta = min(next_increment(chain, left, self.settings.ess_target) for chain in gain)
        log_weight = beta * gain
        rows = [
            k * each + systematic_rows(torch.softmax(chain, dim=0), generator)
            for k, chain in enumerate(log_weight)
        ]
        gained = (torch.logsumexp(log_weight, dim=1) - math.log(each)).tolist()
        raised = replace(
            state,
            points=state.points.rows(torch.cat(rows)),
            beta=min(state.beta + beta, 1.0),
            log_evidence=tuple(a + b for a, b in zip(state.log_evidence, gained, strict=True)),
        )
        moved, acceptance = self._moved(raised, generator)
        ess = sum(effective_sample_size(chain) for chain in log_weight)
        unique = distinct_rows(moved.points.xi) / len(moved.points.xi)
        level = Level(moved.beta, ess, acceptance, unique)
        logger.debug("level %d: %s", len(state.levels) + 1, level)
        return replace(moved, levels=(*state.levels, level), random_state=generator.get_state())

    def reach(
        self, state: SmcState, progress: Callable[[SmcState], None] | None = None
    ) -> SmcState:
        """Go on to the posterior; `progress` sees the state after every level.

        Raises:
            InferenceError: too many levels.
        """
        while not state.done:
            if len(state.levels) >= self.settings.most_levels:
                raise InferenceError(
                    f"the sampler reached only beta = {state.beta:.3g} in "
                    f"{self.settings.most_levels} levels; use more particles, and check that the "
                    "observation and the building belong together"
                )
            state = self.step(state)
            if progress is not None:
                progress(state)
        return state

    def run(
        self, particles: int, seed: Seed, progress: Callable[[SmcState], None] | None = None
    ) -> SamplerRun:
        """Sample to the end with one group.

        Raises:
            InferenceError: no finite likelihood, or too many levels.
        """
        end = self.reach(self.init(particles, seed), progress)
        return SamplerRun(
            theta=self._density(1.0).parameters(end.points.xi).cpu(),
            log_likelihood=end.points.log_likelihood.cpu(),
            log_evidence=end.log_evidence[0],
            evaluations=end.evaluations,
            levels=end.levels,
            invalid=end.invalid,
        )

    def draws(
        self, state: SmcState, count: int, progress: Callable[[float], None] | None = None
    ) -> list[SamplerRun]:
        """At least so many states of the posterior, by the first move: one run a group.

        Every particle gives as many. Moves keep their tuning once they have settled.
        """
        generator, density, points = _restored(state), self._density(1.0), state.points
        move = self.moves[0][0]
        tuned = move.init(density, points, state.tuning[0], generator)
        for _ in range(_SETTLE):
            points, tuned, _ = move.step(density, points, tuned, generator)
        theta, value, shares, turns = [], [], [], -(-count // len(points.xi))
        groups = len(state.log_evidence)
        for turn in range(turns):
            points, _, share = move.step(density, points, tuned, generator)
            theta.append(density.parameters(points.xi).unflatten(0, (groups, -1)))
            value.append(points.log_likelihood.unflatten(0, (groups, -1)))
            shares.append(share)
            if progress is not None:
                progress((turn + 1) / turns)
        parts = zip(torch.cat(theta, 1), torch.cat(value, 1), state.log_evidence, strict=True)
        return [
            SamplerRun(
                theta=drawn.cpu(),
                log_likelihood=likelihood.cpu(),
                log_evidence=evidence,
                evaluations=(state.evaluations + density.evaluations) // groups,
                levels=state.levels,
                invalid=(state.invalid + density.invalid) // groups,
                acceptance=sum(shares) / len(shares),
            )
            for drawn, likelihood, evidence in parts
        ]

    def _density(self, beta: float) -> Tempered:
        return Tempered(self.prior, self._log_likelihood, beta, self.settings.rows)

    def _moved(
        self, state: SmcState, generator: torch.Generator
    ) -> tuple[SmcState, tuple[float, ...]]:
        """The state after the moves of a level, and the mean acceptance of each kind."""
        density, points = self._density(state.beta), state.points
        # Copies of few points need all moves to part.
        parted = distinct_rows(points.xi) > 0.25 * len(points.xi)
        enough, start, unmoved = self.settings.unmoved if parted else 0.0, points.xi, 1.0
        tuning, acceptance = [], []
        for (move, count), tuned in zip(self.moves, state.tuning, strict=True):
            shares: list[float] = []
            if count and unmoved >= enough:
                within = move.init(density, points, tuned, generator)
                while len(shares) < count and unmoved >= enough:
                    points, within, share = move.step(density, points, within, generator)
                    shares.append(share)
                    unmoved = float((points.xi == start).all(dim=1).to(torch.float64).mean())
                tuned = within.tuning
            tuning.append(tuned)
            acceptance.append(sum(shares) / len(shares) if shares else math.nan)
        moved = replace(
            state,
            points=points,
            tuning=tuple(tuning),
            evaluations=state.evaluations + density.evaluations,
            invalid=state.invalid + density.invalid,
        )
        return moved, tuple(acceptance)


def _restored(state: SmcState) -> torch.Generator:
    """A generator that goes on where a state left it."""
    generator = torch.Generator(device=state.points.xi.device)
    generator.set_state(state.random_state)
    return generator
