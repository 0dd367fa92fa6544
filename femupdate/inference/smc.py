"""Tempered sequential Monte Carlo; how particles move is given to it.

The sampler walks from the prior (or from a cheap likelihood already sampled) to the posterior by
raising a likelihood to powers beta from 0 to 1 (Neal 2001, Statistics and Computing 11, 125; Del
Moral, Doucet & Jasra 2006, J. R. Statist. Soc. B 68, 411). Every level: next beta by the effective
sample size, systematic resampling, then Metropolis-Hastings moves of all particles in one batch.
Particles in several groups share beta and moves, but are resampled apart: whether the groups agree
tells how well the posterior is known.
"""

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from femupdate.errors import InferenceError
from femupdate.inference.hamiltonian import Hamiltonian
from femupdate.inference.moves import (
    MixtureIndependence,
    RandomWalk,
    Schedule,
    distinct_rows,
)
from femupdate.inference.parameters import Parameters
from femupdate.inference.sampler_run import Level, SamplerRun
from femupdate.inference.tempering import (
    LogLikelihood,
    Points,
    Slopes,
    Tempered,
    effective_sample_size,
    next_increment,
    systematic_rows,
)
from femupdate.inference.thresholds import DRAWS
from femupdate.seeds import Seed, torch_generator
from femupdate.thresholds import entry

logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class SmcSettings:
    """Settings of the sampler by tempering; see also `PAPER`, `THOROUGH` and `POPULATION`."""

    ess_target: float = entry(
        0.5, "share", "of the particles that stay effective in a step of tempering"
    )
    moves: int = entry(10, "moves", "of every particle at a level", "the published sampler")
    walk_scale: float = entry(
        0.2, "sd", "b of the random walk of covariance b^2 S", "Ching and Chen (2007)"
    )
    independence_moves: int = entry(
        6, "moves", "of these, the first ones, from Gaussians fitted to the particles"
    )
    components: int = entry(8, "Gaussians", "that are fitted")
    most_levels: int = entry(200, "levels", "after which the sampler gives up")
    unmoved: float = entry(
        0.1,
        "share",
        "of the particles yet to move at which the moves of a level end; 0 for all moves",
        "adaptive as in Buchholz, Chopin and Jacob (2021)",
    )
    groups: int = entry(1, "groups", "of particles that are resampled apart")
    rows: int = entry(128, "likelihoods", "whose derivatives are taken at a time")
    settle: int = entry(
        6, "moves", "at the whole likelihood before draws are kept, in which the tuning rests"
    )

    def schedule(self) -> Schedule:
        """The moves of a level: from a mixture, then a random walk."""
        first = max(0, min(self.independence_moves, self.moves))
        return (
            (MixtureIndependence(self.components), first),
            (RandomWalk(self.walk_scale), self.moves - first),
        )


PAPER = SmcSettings(ess_target=0.8, independence_moves=0, unmoved=0.0)
"""The published sampler: ten random-walk moves a level, b = .2, 80 % effective."""

THOROUGH = SmcSettings(ess_target=0.8, unmoved=0.0)
"""Five to seven times the likelihoods of the default, hardly less spread over runs."""

POPULATION = SmcSettings(unmoved=0.0, groups=4)
"""Groups of a few dozen particles, for Hamiltonian moves."""

TRAJECTORIES: Schedule = ((Hamiltonian(), 3),)
"""Three Hamiltonian trajectories a level."""


