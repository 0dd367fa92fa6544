"""Errors of a model that many points of its FRFs share, as part of the noise.

Were they left out, an effect that can make up for them would be named, or one that cannot preferred
to one that can. As part of the noise they are taken out of the residuals of all models alike
(generalised least squares; Aitken 1935).
"""

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True, eq=False)
class CommonErrors:
    """Errors of the model that many points share, beside the noise that each has alone.

    Whitened residuals r have the covariance I + S S^T then; with S = U diag(s) V^T its inverse root
    takes the part 1 - (1 + s^2)^(-1/2) out of what r has along each column of U.

    Attributes:
        axes: (n, c) U, orthonormal.
        taken: (c,) the parts.
        half_log_determinant: of the covariance, sum of ln(1 + s^2) / 2: a normal density is divided
            by its exponential.
    """

    axes: Tensor
    taken: Tensor
    half_log_determinant: float

    @staticmethod
    def of(steps: Tensor) -> "CommonErrors":
        """Of S (n, c): one standard deviation of every error, in the unit of the residuals."""
        axes, size, _ = torch.linalg.svd(steps, full_matrices=False)
        half_log_determinant = 0.5 * float(torch.log1p(size**2).sum())
        return CommonErrors(axes, 1.0 - (1.0 + size**2) ** -0.5, half_log_determinant)

    def whiten(self, residuals: Tensor) -> Tensor:
        """Residuals (N, n) of unit covariance."""
        return residuals - ((residuals @ self.axes) * self.taken) @ self.axes.T
