"""Positions of parameters within the box of their prior, in which the networks work.

The position of a stiffness factor is linear in its square root, since frequencies are: from a third
to three this makes even steps. The size of an effect may be zero or negative and changes the
response in proportion, so its position is linear in the size.
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


def to_place(theta: Tensor, lower: Tensor, upper: Tensor, sizes: int) -> Tensor:
    """Positions (..., p) from -1 to 1 of theta (..., p) in a box (p,).

    Args:
        theta: stiffness factors, followed by sizes of effects.
        lower, upper: of the box.
        sizes: number of sizes.
    """
    return 2.0 * (_bent(theta, sizes) - _bent(lower, sizes)) / _width(lower, upper, sizes) - 1.0


def from_place(place: Tensor, lower: Tensor, upper: Tensor, sizes: int) -> Tensor:
    """Inverse of `to_place`."""
    bent = _bent(lower, sizes) + 0.5 * (place + 1.0) * _width(lower, upper, sizes)
    if not sizes:
        return bent.square()
    factors, rest = _split(bent, sizes)
    return torch.cat([factors.square(), rest], dim=-1)


def parameter_features(theta: Tensor, lower: Tensor, upper: Tensor, sizes: int = 0) -> Tensor:
    """Features (B, 3 p) of theta: position by root, value and logarithm, from -1 to 1.

    A size has its position by value three times.
    """
    linear = 2.0 * (theta - lower) / (upper - lower) - 1.0
    own, low, high = (_split(one, sizes)[0] for one in (theta, lower, upper))
    logarithmic = 2.0 * torch.log(own / low) / torch.log(high / low) - 1.0
    root = to_place(theta, lower, upper, sizes)
    return torch.cat([root, linear, logarithmic, _split(linear, sizes)[1]], dim=-1)


def _bent(values: Tensor, sizes: int) -> Tensor:
    if not sizes:
        return values.sqrt()
    factors, rest = _split(values, sizes)
    return torch.cat([factors.sqrt(), rest], dim=-1)


def _width(lower: Tensor, upper: Tensor, sizes: int) -> Tensor:
    return _bent(upper, sizes) - _bent(lower, sizes)


def _split(values: Tensor, sizes: int) -> tuple[Tensor, Tensor]:
    """Stiffness factors and sizes."""
    factors = values.shape[-1] - sizes
    return values[..., :factors], values[..., factors:]
