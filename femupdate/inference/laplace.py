"""A start for high dimensions: Gaussians at the largest values of the posterior density.

Particles drawn from the prior do not find a posterior of dozens of parameters at a bearable number
of responses. The residuals of a data-space likelihood are smooth, so the Levenberg-Marquardt
method (Marquardt 1963) finds its maxima from many starts at once, with the noise lowered step by
step so that starts are not held up by peaks that do not yet overlap. In the prior's standard
normal coordinates what the data do not determine is Gaussian as it stands.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.errors import InferenceError
from femupdate.inference.mixture import GaussianMixture, StudentMixture
from femupdate.inference.prior import UniformPrior
from femupdate.inference.smc import LogLikelihood
from femupdate.inference.tempering import effective_sample_size

Residuals = Callable[[Tensor], Tensor]
"""Whitened residuals (n, m) of parameters (n, p); the log likelihood is minus half their square."""

# Shares of the residuals' weight, one stage each: small ones smooth the misfit over.
_STAGES = (0.003, 0.03, 0.3, 1.0)
_STEP = 1e-4
# Dampings tried at every step, as multiples of the last good one: a Jacobian costs more than they.
_DAMPINGS = (0.1, 1.0, 10.0, 100.0, 1000.0)
_FREEDOM = 8
# Maxima lower than the highest by this many nats (with their widths) hold nothing of the posterior.
_NEGLIGIBLE = 12.0
# Standard deviations within which two ends of the search are the same maximum.
_SAME = 1.0


@dataclass(frozen=True)
class LaplaceSettings:
    """How maxima are searched for.

    Attributes:
        starts: searches, from the best of the candidates.
        candidates: draws from the prior.
        steps: of each search at each stage; twice as many at the last.
    """

    starts: int = 12
    candidates: int = 2000
    steps: int = 6

    def evaluations(self, size: int) -> int:
        """Residual vectors of `size` parameters that the search takes."""
        steps = self.steps * (len(_STAGES) + 1)
        return self.candidates + self.starts * (steps * (size + len(_DAMPINGS)) + size)


@dataclass(frozen=True)
class LaplaceStart:
    """Gaussians at the maxima, with Student tails.

    Attributes:
        prior: of the parameters.
        proposal: in the prior's standard normal coordinates.
        reached: starts that ended at each maximum that counts.
        evaluations: of the residuals.
    """

    prior: UniformPrior
    proposal: StudentMixture
    reached: tuple[int, ...]
    evaluations: int

    def draw(self, count: int, seed: int) -> Tensor:
        """Parameters (count, p)."""
        generator = torch.Generator(device=self.prior.lower.device).manual_seed(seed)
        return self.prior.from_normal(self.proposal.sample(count, generator).clamp(-8.0, 8.0))

    def log_likelihood(self, theta: Tensor) -> Tensor:
        """What times the prior gives the proposal's density: a base for tempering, (n,)."""
        xi = self.prior.to_normal(theta).clamp(-8.0, 8.0)
        constant = 0.5 * self.prior.size * math.log(2.0 * math.pi)
        return self.proposal.log_density(xi) - self.prior.log_density_normal(xi) + constant

    def effective_share(self, target: LogLikelihood, count: int, seed: int) -> float:
        """Share of `count` draws that count as draws from prior times target; 0 where none does."""
        theta = self.draw(count, seed)
        log_weight = target(theta).to(torch.float64) - self.log_likelihood(theta)
        log_weight = torch.where(torch.isfinite(log_weight), log_weight, -torch.inf)
        if not bool(torch.isfinite(log_weight).any()):
            return 0.0
        return effective_sample_size(log_weight) / count


@dataclass(frozen=True)
class _Search:
    """Where S searches stand: xi (S, p), residuals (S, m) and damping (S,)."""

    xi: Tensor
    residual: Tensor
    damping: Tensor

    def objective(self, share: float) -> Tensor:
        return 0.5 * (share * self.residual.square().sum(1) + self.xi.square().sum(1))


def laplace_start(
    prior: UniformPrior,
    residuals: Residuals,
    seed: int,
    settings: LaplaceSettings | None = None,
    progress: Callable[[int], None] | None = None,
    near: Tensor | None = None,
) -> LaplaceStart:
    """Find maxima of prior times likelihood, and put a Gaussian at each.

    Args:
        prior: of the parameters.
        residuals: see `Residuals`; float64, for differences.
        seed: of the candidates.
        settings: see `LaplaceSettings`.
        progress: called with the number of residual vectors evaluated since the last call.
        near: (n, p) parameters known to be near the maxima: candidates in place of the prior's
            draws, searched from with the whole weight of the data.

    Raises:
        InferenceError: no candidate has finite residuals.
    """
    chosen = settings or LaplaceSettings()
    counted = _Counted(prior, residuals, progress)
    candidates = (
        _candidates(prior, seed, chosen.candidates) if near is None else _normal(prior, near)
    )
    search = _first(counted, candidates, chosen.starts)
    for share in _STAGES if near is None else _STAGES[-1:]:
        for _ in range(chosen.steps * (2 if share == 1.0 else 1)):
            search = _stepped(counted, search, share)
    mean, factor, log_weight, reached = _maxima(counted, search)
    mixture = GaussianMixture(log_weight - torch.logsumexp(log_weight, 0), mean, factor)
    return LaplaceStart(prior, StudentMixture(mixture, _FREEDOM), reached, counted.count)


