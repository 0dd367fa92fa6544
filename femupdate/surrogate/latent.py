"""The closed form of the latent likelihood."""

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True)
class ObservedLatent:
    """q(z|x) of one observation: a mixture of c Gaussians around the z that explain it.

    Attributes:
        log_weight: (c,) normalised.
        mean: (c, z).
        information: (c, z, z) information of the data. The precision of each Gaussian is this
            plus the prior's, which is the identity.
    """

    log_weight: Tensor
    mean: Tensor
    information: Tensor

    @property
    def precision(self) -> Tensor:
        """Precision of each Gaussian, (c, z, z)."""
        return self.information + torch.eye(self.mean.shape[1]).to(self.information)


class LatentQuadratics:
    """ln of the integral of q(z|x) q(z|theta) / p(z) over z, p(z) the standard normal.

    q(z|theta) is N(m, D) with one D for all theta. With d = m - m_c and F_c the
    information of component c, its share of the integral is a quadratic of d,
    a_c + d^T (I + F_c D)^-1 m_c - d^T (I + F_c D)^-1 F_c d / 2: finite for every theta, since the
    precision of q(z|x) is never below the prior's.

    Args:
        observed: q(z|x).
        covariance: D (z, z); one on the diagonal where theta gives no information.
    """

    def __init__(
        self, observed: ObservedLatent, covariance: Tensor, device: torch.device | str = "cpu"
    ) -> None:
        mean, information = observed.mean.double().cpu(), observed.information.double().cpu()
        size = mean.shape[1]
        identity = torch.eye(size).to(mean)
        spread = covariance.double().cpu()
        mixed = identity + information @ spread
        curvature = torch.linalg.solve(mixed, information)
        curvature = 0.5 * (curvature + curvature.transpose(1, 2))
        values, vectors = torch.linalg.eigh(curvature)
        roots = values.clamp_min(0.0).sqrt()[:, :, None] * vectors.transpose(1, 2)
        slope = torch.linalg.solve(mixed, mean[:, :, None])[..., 0]
        # P^-1 with P = F + D^-1, written without D^-1.
        narrow = spread @ torch.linalg.inv(mixed)
        level = (
            observed.log_weight.double()
            + 0.5 * torch.linalg.slogdet(observed.precision.double())[1]
            - 0.5 * torch.linalg.slogdet(mixed)[1]
            + 0.5 * (mean**2).sum(1)
            + 0.5 * torch.einsum("ci,cij,cj->c", mean, narrow, mean)
        )
        kept = (part.float().to(device) for part in (mean, roots, slope, level))
        self._mean, self._roots, self._slope, self._level = kept

    def __call__(self, mean_theta: Tensor) -> Tensor:
        """Log likelihood (n,) for means (n, z) of q(z|theta)."""
        offset = mean_theta[None] - self._mean[:, None]
        squares = torch.bmm(offset, self._roots.transpose(1, 2)).square().sum(-1)
        slope = torch.bmm(offset, self._slope[:, :, None])[..., 0]
        return torch.logsumexp(self._level[:, None] + slope - 0.5 * squares, dim=0)
