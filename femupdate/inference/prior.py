"""Priors: independent parameters, and their map to and from a standard normal."""

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


@dataclass(frozen=True)
class TruncatedPrior(UniformPrior):
    """Independent parameters, some uniform on their range, others normal within theirs.

    Attributes:
        centre: (p,) of the normal ones.
        scale: (p,) their standard deviations; infinite where uniform.
    """

    centre: Tensor
    scale: Tensor

    def to(self, device: torch.device | str) -> "TruncatedPrior":
        """The same prior on another device."""
        parts = (part.to(device) for part in (self.lower, self.upper, self.centre, self.scale))
        return TruncatedPrior(self.names, *parts)

    def from_unit(self, unit: Tensor) -> Tensor:
        """Map the unit cube to the box, evenly in probability."""
        scale, low, high = self._tails()
        share = low + (high - low) * unit
        # At a limit far out a share may round to one.
        normal = self.centre + scale * torch.special.ndtri(share.clamp(1e-300, 1.0 - 1e-16))
        within = torch.minimum(torch.maximum(normal, self.lower), self.upper)
        return torch.where(self.scale.isinf(), super().from_unit(unit), within)

    def to_unit(self, theta: Tensor) -> Tensor:
        """Map the box to the unit cube."""
        scale, low, high = self._tails()
        share = (torch.special.ndtr((theta - self.centre) / scale) - low) / (high - low)
        return torch.where(self.scale.isinf(), super().to_unit(theta), share)

    def joined(self, name: str, lower: float, upper: float) -> "TruncatedPrior":
        """This prior with one more parameter, uniform, behind the others."""
        box = super().joined(name, lower, upper)
        ends = (torch.tensor([end]).to(self.lower) for end in (0.0, torch.inf))
        parts = (torch.cat(pair) for pair in zip((self.centre, self.scale), ends, strict=True))
        return TruncatedPrior(box.names, box.lower, box.upper, *parts)

    def _tails(self) -> tuple[Tensor, Tensor, Tensor]:
        """Finite scales (p,), and the normal's probability (p,) below either end."""
        scale = torch.where(self.scale.isinf(), 1.0, self.scale)
        ends = (torch.special.ndtr((end - self.centre) / scale) for end in (self.lower, self.upper))
        low, high = ends
        return scale, low, high
