"""Layers that the networks share."""

import torch
from torch import Tensor, nn


class ResidualBlock(nn.Module):
    """x + W2 silu(W1 norm(x)), with W2 starting at zero."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.inner = nn.Linear(width, width)
        self.outer = nn.Linear(width, width)
        nn.init.zeros_(self.outer.weight)
        nn.init.zeros_(self.outer.bias)

    def forward(self, x: Tensor) -> Tensor:
        """(B, width) to (B, width)."""
        return x + self.outer(nn.functional.silu(self.inner(self.norm(x))))


def residual_blocks(width: int, count: int) -> nn.Sequential:
    """`count` blocks one after another."""
    return nn.Sequential(*(ResidualBlock(width) for _ in range(count)))


class FloorLinear(nn.Module):
    """One linear map for each floor, all floors in one batched product."""

    def __init__(self, floors: int, inputs: int, outputs: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.randn(floors, inputs, outputs) * inputs**-0.5)
        self.bias = nn.Parameter(torch.zeros(floors, 1, outputs))

    def forward(self, x: Tensor) -> Tensor:
        """(B, f, inputs) to (B, f, outputs)."""
        return torch.baddbmm(self.bias, x.transpose(0, 1), self.weight).transpose(0, 1)
