"""Mass on one floor that the model does not know of."""

import numpy as np

from femupdate.arrays import Floats
from femupdate.effects.drawn_building import DrawnBuilding, Glyph
from femupdate.effects.effect import Effect, EffectParameter, Terms, mass_terms
from femupdate.effects.structure import Structure


class AddedMass(Effect):
    """A share of the mass of one floor, spread like the floor's own."""

    name = "added_mass"
    title = "Added mass"
    sentence = (
        "The floor carries more (or less) mass than the model gives it: equipment, partitions, "
        "a water tank, or a wrong unit weight."
    )
    clause = "{place} carries {change} mass than modelled"
    sits = "every floor"
    settled_by = "a look at what stands on the floor, and its weight"
    parameters = (
        EffectParameter("size", "1", 0.1, lower=-0.5, upper=1.0, text="share of the floor's mass"),
    )

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """A ball on the floor."""
        radius = 0.055 * drawn.size
        foot = drawn.centre(drawn.level(place))
        return (Glyph.of("ball", foot + np.array([0.0, 0.0, radius]), radius),)

    def terms(self, structure: Structure, place: str) -> Terms:
        """The masses of the floor's nodes once more."""
        return mass_terms(structure, self.masses(structure, place))

    def masses(self, structure: Structure, place: str) -> Floats:
        """What unit size adds to every point of the structure (m,), kg."""
        here = structure.level_of == structure.floors.index(place)
        return np.where(here, structure.points.mass, 0.0)

    def basis_questions(self, structure: Structure) -> tuple[tuple[str, float], ...]:
        """None: mass that is spread like a floor's own hardly changes a shape."""
        return ()
