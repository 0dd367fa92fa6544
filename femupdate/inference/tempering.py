"""A likelihood raised to powers: particles, their tempered density, weights and resampling."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from femupdate.inference.parameters import Parameters
from femupdate.inference.thresholds import DRAWS

LogLikelihood = Callable[[Tensor], Tensor]
"""Log likelihood (n,) of parameters (n, p)."""

Slopes = Literal["none", "base", "both"]
"""Of which log likelihoods the derivatives are taken."""


@dataclass(frozen=True)
class Points:
    """Particles in the prior's standard normal coordinates, and what is known of them.

    Attributes:
        xi: (n, d).
        base: (n,) log likelihood that the tempering starts from (zero for the prior alone).
        target: (n,) log likelihood that it goes to.
        base_slope, target_slope: (n, d) by xi; None where no move asks for them.
    """

    xi: Tensor
    base: Tensor
    target: Tensor
    base_slope: Tensor | None = None
    target_slope: Tensor | None = None

    def rows(self, rows: Tensor) -> "Points":
        """Some of the particles."""
        return self._with(lambda part, _: part[rows], self)

    def where(self, take: Tensor, other: "Points") -> "Points":
        """Particles of `other` where `take` (n,), own ones elsewhere."""

        def chosen(mine: Tensor, theirs: Tensor) -> Tensor:
            return torch.where(take[:, None] if mine.ndim == 2 else take, theirs, mine)

        return self._with(chosen, other)

    def gain(self) -> Tensor:
        """(n,) target less base, minus infinity where either says impossible."""
        possible = torch.isfinite(self.target) & torch.isfinite(self.base)
        return torch.where(possible, self.target - self.base, -torch.inf)

    def _with(self, change: Callable[[Tensor, Tensor], Tensor], other: "Points") -> "Points":
        def slope(mine: Tensor | None, theirs: Tensor | None) -> Tensor | None:
            return None if mine is None or theirs is None else change(mine, theirs)

        return Points(
            change(self.xi, other.xi),
            change(self.base, other.base),
            change(self.target, other.target),
            slope(self.base_slope, other.base_slope),
            slope(self.target_slope, other.target_slope),
        )


class Tempered:
    """Prior x base^(1 - beta) x target^beta, a density of standard normal coordinates.

    Args:
        prior: of the parameters.
        target: log likelihood.
        base: log likelihood at power zero; None for the prior alone.
        beta: power of the target.
        rows: likelihoods whose derivatives are taken at a time.

    Attributes:
        evaluations: of the target so far.
        invalid: how many of them gave no finite number; all count as impossible.
    """

    def __init__(
        self,
        prior: Parameters,
        target: LogLikelihood,
        base: LogLikelihood | None = None,
        beta: float = 0.0,
        rows: int = 128,
    ) -> None:
        self.prior, self.target, self.base = prior, target, base
        self.beta, self.rows = beta, rows
        self.evaluations = self.invalid = 0

    def parameters(self, xi: Tensor) -> Tensor:
        """(n, p) of coordinates (n, d)."""
        return self.prior.from_normal(xi.clamp(-DRAWS.edge, DRAWS.edge))

    def at(self, xi: Tensor, slopes: Slopes = "none") -> Points:
        """Likelihoods at coordinates (n, d); that of the base is left out at the whole power."""
        zero = torch.zeros_like(xi)
        base, base_slope = zero[:, 0], zero
        if self.base is not None and self.beta < 1.0:
            base, base_slope = self._asked(self.base, xi, slopes != "none")
        target, target_slope = self._judged(xi, slopes == "both")
        if slopes == "none":
            return Points(xi, base, target)
        return Points(xi, base, target, base_slope, target_slope if slopes == "both" else None)

    def value(self, xi: Tensor) -> Tensor:
        """Log likelihood (n,) of the target alone."""
        return self._judged(xi, slopes=False)[0]

    def log_density(self, points: Points) -> Tensor:
        """(n,), up to a constant."""
        return self.prior.log_density_normal(points.xi) + self.log_likelihood(points)

    def log_likelihood(self, points: Points) -> Tensor:
        """(n,) of base and target by their powers."""
        if self.beta < 1.0:
            return points.base + self.beta * points.gain()
        return points.target

    def slope(self, points: Points) -> Tensor:
        """(n, d) of the log density, for points with slopes of both likelihoods."""
        assert points.base_slope is not None
        assert points.target_slope is not None
        likelihood = (1.0 - self.beta) * points.base_slope + self.beta * points.target_slope
        return likelihood - points.xi

    def _judged(self, xi: Tensor, slopes: bool) -> tuple[Tensor, Tensor]:
        target, slope = self._asked(self.target, xi, slopes)
        self.evaluations += len(xi)
        self.invalid += int(torch.isneginf(target).sum())
        return target, slope

    def _asked(
        self, log_likelihood: LogLikelihood, xi: Tensor, slopes: bool
    ) -> tuple[Tensor, Tensor]:
        """Values (n,), minus infinity where there is no number, and slopes (n, d), zero there."""
        if not slopes:
            value = log_likelihood(self.parameters(xi)).to(torch.float64)
            wrong = torch.isnan(value) | torch.isposinf(value)
            return torch.where(wrong, -torch.inf, value), torch.zeros_like(xi)
        parts = []
        for rows in xi.split(self.rows):
            free = rows.clamp(-DRAWS.edge, DRAWS.edge).detach().requires_grad_()
            value = log_likelihood(self.prior.from_normal(free)).to(torch.float64)
            (slope,) = torch.autograd.grad(value.sum(), free)
            parts.append((value.detach(), slope))
        value, slope = (torch.cat(each) for each in zip(*parts, strict=True))
        finite = torch.isfinite(value) & torch.isfinite(slope).all(dim=1)
        return torch.where(finite, value, -torch.inf), torch.where(finite[:, None], slope, 0.0)


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
