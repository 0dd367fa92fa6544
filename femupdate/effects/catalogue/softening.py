"""Stiffness that falls, and damping that grows, with the level of the motion."""

from torch import Tensor

from femupdate.effects.effect import (
    ALL_STORIES,
    DrawnBuilding,
    Effect,
    EffectParameter,
    Glyph,
    LevelChange,
    Terms,
    change,
)
from femupdate.effects.structure import Structure


class AmplitudeSoftening(Effect):
    """Stiffness and damping ratio that change by one share with every doubling of the level."""

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
    parameters = (
        *change("change of stiffness with every doubling of the amplitude", 0.05, -0.5, 0.0),
        EffectParameter(
            "damping",
            "1",
            0.2,
            lower=-0.5,
            upper=2.0,
            text="change of the damping ratio with every doubling of the amplitude",
        ),
    )

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """The near faces of the story, or of all."""
        near = [(story, drawn.plan(story + 1)[0]) for story in drawn.stories(place)]
        faces = [drawn.upright(axis, float(low[axis]), k) for k, low in near for axis in (0, 1)]
        return (Glyph.of("surfaces", faces),)

    def terms(self, structure: Structure, place: str) -> Terms:
        """Number of the story that softens."""
        names = structure.building.story_names
        return Terms(constants=(float(names.index(place) if place in names else ALL_STORIES),))

    def at_level(self, sizes: Tensor, level: float | Tensor) -> LevelChange:
        """Both times (1 + size)^level."""
        return LevelChange((1.0 + sizes[:, 0]) ** level, (1.0 + sizes[:, 1]) ** level)