class _Counted:
    """Residuals in standard normal coordinates, infinite where they are no numbers, counted."""

    def __init__(
        self, prior: UniformPrior, residuals: Residuals, progress: Callable[[int], None] | None
    ) -> None:
        self._prior, self._residuals, self._progress = prior, residuals, progress
        self.count = 0

    def __call__(self, xi: Tensor) -> Tensor:
        values = self._residuals(self._prior.from_normal(xi)).to(torch.float64)
        self.count += len(xi)
        if self._progress is not None:
            self._progress(len(xi))
        return torch.nan_to_num(values, nan=torch.inf, posinf=torch.inf, neginf=torch.inf)

    def jacobian(self, xi: Tensor, residual: Tensor) -> Tensor:
        """Forward differences (S, m, p)."""
        size = xi.shape[1]
        shifted = xi[:, None] + _STEP * torch.eye(size, dtype=xi.dtype, device=xi.device)
        values = torch.cat([self(rows) for rows in shifted])  # one search at a time
        slope = (values.reshape(len(xi), size, -1) - residual[:, None]) / _STEP
        return torch.nan_to_num(slope, nan=0.0, posinf=0.0, neginf=0.0).transpose(1, 2)


def _candidates(prior: UniformPrior, seed: int, count: int) -> Tensor:
    """Nearer to the middle of the box than the prior's own draws: its corners are seldom best."""
    generator = torch.Generator(device=prior.lower.device).manual_seed(seed)
    return 0.7 * _normal(prior, prior.sample(count, generator))


def _normal(prior: UniformPrior, theta: Tensor) -> Tensor:
    return prior.to_normal(theta).clamp(-3.0, 3.0)


def _first(counted: _Counted, xi: Tensor, starts: int) -> _Search:
    """The best of some candidates (n, p)."""
    residual = counted(xi)
    order = residual.square().sum(1).argsort()[:starts]
    order = order[torch.isfinite(residual[order].sum(1))]
    if not len(order):
        raise InferenceError(
            f"none of {len(xi)} parameter sets has a finite likelihood for this "
            "observation; check that the file and the building belong together"
        )
    return _Search(xi[order], residual[order], xi.new_full((len(order),), 1e-2))


def _stepped(counted: _Counted, search: _Search, share: float) -> _Search:
    """One step of every search, with the best of several dampings; it stays where none gains."""
    slope = counted.jacobian(search.xi, search.residual)
    gradient = share * torch.einsum("smp,sm->sp", slope, search.residual) + search.xi
    curvature = _curvature(slope, share)
    ridge = torch.diag_embed(curvature.diagonal(dim1=1, dim2=2))
    found = _Search(search.xi, search.residual, (100.0 * search.damping).clamp_max(1e5))
    for multiple in _DAMPINGS:
        damping = (multiple * search.damping).clamp_min(1e-6)
        step = torch.linalg.solve(curvature + damping[:, None, None] * ridge, gradient[..., None])
        # No parameter moves by more than one prior standard deviation.
        step = step[..., 0] / step[..., 0].abs().amax(dim=1, keepdim=True).clamp_min(1.0)
        xi = (search.xi - step).clamp(-6.0, 6.0)
        tried = _Search(xi, counted(xi), damping)
        better = tried.objective(share) < found.objective(share)
        found = _Search(
            torch.where(better[:, None], tried.xi, found.xi),
            torch.where(better[:, None], tried.residual, found.residual),
            torch.where(better, tried.damping, found.damping),
        )
    return found


def _curvature(slope: Tensor, share: float) -> Tensor:
    """Gauss-Newton curvature (S, p, p) of minus the log posterior."""
    eye = torch.eye(slope.shape[2], dtype=slope.dtype, device=slope.device)
    return share * slope.transpose(1, 2) @ slope + eye


def _maxima(counted: _Counted, search: _Search) -> tuple[Tensor, Tensor, Tensor, tuple[int, ...]]:
    """Means (k, p), Cholesky factors (k, p, p), log weights (k,) and the starts at each."""
    curvature = _curvature(counted.jacobian(search.xi, search.residual), 1.0)
    upper = torch.linalg.cholesky(curvature)
    log_mass = -search.objective(1.0) - upper.diagonal(dim1=1, dim2=2).log().sum(-1)
    order = log_mass.argsort(descending=True).tolist()
    kept: list[int] = []
    reached: dict[int, int] = {}
    for k in (k for k in order if log_mass[k] > log_mass[order[0]] - _NEGLIGIBLE):
        offsets = [(search.xi[k] - search.xi[j], j) for j in kept]
        size = len(search.xi[k])
        near = [j for d, j in offsets if float(d @ curvature[j] @ d) < _SAME**2 * size]
        if near:
            reached[near[0]] += 1
        else:
            kept.append(k)
            reached[k] = 1
    factor = torch.linalg.cholesky(torch.cholesky_inverse(upper[kept]))
    return search.xi[kept], factor, log_mass[kept], tuple(reached[k] for k in kept)
