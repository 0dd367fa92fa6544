"""A likelihood raised to powers: particles, their tempered density, weights and resampling."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.inference.parameters import Parameters

EDGE = 8.0  # standard normal coordinate from which a parameter is at its bound

LogLikelihood = Callable[[Tensor], Tensor]
"""Log likelihood (n,) of parameters (n, p)."""


@dataclass(frozen=True)
class Points:
    """Particles in the prior's standard normal coordinates, and what is known of them.

    Attributes:
        xi: (n, d).
        log_likelihood: (n,), minus infinity where a particle is impossible.
        slope: (n, d) of it by xi; None where no move asks for it.
    """

    xi: Tensor
    log_likelihood: Tensor
    slope: Tensor | None = None

    def rows(self, rows: Tensor) -> "Points":
        """Some of the particles."""
        slope = None if self.slope is None else self.slope[rows]
        return Points(self.xi[rows], self.log_likelihood[rows], slope)

    def where(self, take: Tensor, other: "Points") -> "Points":
        """Particles of `other` where `take` (n,), own ones elsewhere."""
        slope = None
        if self.slope is not None and other.slope is not None:
            slope = torch.where(take[:, None], other.slope, self.slope)
        return Points(
            torch.where(take[:, None], other.xi, self.xi),
            torch.where(take, other.log_likelihood, self.log_likelihood),
            slope,
        )


class Tempered:
    """Prior x likelihood^beta, a density of standard normal coordinates.

    Args:
        rows: likelihoods whose derivatives are taken at a time.

    Attributes:
        evaluations: of the likelihood so far.
        invalid: how many of them gave no finite number; all count as impossible.
    """

    def __init__(
        self, prior: Parameters, log_likelihood: LogLikelihood, beta: float = 0.0, rows: int = 128
    ) -> None:
        self.prior, self.beta, self.rows = prior, beta, rows
        self._log_likelihood = log_likelihood
        self.evaluations = self.invalid = 0

    def parameters(self, xi: Tensor) -> Tensor:
        """(n, p) of coordinates (n, d)."""
        return self.prior.from_normal(xi.clamp(-EDGE, EDGE))

    def at(self, xi: Tensor, slopes: bool = False) -> Points:
        """Likelihoods at coordinates (n, d), and their slopes (zero where there is no number)."""
        self.evaluations += len(xi)
        if not slopes:
            value = self._log_likelihood(self.parameters(xi)).to(torch.float64)
            wrong = torch.isnan(value) | torch.isposinf(value)
            points = Points(xi, torch.where(wrong, -torch.inf, value))
        else:
            parts = []
            for some in xi.split(self.rows):
                free = some.clamp(-EDGE, EDGE).detach().requires_grad_()
                value = self._log_likelihood(self.prior.from_normal(free)).to(torch.float64)
                (slope,) = torch.autograd.grad(value.sum(), free)
                parts.append((value.detach(), slope))
            value, slope = (torch.cat(each) for each in zip(*parts, strict=True))
            finite = torch.isfinite(value) & torch.isfinite(slope).all(dim=1)
            value = torch.where(finite, value, -torch.inf)
            points = Points(xi, value, torch.where(finite[:, None], slope, 0.0))
        self.invalid += int(torch.isneginf(points.log_likelihood).sum())
        return points

    def log_density(self, points: Points) -> Tensor:
        """(n,), up to a constant."""
        return self.prior.log_density_normal(points.xi) + self.beta * points.log_likelihood

    def slope(self, points: Points) -> Tensor:
        """(n, d) of the log density, for points with slopes."""
        assert points.slope is not None
        return self.beta * points.slope - points.xi


@dataclass(frozen=True)
class Level:
    """What happened at one tempering level.

    Attributes:
        ess: effective sample size of all particles before they were resampled.
        acceptance: mean, of each kind of move in their order; NaN where none was made.
        unique: share of the particles that are different.
    """

    beta: float
    ess: float
    acceptance: tuple[float, ...]
    unique: float


@dataclass(frozen=True, kw_only=True, eq=False)
class SamplerRun:
    """Equally weighted draws of prior times likelihood.

    Attributes:
        theta: (n, p) parameters.
        log_likelihood: (n,).
        log_evidence: log of the mean likelihood under the prior.
        evaluations: of the likelihood, all in all.
        log_evidence_error: its standard error by weights; NaN where the draws had none.
        effective: effective sample size of weighted draws that these were chosen from; zero
            likewise.
        effective_share: of those; zero likewise.
        invalid: evaluations that gave no finite number; all count as impossible.
        acceptance: mean share of moves accepted while draws were kept; NaN where none were.
    """

    theta: Tensor
    log_likelihood: Tensor
    log_evidence: float
    evaluations: int
    log_evidence_error: float = math.nan
    effective: float = 0.0
    effective_share: float = 0.0
    levels: tuple[Level, ...] = ()
    invalid: int = 0
    acceptance: float = math.nan


def effective_sample_size(log_weight: Tensor) -> float:
    """(sum w)^2 / sum w^2 of log weights (n,) (Kish 1965), between 1 and n."""
    return float(
        torch.exp(2.0 * torch.logsumexp(log_weight, 0) - torch.logsumexp(2.0 * log_weight, 0))
    )


def next_increment(gain: Tensor, most: float, ess_target: float) -> float:
    """Largest step of beta, up to `most`, that keeps the share `ess_target` of the particles.

    Found by bisection, to a thousandth. At least 1e-12, so that the sampler goes on where fewer
    particles than that are possible at all.

    Args:
        gain: (n,) log likelihood gained per unit of beta, minus infinity where impossible.
        most: what is left up to beta = 1.
        ess_target: share of the particles, 0 to 1.
    """
    wanted = ess_target * len(gain)
    if effective_sample_size(most * gain) >= wanted:
        return most
    low, high = 0.0, most
    while high - low > 1e-3 * high and high > 1e-12:
        middle = 0.5 * (low + high)
        if effective_sample_size(middle * gain) < wanted:
            high = middle
        else:
            low = middle
    return max(low, 1e-12)


def systematic_rows(weight: Tensor, generator: torch.Generator, count: int | None = None) -> Tensor:
    """Systematic resampling (Kitagawa 1996): row indices for weights (n,) that sum to one.

    As many as there are weights, or `count`. Row i comes floor(count w_i) or ceil(count w_i) times,
    count w_i times on average; weight zero never comes.
    """
    count = count or len(weight)
    uniform = torch.rand(1, generator=generator, dtype=weight.dtype, device=weight.device)
    # Points in (0, 1] and edges that end at exactly 1: rounding cannot reach a row of weight zero.
    points = (
        torch.arange(1, count + 1, dtype=weight.dtype, device=weight.device) - uniform
    ) / count
    edges = weight.cumsum(0)
    return torch.searchsorted(edges / edges[-1], points)
