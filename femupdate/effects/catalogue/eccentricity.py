"""Mass that does not lie in the middle of the floors."""

import numpy as np

from femupdate.effects.effect import DrawnBuilding, Effect, Glyph, Terms, change, mass_terms
from femupdate.effects.structure import Structure


class Eccentricity(Effect):
    """A shift of every floor's mass across the motion."""

    name = "eccentricity"
    title = "Eccentric mass"
    sentence = (
        "The floors' masses lie beside the line on which the model puts them, so that motion in "
        "one direction drives torsion and peaks split in two."
    )
    clause = "The masses lie {size} of the plan's depth beside the middle"
    settled_by = "two sensors on each floor, at opposite sides of the plan"
    parameters = change("shift over plan depth", 0.05, 0.0, 0.15)

    def places(self, structure: Structure) -> tuple[str, ...]:
        """All floors together, where the plan has a depth."""
        across = structure.points.position[:, 1 - structure.direction]
        return ("all",) if np.ptp(across) > 0.0 else ()

    def where(self, place: str) -> str:
        return "on all floors"

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """Balls beside the middle of every floor."""
        aside, across = np.zeros(3), 1 - drawn.structure.direction
        aside[across] = 0.15 * (drawn.high - drawn.low)[across]
        middles = [drawn.centre(level) for level in range(1, len(drawn.levels))]
        arrows = [Glyph.of("arrow", middle, middle + aside) for middle in middles]
        balls = [Glyph.of("ball", middle + aside, drawn.radius) for middle in middles]
        return (*arrows, *balls)

    def terms(self, structure: Structure, place: str) -> Terms:
        """Masses scaled linearly across each floor, so that only their centre moves."""
        across = structure.points.position[:, 1 - structure.direction]
        mass = structure.points.mass
        values = np.zeros(len(across))
        for floor in range(len(structure.floors)):
            along = structure.along_floor(floor)
            arm = across - np.average(across[along], weights=mass[along])
            inertia = float((mass[along] * arm[along] ** 2).sum())
            slope = np.ptp(across[along]) * float(mass[along].sum()) / inertia
            values = np.where(structure.level_of == floor, mass * slope * arm, values)
        return mass_terms(structure, values)
