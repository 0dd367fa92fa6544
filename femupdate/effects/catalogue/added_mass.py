"""Mass on one floor that the model does not know of."""

import numpy as np

from femupdate.arrays import Floats
from femupdate.effects.effect import DrawnBuilding, Effect, Glyph, Terms, change, mass_terms
from femupdate.effects.structure import Structure, numbers_of, ranges_of


class AddedMass(Effect):
    """A share of the mass of a floor or of each of several, spread like the floor's own."""

    name = "added_mass"
    title = "Added mass"
    sentence = (
        "The floor carries more (or less) mass than the model gives it: equipment, partitions, "
        "a water tank, or a wrong unit weight."
    )
    clause = "{place} carries {change} mass than modelled"
    sits = "every floor"
    settled_by = "a look at what stands on the floor, and its weight"
    parameters = change("share of the floor's mass", 0.1, -0.5, 1.0)

    def points(self, structure: Structure) -> tuple[str, ...]:
        """Ranges of floors."""
        return ranges_of(structure.floors, structure.building.below)

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """A ball on each floor."""
        radius = 0.055 * drawn.size
        up = np.array([0.0, 0.0, radius])
        levels = [1 + floor for floor in numbers_of(place, drawn.structure.floors)]
        return tuple(Glyph.of("ball", drawn.centre(level) + up, radius) for level in levels)

    def terms(self, structure: Structure, place: str) -> Terms:
        """The masses of the floor's nodes once more."""
        return mass_terms(structure, self.masses(structure, place))

    def masses(self, structure: Structure, place: str) -> Floats:
        """What unit size adds to every point of the structure (m,), kg."""
        here = np.isin(structure.level_of, numbers_of(place, structure.floors))
        return np.where(here, structure.points.mass, 0.0)

    def basis_questions(self, structure: Structure) -> tuple[tuple[str, float], ...]:
        """None: mass that is spread like a floor's own hardly changes a shape."""
        return ()
