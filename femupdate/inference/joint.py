"""Several kinds of observation together: independent, so that their log likelihoods add."""

from collections.abc import Sequence
from typing import Protocol

import torch
from torch import Tensor


class Kind(Protocol):
    """Likelihood of one kind of observation, of the same parameters as all others."""

    def __call__(self, parameters: Tensor) -> Tensor:
        """Log likelihood (n,) of parameters (n, p)."""
        ...

    def residuals(self, parameters: Tensor) -> Tensor:
        """Whitened residuals (n, m): minus half their square is the log likelihood."""
        ...


class JointLikelihood:
    """The product of the likelihoods of independent observations of one building.

    Args:
        parts: at least one.
    """

    def __init__(self, parts: Sequence[Kind]) -> None:
        self.parts = tuple(parts)

    def __call__(self, parameters: Tensor) -> Tensor:
        """Log likelihood (n,) of parameters (n, p)."""
        return torch.stack([part(parameters) for part in self.parts]).sum(dim=0)

    def residuals(self, parameters: Tensor) -> Tensor:
        """Whitened residuals (n, m) of one part after the other."""
        return torch.cat([part.residuals(parameters) for part in self.parts], dim=1)
