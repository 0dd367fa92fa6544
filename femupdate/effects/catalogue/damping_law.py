"""Damping whose dependence on frequency differs from the law of the model."""

import torch
from torch import Tensor

from femupdate.effects.effect import DrawnBuilding, Effect, Glyph, Terms, change
from femupdate.effects.structure import Structure

_LAWS = {
    "rayleigh": "Rayleigh's law",
    "proportional": "a law proportional to frequency",
    "mass": "the mass part of Rayleigh's law, which falls with frequency",
}


class OtherDampingLaw(Effect):
    """A mixture of the model's law with another one."""

    name = "damping_law"
    title = "Damping law"
    sentence = (
        "Damping varies with frequency differently from the model's law, so that the peaks of "
        "high and low modes cannot both be right."
    )
    settled_by = "the decay of free vibration in each mode"
    parameters = change("share of the other law", 0.5, -0.9, 3.0)

    def places(self, structure: Structure) -> tuple[str, ...]:
        """Which law: Rayleigh's, or one of its parts, that of stiffness or of mass."""
        return tuple(_LAWS)

    def where(self, place: str) -> str:
        return f"({_LAWS[place]})"

    def said(self, place: str, size: float) -> str:
        if size < 0.0 and place == "proportional":
            return f"Damping falls with frequency: by {-100.0 * size:.3g} % against {_LAWS[place]}"
        return f"Damping follows {_LAWS[place]} by {100.0 * size:.3g} %"

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """A dashpot in every story."""
        below = enumerate(drawn.structure.building.below, 1)
        return tuple(Glyph.of("dashpot", *drawn.diagonal(foot + 1, k)) for k, foot in below)

    def terms(self, structure: Structure, place: str) -> Terms:
        """The first frequency and which law."""
        return Terms(constants=(structure.fundamental[0], float([*_LAWS].index(place))))

    def damping(
        self, ratio: Tensor, omega: Tensor, sizes: Tensor, constants: tuple[float, ...]
    ) -> Tensor:
        """zeta (1 + s (g - 1)), g = 1 at the first frequency (both anchors for Rayleigh's)."""
        first, law = constants
        low, high = 1.0, 6.0  # anchors, of the first frequency
        relative = omega / first
        shapes = (low * high / relative + relative) / (low + high), relative, 1.0 / relative
        shape = shapes[int(law)]
        return torch.clamp(ratio * (1.0 + sizes[:, :1] * (shape - 1.0)), 1e-4, 0.9)
