"""A Gaussian mixture fitted to particles by expectation-maximisation, in torch."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor


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
    scale = x.std(dim=0).clamp_min(1e-12)
    ridge = torch.diag((1e-3 * scale) ** 2)
    seeds = x[_spread_seeds(x / scale, components, generator)]
    distance = torch.cdist(x / scale, seeds / scale)
    responsibility = torch.nn.functional.one_hot(distance.argmin(1), components).to(x)
    mixture = _maximise(x, responsibility, ridge)
    previous = -math.inf
    for _ in range(iterations):
        joint = mixture.component_log_density(x)
        total = torch.logsumexp(joint, dim=1, keepdim=True)
        mixture = _maximise(x, (joint - total).exp(), ridge)
        gain = float(total.mean()) - previous
        previous = float(total.mean())
        if abs(gain) < 1e-4:
            break
    return mixture


def _maximise(x: Tensor, responsibility: Tensor, ridge: Tensor) -> GaussianMixture:
    """Weights, means and covariances from responsibilities (n, k)."""
    mass = responsibility.sum(0).clamp_min(1e-9)  # of a component that has lost all particles
    mean = (responsibility.T @ x) / mass[:, None]
    centred = x[None] - mean[:, None]
    weighted = responsibility.T[:, :, None] * centred
    covariance = weighted.transpose(1, 2) @ centred / mass[:, None, None] + ridge
    return GaussianMixture((mass / mass.sum()).log(), mean, torch.linalg.cholesky(covariance))


def _spread_seeds(x: Tensor, count: int, generator: torch.Generator) -> Tensor:
    """Indices of `count` rows, each drawn with odds that go with its squared distance."""
    chosen = [int(torch.randint(len(x), (1,), generator=generator, device=x.device))]
    nearest = ((x - x[chosen[0]]) ** 2).sum(1)
    for _ in range(count - 1):
        chosen.append(int(torch.multinomial(nearest + 1e-12, 1, generator=generator)))
        nearest = torch.minimum(nearest, ((x - x[chosen[-1]]) ** 2).sum(1))
    return torch.tensor(chosen, device=x.device)
