"""Which part of an FRF is observed."""

from dataclasses import dataclass

import torch
from torch import Tensor

# Bands of the training start in the lowest tenth of the grid and end above its lower 3/10.
LATEST_START, EARLIEST_END = 0.1, 0.3


@dataclass(frozen=True)
class Visibility:
    """The observed part of each FRF: some floors, over one band.

    Attributes:
        floors: (B, f) one where the floor is observed, else zero.
        band: (B, 2) first and last observed frequency, as shares of the grid from 0 to 1.
    """

    floors: Tensor
    band: Tensor

    def __len__(self) -> int:
        return len(self.floors)

    def __getitem__(self, rows: Tensor | slice) -> "Visibility":
        return Visibility(self.floors[rows], self.band[rows])

    def to(self, device: torch.device) -> "Visibility":
        """The same on a device."""
        return Visibility(self.floors.to(device), self.band.to(device))

    def features(self) -> Tensor:
        """Features (B, f + 2) for the observation encoder."""
        return torch.cat([self.floors, 2.0 * self.band - 1.0], dim=1)

    def weights(self, points: int) -> Tensor:
        """Weights (B, f, k): one where a point is observed, else zero."""
        share = torch.linspace(0.0, 1.0, points, device=self.band.device)
        inside = (share >= self.band[:, :1] - 1e-6) & (share <= self.band[:, 1:] + 1e-6)
        return self.floors[:, :, None] * inside[:, None, :]