@dataclass(frozen=True, kw_only=True)
class SmcState:
    """Everything needed to go on: particles, likelihoods, power, evidence and random state.

    Attributes:
        points: particles, one group after the other.
        beta: power reached.
        log_evidence: of each group, log of the ratio of normalising constants so far.
        tuning: of each kind of move, see `MoveState`.
        levels: one record a level done.
        evaluations: of the target likelihood, one a particle and move.
        invalid: how many of them gave no finite number.
        random_state: state of the generator.
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


@dataclass(frozen=True)
class KeptDraws:
    """States of the particles at the whole likelihood, after one another.

    Attributes:
        theta: (g, m, p).
        log_likelihood: (g, m) of the target.
        acceptance: mean over the kept states.
        state: after the last of them.
    """

    theta: Tensor
    log_likelihood: Tensor
    acceptance: float
    state: SmcState


class TemperedSmc:
    """Sampler for prior x base^(1 - beta) x target^beta.

    Args:
        prior: particles live in its standard normal coordinates.
        target: log likelihood wanted.
        base: log likelihood to start from; None for the prior alone.
        settings: see `SmcSettings`.
        moves: kinds of moves in their order, and how many of each at a level; those of the
            settings where None.
    """

    def __init__(
        self,
        prior: Parameters,
        target: LogLikelihood,
        base: LogLikelihood | None = None,
        settings: SmcSettings | None = None,
        moves: Schedule | None = None,
    ) -> None:
        self.prior, self._target, self._base = prior, target, base
        self.settings = settings or SmcSettings()
        self.moves = self.settings.schedule() if moves is None else moves

    def init(self, particles: int, seed: Seed, start: Tensor | None = None) -> SmcState:
        """Draw the first particles, or take them from draws of the base.

        Args:
            particles: how many to draw from the prior; not used where `start` is given.
            seed: of everything random.
            start: (n, p) parameters drawn from prior times base.

        Raises:
            InferenceError: no particle of a group has a finite likelihood, there are fewer than
                two, or a start lies outside the prior's box.
        """
        device = self.prior.device
        generator = torch_generator(seed, device)
        if start is None:
            shape = particles, self.prior.size
            xi = torch.randn(*shape, generator=generator, dtype=torch.float64, device=device)
        else:
            xi = self._started(start)
        tuning = (math.nan,) * len(self.moves)
        return self._at_base(xi, generator, tuning, (0.0,) * self.settings.groups)

    def taken_over(self, other: SmcState, seed: Seed) -> SmcState:
        """The particles of a run that the base has drawn, with its tuning; counts add up."""
        generator = torch_generator(seed, other.points.xi.device)
        state = self._at_base(other.points.xi, generator, other.tuning, other.log_evidence)
        return replace(
            state,
            levels=other.levels,
            evaluations=other.evaluations + state.evaluations,
            invalid=other.invalid + state.invalid,
        )

    def step(self, state: SmcState) -> SmcState:
        """Go one tempering level up."""
        generator = torch.Generator(device=state.points.xi.device)
        generator.set_state(state.random_state)
        raised, ess = self._raised(state, generator)
        moved, acceptance = self._moved(raised, generator)
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
        first = len(state.levels)
        while not state.done:
            if len(state.levels) - first >= self.settings.most_levels:
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
        self,
        particles: int,
        seed: Seed,
        *,
        start: Tensor | None = None,
        state: SmcState | None = None,
        progress: Callable[[SmcState], None] | None = None,
    ) -> SamplerRun:
        """Sample to the end with one group.

        A `state` from an earlier run is gone on from; particles, seed and start then do not count.

        Raises:
            InferenceError: no finite likelihood, or too many levels.
        """
        end = self.reach(self.init(particles, seed, start) if state is None else state, progress)
        return SamplerRun(
            theta=self._density(1.0).parameters(end.points.xi),
            log_likelihood=end.points.target,
            log_evidence=end.log_evidence[0],
            evaluations=end.evaluations,
            levels=end.levels,
            invalid=end.invalid,
        )

    def draws(
        self, state: SmcState, count: int, progress: Callable[[float], None] | None = None
    ) -> KeptDraws:
        """At least so many states of the posterior, of all groups together, by the first move.

        Every particle gives as many. Moves keep their tuning once they have settled.
        """
        generator = torch.Generator(device=state.points.xi.device)
        generator.set_state(state.random_state)
        move, density, points = self.moves[0][0], self._density(1.0), state.points
        tuned = move.init(density, points, state.tuning[0], generator)
        for _ in range(self.settings.settle):
            points, tuned, _ = move.step(density, points, tuned, generator)
        kept, shares, turns = [], [], -(-count // len(points.xi))
        for turn in range(turns):
            points, _, share = move.step(density, points, tuned, generator)
            kept.append((density.parameters(points.xi), points.target))
            shares.append(share)
            if progress is not None:
                progress((turn + 1) / turns)
        theta, value = (self._grouped(parts) for parts in zip(*kept, strict=True))
        end = replace(
            state,
            points=points,
            tuning=(tuned.tuning, *state.tuning[1:]),
            evaluations=state.evaluations + density.evaluations,
            invalid=state.invalid + density.invalid,
            random_state=generator.get_state(),
        )
        return KeptDraws(theta, value, sum(shares) / len(shares), end)

    def _density(self, beta: float) -> Tempered:
        return Tempered(self.prior, self._target, self._base, beta, self.settings.rows)

    @property
    def _slopes(self) -> Slopes:
        """What the moves need together."""
        needed = {move.slopes for move, _ in self.moves}
        return next((kind for kind in ("both", "base") if kind in needed), "none")

    def _at_base(
        self,
        xi: Tensor,
        generator: torch.Generator,
        tuning: tuple[float, ...],
        log_evidence: tuple[float, ...],
    ) -> SmcState:
        """Particles with power zero."""
        if len(xi) < 2:
            raise InferenceError(f"the sampler cannot work with {len(xi)} particles; use hundreds")
        density = self._density(0.0)
        points = density.at(xi, self._slopes)
        possible = torch.isfinite(self._in_groups(points.gain()))
        if not bool(possible.any(dim=1).all()):
            raise InferenceError(
                f"none of the {possible.shape[1]} first parameter sets has a finite likelihood for "
                "this observation; check that the file and the building belong together, or use "
                "more particles"
            )
        return SmcState(
            points=points,
            beta=0.0,
            log_evidence=log_evidence,
            tuning=tuning,
            levels=(),
            evaluations=density.evaluations,
            invalid=density.invalid,
            random_state=generator.get_state(),
        )

    def _raised(self, state: SmcState, generator: torch.Generator) -> tuple[SmcState, float]:
        """The next power, every group resampled by what its particles gain, and the effective
        sample size before."""
        gain, left = self._in_groups(state.points.gain()), 1.0 - state.beta
        step = min(next_increment(own, left, self.settings.ess_target) for own in gain)
        log_weight, each = step * gain, gain.shape[1]
        rows = [
            k * each + systematic_rows(torch.softmax(own, dim=0), generator)
            for k, own in enumerate(log_weight)
        ]
        gained = (torch.logsumexp(log_weight, dim=1) - math.log(each)).tolist()
        raised = replace(
            state,
            points=state.points.rows(torch.cat(rows)),
            beta=min(state.beta + step, 1.0),
            log_evidence=tuple(a + b for a, b in zip(state.log_evidence, gained, strict=True)),
        )
        return raised, sum(effective_sample_size(own) for own in log_weight)

    def _moved(
        self, state: SmcState, generator: torch.Generator
    ) -> tuple[SmcState, tuple[float, ...]]:
        """The state after the moves of a level, and the mean acceptance of each kind."""
        density, points = self._density(state.beta), state.points
        # Copies of few points need all moves to part.
        parted = distinct_rows(points.xi) > DRAWS.parted * len(points.xi)
        enough, start, unmoved = self.settings.unmoved if parted else 0.0, points.xi, 1.0
        tuning, acceptance = [], []
        for (move, count), tuned in zip(self.moves, state.tuning, strict=True):
            shares: list[float] = []
            if count and unmoved >= enough:
                own = move.init(density, points, tuned, generator)
                while len(shares) < count and unmoved >= enough:
                    points, own, share = move.step(density, points, own, generator)
                    shares.append(share)
                    unmoved = float((points.xi == start).all(dim=1).to(torch.float64).mean())
                tuned = own.tuning
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

    def _in_groups(self, values: Tensor) -> Tensor:
        """(g, n) of (g n,)."""
        return values.unflatten(0, (self.settings.groups, -1))

    def _grouped(self, parts: tuple[Tensor, ...]) -> Tensor:
        """(g, turns n, ...) of one (g n, ...) a turn."""
        return torch.cat([self._in_groups(part) for part in parts], dim=1)

    def _started(self, start: Tensor) -> Tensor:
        """Standard normal coordinates of draws in the box, finite on its very bounds too."""
        unit = self.prior.to_unit(start.to(self.prior.lower))
        # Rounding alone can carry a draw past a bound.
        if not bool(((unit > -1e-6) & (unit < 1.0 + 1e-6)).all()):
            raise InferenceError(
                "the draws to start from leave the box of the prior; draw them under this prior"
            )
        least = torch.finfo(unit.dtype).eps / 2.0
        return torch.special.ndtri(unit.clamp(least, 1.0 - least)).clamp(-DRAWS.edge, DRAWS.edge)


__all__ = [
    "PAPER",
    "POPULATION",
    "THOROUGH",
    "TRAJECTORIES",
    "KeptDraws",
    "LogLikelihood",
    "SmcSettings",
    "SmcState",
    "TemperedSmc",
]
