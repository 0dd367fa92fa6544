"""Stiffness that falls, and damping that grows, with the level of the motion."""

from torch import Tensor

from femupdate.effects.effect import ALL_STORIES, Terms
from femupdate.effects.softening import Softening
from femupdate.effects.structure import Structure


class AmplitudeSoftening(Softening):
    """Stiffness factors and damping ratio that change by one share with every doubling of level."""

    name = "amplitude_softening"
    title = "Stiffness that falls with amplitude"
    sentence = (
        "At a higher level of motion the stories are softer and damp more (cracks that open, "
        "joints and partitions that slip); two observations at different levels show it."
    )
    clause = "Stiffness falls by {lost} with every doubling of the amplitude {where}"
    sits = "all stories together, and every story"
    at = "in"
    settled_by = "a third record at another level"
    needs_levels = True

    def terms(self, structure: Structure, place: str) -> Terms:
        """Number of the story that softens."""
        names = structure.building.story_names
        return Terms(constants=(float(names.index(place) if place in names else ALL_STORIES),))

    def at_level(
        self,
        theta: Tensor,
        zeta: Tensor,
        sizes: Tensor,
        level: float | Tensor,
        constants: tuple[float, ...],
    ) -> tuple[Tensor, Tensor]:
        """Both times (1 + size)^level, level the number of doublings above the reference."""
        softer, story = (1.0 + sizes[:, 0]) ** level, int(constants[0])
        changed = theta * softer[:, None]
        if story != ALL_STORIES:
            changed = theta.clone()
            changed[:, story] = theta[:, story] * softer
        return changed, zeta * (1.0 + sizes[:, 1]) ** level
