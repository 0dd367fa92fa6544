"""A Gaussian mixture fitted to particles by expectation-maximisation, in torch."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.inference.thresholds import DRAWS


@dataclass(frozen=True)
class GaussianMixture:
    """A mixture of k Gaussians in p dimensions.

    Attributes:
        log_weight: (k,).
        mean: (k, p).
        cholesky: (k, p, p) lower factors of the covariances.
    """

    log_weight: Tensor
    mean: Tensor
    cholesky: Tensor

    def scaled(self, x: Tensor) -> Tensor:
        """Offsets of x (n, p) from every mean in units of its covariance, (k, p, n)."""
        difference = (x[None] - self.mean[:, None]).transpose(1, 2)
        return torch.linalg.solve_triangular(self.cholesky, difference, upper=False)

    def widened(self, factor: float) -> "GaussianMixture":
        """The same with all covariances multiplied."""
        return GaussianMixture(self.log_weight, self.mean, math.sqrt(factor) * self.cholesky)

    def component_log_density(self, x: Tensor) -> Tensor:
        """Log of weight times density, (n, k), for x (n, p)."""
        scaled = self.scaled(x)
        log_determinant = self.cholesky.diagonal(dim1=1, dim2=2).log().sum(-1)
        constant = -0.5 * x.shape[1] * math.log(2.0 * math.pi)
        log_density = constant - log_determinant[:, None] - 0.5 * (scaled**2).sum(1)
        return (self.log_weight[:, None] + log_density).T

    def log_density(self, x: Tensor) -> Tensor:
        """Log density (n,) of x (n, p)."""
        return torch.logsumexp(self.component_log_density(x), dim=1)

    def sample(self, count: int, generator: torch.Generator) -> Tensor:
        """Draw (count, p)."""
        component = torch.multinomial(
            self.log_weight.exp(), count, replacement=True, generator=generator
        )
        noise = torch.randn(
            count,
            self.mean.shape[1],
            1,
            generator=generator,
            dtype=self.mean.dtype,
            device=self.mean.device,
        )
        return self.mean[component] + (self.cholesky[component] @ noise)[..., 0]


@dataclass(frozen=True)
class StudentMixture:
    """A Gaussian mixture with each Gaussian made a multivariate Student's t.

    Its tails reach beyond the points that it was fitted to: as a proposal it does not lag behind a
    distribution that moves, and importance weights stay bounded wherever the target is lighter.

    Attributes:
        gaussian: the mixture; its covariances are the scale matrices.
        freedom: degrees of freedom.
    """

    gaussian: GaussianMixture
    freedom: int = 8

    def sample(self, count: int, generator: torch.Generator) -> Tensor:
        """Draw (count, p)."""
        mixture = self.gaussian
        component = torch.multinomial(
            mixture.log_weight.exp(), count, replacement=True, generator=generator
        )
        size = mixture.mean.shape[1]
        normal = torch.randn(
            count,
            size + self.freedom,
            generator=generator,
            dtype=mixture.mean.dtype,
            device=mixture.mean.device,
        )
        stretch = (self.freedom / normal[:, size:].square().sum(1)).sqrt()
        offset = (mixture.cholesky[component] @ normal[:, :size, None])[..., 0]
        return mixture.mean[component] + offset * stretch[:, None]

    def log_density(self, x: Tensor) -> Tensor:
        """Log density (n,) of x (n, p) (Kotz & Nadarajah 2004, eq. 1.1)."""
        mixture, freedom, size = self.gaussian, self.freedom, x.shape[1]
        log_determinant = mixture.cholesky.diagonal(dim1=1, dim2=2).log().sum(-1)
        constant = (
            math.lgamma(0.5 * (freedom + size))
            - math.lgamma(0.5 * freedom)
            - 0.5 * size * math.log(freedom * math.pi)
        )
        squares = (mixture.scaled(x) ** 2).sum(1)
        tail = -0.5 * (freedom + size) * torch.log1p(squares / freedom)
        joint = (mixture.log_weight + constant - log_determinant)[:, None] + tail
        return torch.logsumexp(joint, dim=0)


def fit_mixture(
    x: Tensor, components: int, generator: torch.Generator, iterations: int = 40
) -> GaussianMixture:
    """Fit a mixture to x (n, p) by expectation-maximisation (Dempster, Laird & Rubin 1977).

    Starts from k-means++ seeds (Arthur & Vassilvitskii 2007). Covariances get a ridge of 1e-6 of
    the pooled variance, so that a component on a few particles stays invertible.
    """
    centre, scale = x.mean(dim=0), x.std(dim=0).clamp_min(1e-12)
    standard = (x - centre) / scale
    moments = _Moments(standard)
    seeds = standard[_spread_seeds(standard, components, generator)]
    nearest = torch.cdist(standard, seeds).argmin(1)
    mixture = moments.maximise(torch.nn.functional.one_hot(nearest, components).to(x))
    previous = -math.inf
    for _ in range(iterations):
        joint = moments.joint_log_density(mixture)
        total = torch.logsumexp(joint, dim=1, keepdim=True)
        mixture = moments.maximise((joint - total).exp_())
        gain = float(total.mean()) - previous
        previous = float(total.mean())
        if abs(gain) < DRAWS.small_gain:
            break
    return GaussianMixture(
        mixture.log_weight, centre + scale * mixture.mean, scale[:, None] * mixture.cholesky
    )


class _Moments:
    """Standardised points with their products, so that both steps are one matrix product.

    Args:
        x: (n, p) of mean zero and variance one; the squares then lose no more than ten of the
            sixteen digits to cancellation in the narrowest component that the ridge admits.
    """

    def __init__(self, x: Tensor) -> None:
        self.size = x.shape[1]
        self._lower = torch.tril_indices(self.size, self.size, device=x.device)
        products = x[:, self._lower[0]] * x[:, self._lower[1]]
        self._features = torch.cat([torch.ones_like(x[:, :1]), x, products], dim=1)

    def maximise(self, responsibility: Tensor) -> GaussianMixture:
        """Weights, means and covariances from responsibilities (n, k)."""
        sums = responsibility.T @ self._features  # (k, 1 + p + p (p + 1) / 2)
        mass = sums[:, 0].clamp_min(1e-9)  # of a component that has lost all particles
        mean = sums[:, 1 : 1 + self.size] / mass[:, None]
        square = self._symmetric(sums[:, 1 + self.size :] / mass[:, None])
        covariance = square - mean[:, :, None] * mean[:, None]
        ridge = DRAWS.ridge * torch.eye(self.size, dtype=mean.dtype, device=mean.device)
        factor = torch.linalg.cholesky(covariance + ridge)
        return GaussianMixture((mass / mass.sum()).log(), mean, factor)

    def joint_log_density(self, mixture: GaussianMixture) -> Tensor:
        """Log of weight times density of every point, (n, k)."""
        precision = torch.cholesky_inverse(mixture.cholesky)
        linear = (precision @ mixture.mean[:, :, None])[..., 0]
        log_determinant = mixture.cholesky.diagonal(dim1=1, dim2=2).log().sum(-1)
        constant = (
            mixture.log_weight
            - log_determinant
            - 0.5 * (linear * mixture.mean).sum(-1)
            - 0.5 * self.size * math.log(2.0 * math.pi)
        )
        row, column = self._lower
        # Products off the diagonal stand for two elements of the precision.
        count = torch.where(row == column, 0.5, 1.0).to(precision)
        quadratic = -count * precision[:, row, column]
        return self._features @ torch.cat([constant[:, None], linear, quadratic], dim=1).T

    def _symmetric(self, lower: Tensor) -> Tensor:
        """(k, p (p + 1) / 2) to (k, p, p)."""
        full = lower.new_empty(len(lower), self.size, self.size)
        row, column = self._lower
        full[:, row, column] = lower
        full[:, column, row] = lower
        return full


def _spread_seeds(x: Tensor, count: int, generator: torch.Generator) -> Tensor:
    """Indices of `count` rows, each drawn with odds that go with its squared distance."""
    chosen = [int(torch.randint(len(x), (1,), generator=generator, device=x.device))]
    nearest = ((x - x[chosen[0]]) ** 2).sum(1)
    for _ in range(count - 1):
        chosen.append(int(torch.multinomial(nearest + 1e-12, 1, generator=generator)))
        nearest = torch.minimum(nearest, ((x - x[chosen[-1]]) ** 2).sum(1))
    return torch.tensor(chosen, device=x.device)
