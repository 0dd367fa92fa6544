"""Effects that are not in the catalogue, to see that the finder does not give them a wrong name."""

import math

from scipy.sparse import csc_matrix
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.effects.drawn_building import DrawnBuilding, Glyph
from femupdate.effects.effect import UNSCALED, Effect, Parameter, Stiffness, Terms, as_complex
from femupdate.effects.structure import Structure

_TOP_HZ = 20.0


class GroundTie(Effect):
    """A spring between a floor and the ground."""

    name = "ground_tie"
    title = "Tie to the ground"
    sentence = "The floor is held by something that stands on the ground beside the building."
    parameters = (Parameter("size", "1", 0.1, lower=0.0, upper=2.0),)

    def places(self, structure: Structure) -> tuple[str, ...]:
        """Every floor but the two lowest, which the catalogue's brace ties to the ground."""
        return structure.floors[2:]

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """A spring beside the floor."""
        edge, _ = drawn.edges(drawn.level(place))
        return (Glyph.of("spring", edge - drawn.along(0.25 * drawn.size), edge),)

    def terms(self, structure: Structure, place: str) -> Terms:
        """A spring that takes the base shear over the roof's displacement."""
        return _spring(structure, structure.floor_rows[[structure.floors.index(place)]])


def _spring(structure: Structure, stretch: Floats) -> Terms:
    """A spring along a row (1, n), as stiff as the base shear over the roof's displacement."""
    row = csc_matrix(stretch)
    roof = float(structure.floor_rows[-1] @ structure.static)
    spring = float(structure.rigid_mass[0, 0]) / roof
    return Terms(stiffness=(Stiffness(UNSCALED, csc_matrix(spring * (row.T @ row))),))


class SensorResonance(Effect):
    """A sensor on a soft mount: a resonance of its own on one channel."""

    name = "sensor_resonance"
    title = "Resonance of a sensor's mount"
    sentence = "The sensor of one floor shakes on its own mount."
    parameters = (Parameter("size", "1", 0.3, lower=0.0, upper=1.0),)
    instrument = True

    def places(self, structure: Structure) -> tuple[str, ...]:
        """Every floor."""
        return structure.floors

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """The floor's sensors."""
        return drawn.sensors(place)

    def terms(self, structure: Structure, place: str) -> Terms:
        """Nothing in the structure."""
        return Terms()

    def observe(self, frf: Tensor, omega: Tensor, sizes: Tensor, rows: tuple[int, ...]) -> Tensor:
        """A share of the signal comes through a mount of 0.4 times the top frequency."""
        ratio = omega / (0.4 * 2.0 * math.pi * _TOP_HZ)
        carried = as_complex(ratio.new_ones(()), 0.1 * ratio)
        mount = carried / (carried - ratio**2)
        changed = frf.clone()
        share = sizes[:, :1, None].to(frf.dtype)
        changed[:, list(rows)] = frf[:, list(rows)] * (1.0 + share * (mount - 1.0))
        return changed


UNCATALOGUED: tuple[Effect, ...] = (GroundTie(), SensorResonance())
