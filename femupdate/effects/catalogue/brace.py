"""A brace or tie that the model does not know of."""

import numpy as np

from femupdate.effects.effect import DrawnBuilding, Effect, Glyph, SpringTerms, Sway, Terms, change
from femupdate.effects.structure import TRANSLATION, Structure

_GROUND = "ground"


class Brace(Effect):
    """A spring between two floors, or between a floor and the ground."""

    name = "brace"
    title = "Brace or tie"
    sentence = (
        "A brace, a stair flight, a pipe or a tie joins two floors, or a floor and the ground, "
        "and carries force past the walls and columns of the model."
    )
    clause = "A brace {where} has {size} of the building's stiffness"
    settled_by = "a look at the facades, stairs and shafts, and behind the cladding"
    parameters = change("stiffness over that of the building", 0.2, 0.0, 3.0)

    def places(self, structure: Structure) -> tuple[str, ...]:
        """Two floors one or two stories apart, as in "2F-4F", or "ground-3F".

        In one story of a shear building it could not be told from the story's factor.
        """
        names = (_GROUND, *structure.floors)
        spans = [span for n in (1, 2)[structure.is_stick :] for span in _spans(structure, n)]
        return tuple(f"{names[low]}-{names[high]}" for low, high in sorted(spans))

    def basis_questions(self, structure: Structure) -> tuple[tuple[str, float], ...]:
        """A brace in every story: their forces on the floors are those of all others."""
        names = (_GROUND, *structure.floors)
        size = self.parameters[0].scale
        return tuple((f"{names[low]}-{names[high]}", size) for low, high in _spans(structure, 1))

    def where(self, place: str) -> str:
        return "between " + place.replace(_GROUND, "the ground").replace("-", " and ", 1)

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """A spring from corner to corner of the stories."""
        return (Glyph.of("spring", *drawn.diagonal(*_levels(drawn.structure, place))),)

    def unit(self, sway: Sway, place: int) -> float:
        """Stiffness by the base shear, 1/m."""
        return 1.0 / sway.roof

    def terms(self, structure: Structure, place: str) -> Terms:
        """Unit size has the stiffness of the building: base shear over roof displacement.

        It acts between the means of the floors over their mass, and no factor scales it.
        """
        low, high = _levels(structure, place)
        rows = np.vstack([np.zeros(structure.floor_means.shape[1]), structure.floor_means])
        shear = float(structure.rigid_mass[TRANSLATION, TRANSLATION])
        spring = shear / structure.roof
        return Terms(springs=SpringTerms((rows[high] - rows[low])[None], np.array([spring])))


def _spans(structure: Structure, stories: int) -> list[tuple[int, int]]:
    """Two levels, 0 is the ground, between which one or two stories stand on one another."""
    feet = [-1, *(1 + foot for foot in structure.building.below)]
    tops = range(1, len(feet))
    lows = [feet[top] if stories == 1 else feet[feet[top]] for top in tops]
    return [(low, top) for low, top in zip(lows, tops, strict=True) if low >= 0]


def _levels(structure: Structure, place: str) -> tuple[int, int]:
    """Numbers of the lower and the upper level, 0 for the ground."""
    names = (_GROUND, *structure.floors)
    pairs = [(k, n) for n in range(len(names)) for k in range(n)]
    return next((k, n) for k, n in pairs if f"{names[k]}-{names[n]}" == place)
