"""What effects do to frequency responses beside what they do to modes, in closed form."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor

from femupdate.effects.effect import Placed

# |H|^2 below this is rounding; its logarithm would be all that is seen.
_LEAST_SQUARE = 1e-24
_BASE = "base"  # where an instrument sits that only translations of the base know


class Estimate(Protocol):
    """What an estimate makes of complex FRFs (N, f, e).

    Where the base was measured to turn, responses to unit rotation of it come second.
    """

    @property
    def turns(self) -> bool:
        """Whether it asks for these."""
        ...

    def __call__(self, frf: Tensor, turned: Tensor | None = None) -> Tensor:
        """(N, f, k) as measured."""
        ...


def split_sizes(placed: Sequence[Placed], sizes: Tensor) -> list[Tensor]:
    """The parameters (N, q) of all effects, one after the other, each effect's by themselves."""
    counts = [len(effect.effect.parameters) for effect in placed]
    return list(sizes.split(counts, dim=1)) if counts else []


def observed(
    placed: Sequence[Placed],
    floors: tuple[str, ...],
    frf: Tensor,
    omega: Tensor,
    sizes: Tensor,
    over_base: bool = True,
) -> Tensor:
    """FRFs (N, f, k) of the floors at omega (k,), rad/s, as instruments with effects give them.

    `over_base` says whether they are taken over the reading of the base's horizontal sensor.
    """
    for listed, values in zip(placed, split_sizes(placed, sizes), strict=True):
        if over_base or listed.place != _BASE:
            frf = listed.effect.observe(
                frf, omega, values, listed.effect.place_rows(listed.place, floors)
            )
    return frf


@dataclass(frozen=True)
class ClosedForm:
    """How the base turns and errors of instruments; nothing where there are no effects."""

    placed: tuple[Placed, ...] = ()  # the effects
    # of each effect, rotation of the base per unit translation and size, rad/m
    pitch: tuple[float, ...] = ()
    floors: tuple[str, ...] = ()  # names, bottom to top
    levels: tuple[float, ...] = ()  # (f,) heights of the floors above the base, m
    stories: int = 0  # number of stiffness factors, which come before the sizes
    top_hz: float = 0.0  # top of the frequency grid

    @property
    def changes(self) -> bool:
        """Whether any effect does something here."""
        return any(self.pitch) or any(listed.effect.instrument for listed in self.placed)

    def log_frf(
        self,
        parts: tuple[Tensor, Tensor],
        omega: Tensor,
        sizes: Tensor,
        *,
        least: float = _LEAST_SQUARE,
        seen: Estimate | None = None,
    ) -> Tensor:
        """ln|H| (N, f, k) as it is measured.

        Args:
            parts: real and imaginary part (N, f, k) as if the base only translated.
            sizes: (N, q) of the effects.
            least: added to |H|^2.
            seen: what an estimate makes of complex FRFs, before the logarithm is taken.
        """
        if self.changes or seen is not None:
            frf = self.frf(parts, omega, sizes)
            frf = frf if seen is None else seen(frf)
            parts = frf.real, frf.imag
        return 0.5 * torch.log(parts[0].square() + parts[1].square() + least)

    def frf(self, parts: tuple[Tensor, Tensor], omega: Tensor, sizes: Tensor) -> Tensor:
        """Complex FRFs (N, f, k) as sensors give them; arguments are those of `log_frf`."""
        frf = torch.complex(*parts)
        if not self.changes:
            return frf
        rotation, first = sizes.new_zeros(len(sizes)), 0
        for listed, pitch in zip(self.placed, self.pitch, strict=True):
            if pitch:
                rotation = rotation + pitch * sizes[:, first]
            first += len(listed.effect.parameters)
        leaning = rotation[:, None] * sizes.new_tensor(self.levels)
        return observed(self.placed, self.floors, frf + leaning[:, :, None], omega, sizes)
