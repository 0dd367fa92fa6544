"""Damping laws: the damping ratio of every mode from its circular frequency."""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import torch
from torch import Tensor

from femupdate.building.document import Building


@runtime_checkable
class DampingLaw(Protocol):
    """Damping ratio of each mode.

    `zeta` is the nuisance value of each sample; laws with fixed coefficients ignore it.
    """

    def ratio(self, omega: Tensor, zeta: Tensor) -> Tensor:
        """Damping ratios (N, m) from circular frequencies (N, m), rad/s, and zeta (N,)."""


class ConstantDamping:
    """The same damping ratio, zeta, in all modes."""

    def ratio(self, omega: Tensor, zeta: Tensor) -> Tensor:
        """Damping ratios (N, m): zeta of each sample."""
        return zeta[:, None].expand_as(omega)


class RayleighDamping:
    """C = a0 M + a1 K with fixed coefficients: zeta_j = a0 / (2 omega_j) + a1 omega_j / 2.

    Args:
        ratio: damping ratio at both anchor frequencies.
        frequencies_hz: the two anchor frequencies, Hz.
    """

    def __init__(self, ratio: float, frequencies_hz: tuple[float, float]) -> None:
        low, high = (2.0 * torch.pi * f for f in frequencies_hz)
        self.mass_coefficient = 2.0 * ratio * low * high / (low + high)
        self.stiffness_coefficient = 2.0 * ratio / (low + high)

    def ratio(self, omega: Tensor, zeta: Tensor) -> Tensor:
        """Damping ratios (N, m); `zeta` is not used."""
        return self.mass_coefficient / (2.0 * omega) + self.stiffness_coefficient * omega / 2.0


class ModesDamping:
    """A ratio for each mode, told by its frequency; all in proportion to zeta, the first one's.

    Args:
        ratios: of the modes at these frequencies; linear in ln f between, constant beyond.
        frequencies_hz: ascending, Hz.
    """

    def __init__(self, ratios: Sequence[float], frequencies_hz: Sequence[float]) -> None:
        self.relative = torch.tensor(ratios, dtype=torch.float64) / ratios[0]
        self.places = torch.tensor(frequencies_hz, dtype=torch.float64).mul(2.0 * torch.pi).log()

    def ratio(self, omega: Tensor, zeta: Tensor) -> Tensor:
        """Damping ratios (N, m)."""
        relative, places = self.relative.to(omega), self.places.to(omega)
        relative_at = relative[0].expand_as(omega)
        for k, width in enumerate(places.diff()):
            share = ((omega.log() - places[k]) / width).clamp(0.0, 1.0)
            relative_at = relative_at + share * (relative[k + 1] - relative[k])
        return zeta[:, None] * relative_at


def damping_law(building: Building) -> DampingLaw:
    """The law that a building file names."""
    damping = building.damping
    if damping.anchors is None:
        return ConstantDamping()
    if damping.ratios is not None:
        return ModesDamping(damping.ratios, damping.anchors)
    return RayleighDamping(damping.ratio, (damping.anchors[0], damping.anchors[1]))
