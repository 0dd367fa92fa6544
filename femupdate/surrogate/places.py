"""Positions of stiffness factors within the box of their prior, in which the networks work.

A position is linear in the square root of a factor, since frequencies are: from a third to three
this makes even steps.
"""

from typing import Protocol

import torch
from torch import Tensor


class Box(Protocol):
    """Bounds of parameters, such as those of their prior."""

    @property
    def lower(self) -> Tensor:
        """(p,) float64."""

    @property
    def upper(self) -> Tensor:
        """(p,) float64."""


def to_place(theta: Tensor, lower: Tensor, upper: Tensor) -> Tensor:
    """Positions (..., p) from -1 to 1 of theta (..., p) in a box (p,)."""
    return 2.0 * (theta.sqrt() - lower.sqrt()) / (upper.sqrt() - lower.sqrt()) - 1.0


def from_place(place: Tensor, lower: Tensor, upper: Tensor) -> Tensor:
    """Inverse of `to_place`."""
    return (lower.sqrt() + 0.5 * (place + 1.0) * (upper.sqrt() - lower.sqrt())).square()


def parameter_features(theta: Tensor, lower: Tensor, upper: Tensor) -> Tensor:
    """Features (B, 3 p) of theta: position by root, value and logarithm, from -1 to 1."""
    linear = 2.0 * (theta - lower) / (upper - lower) - 1.0
    logarithmic = 2.0 * torch.log(theta / lower) / torch.log(upper / lower) - 1.0
    return torch.cat([to_place(theta, lower, upper), linear, logarithmic], dim=-1)
