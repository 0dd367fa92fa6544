"""The weight above a story, which pushes it further the way it leans."""

import numpy as np

from femupdate.building.kinds import ShearBuilding
from femupdate.effects.effect import DrawnBuilding, Effect, Glyph, SpringTerms, Terms
from femupdate.effects.structure import TRANSLATION, Structure
from femupdate.units import STANDARD_GRAVITY


class PDelta(Effect):
    """A known correction: gravity takes P / h from the stiffness of every story.

    P is the weight above the middle of the story and h its height. Lower stories lose more, so
    that it does not scale all frequencies alike.
    """

    name = "p_delta"
    title = "P-Delta"
    sentence = (
        "The weight above a leaning story pushes it further; it takes weight over height from the "
        "story's stiffness, most from the lowest ones."
    )
    clause = "Gravity takes weight over height from the stiffness of every story"
    settled_by = "masses and heights: it is known where they are, so it is listed and not sought"
    parameters = ()
    correction = True

    def places(self, structure: Structure) -> tuple[str, ...]:
        """All stories together, where their heights are known."""
        building = structure.building
        known = not isinstance(building, ShearBuilding) or all(
            story.height is not None for story in building.stories
        )
        return ("all",) if known else ()

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """An arrow down on the middle of every floor."""
        fall = np.array([0.0, 0.0, 0.12 * drawn.size])
        middles = [drawn.centre(level) for level in range(1, len(drawn.levels))]
        return tuple(Glyph.of("arrow", middle + fall, middle) for middle in middles)

    def terms(self, structure: Structure, place: str) -> Terms:
        """-P / h on the drift of each story, of floor means (Wilson and Habibullah 1987,
        Earthquake Spectra 3, 241); the bow of columns between floors is left out."""
        heights = structure.building.over_foot(structure.levels)
        weight = STANDARD_GRAVITY * structure.story_rigid[:, TRANSLATION]
        drift = structure.building.over_foot(structure.floor_means)
        return Terms(springs=SpringTerms(drift, -weight / heights))
