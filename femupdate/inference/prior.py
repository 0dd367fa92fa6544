"""Priors: independent uniform parameters, and their map to and from a standard normal."""

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True)
class UniformPrior:
    """Independent uniform parameters on a box.

    Samplers work in the standard normal space xi, theta = lower + (upper - lower) Phi(xi), where
    every point is inside the box and the prior density is exp(-|xi|^2 / 2).

    Attributes:
        names: p names.
        lower, upper: (p,) bounds, float64.
    """

    names: tuple[str, ...]
    lower: Tensor
    upper: Tensor

    def __post_init__(self) -> None:
        if not bool((self.upper > self.lower).all()):
            raise ValueError("every upper bound must exceed its lower bound")

    @property
    def size(self) -> int:
        """Number of parameters p."""
        return len(self.names)

    def to(self, device: torch.device | str) -> "UniformPrior":
        """The same prior on another device."""
        return UniformPrior(self.names, self.lower.to(device), self.upper.to(device))

    def joined(self, name: str, lower: float, upper: float) -> "UniformPrior":
        """This prior with one more parameter behind the others."""
        ends = (torch.tensor([end]).to(self.lower) for end in (lower, upper))
        low, high = ends
        return UniformPrior(
            (*self.names, name), torch.cat([self.lower, low]), torch.cat([self.upper, high])
        )

    def sample(self, count: int, generator: torch.Generator) -> Tensor:
        """Draw (count, p) parameter vectors."""
        return self.from_unit(
            torch.rand(
                count,
                self.size,
                generator=generator,
                dtype=torch.float64,
                device=self.lower.device,
            )
        )

    def from_unit(self, unit: Tensor) -> Tensor:
        """Map the unit cube to the box."""
        return self.lower + (self.upper - self.lower) * unit

    def to_unit(self, theta: Tensor) -> Tensor:
        """Map the box to the unit cube."""
        return (theta - self.lower) / (self.upper - self.lower)

    def from_normal(self, xi: Tensor) -> Tensor:
        """Map standard normal coordinates (n, p) to the box."""
        return self.from_unit(torch.special.ndtr(xi))

    def to_normal(self, theta: Tensor) -> Tensor:
        """Map the box to standard normal coordinates; the bounds themselves go to +-infinity."""
        return torch.special.ndtri(self.to_unit(theta))

    def log_density_normal(self, xi: Tensor) -> Tensor:
        """Log prior density (n,) of standard normal coordinates, up to a constant."""
        return -0.5 * (xi**2).sum(-1)
