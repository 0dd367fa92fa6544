"""Effects that are not in the catalogue, to see that the finder does not give them a wrong name."""

import math

import numpy as np
from scipy.sparse import csc_matrix
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.effects import DrawnBuilding, Effect, Glyph, Terms
from femupdate.effects.catalogue.added_mass import AddedMass
from femupdate.effects.effect import UNSCALED, EffectParameter, Stiffness, as_complex
from femupdate.effects.families import ChannelEffect
from femupdate.effects.structure import Structure
from femupdate.fe import Elements, FiniteElementModel, assemble

_TOP_HZ = 20.0


class GroundTie(Effect):
    """A spring between a floor and the ground."""

    name = "ground_tie"
    title = "Tie to the ground"
    sentence = "The floor is held by something that stands on the ground beside the building."
    parameters = (EffectParameter("size", "1", 0.1, lower=0.0, upper=2.0),)

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


class SensorResonance(ChannelEffect):
    """A sensor on a soft mount: a resonance of its own on one channel."""

    name = "sensor_resonance"
    title = "Resonance of a sensor's mount"
    sentence = "The sensor of one floor shakes on its own mount."
    parameters = (EffectParameter("size", "1", 0.3, lower=0.0, upper=1.0),)

    def factor(self, omega: Tensor, sizes: Tensor) -> Tensor:
        """A share of the signal comes through a mount of 0.4 times the top frequency."""
        ratio = omega / (0.4 * 2.0 * math.pi * _TOP_HZ)
        carried = as_complex(ratio.new_ones(()), 0.1 * ratio)
        mount = carried / (carried - ratio**2)
        return 1.0 + sizes[:, :1].to(mount.dtype) * (mount - 1.0)


class CornerMass(AddedMass):
    """Mass on a quarter of a floor, at one corner of the plan."""

    name = "corner_mass"
    title = "Mass at a corner"
    sentence = "One corner of the floor carries more than the model gives it."
    parameters = (EffectParameter("size", "1", 0.15, lower=0.0, upper=1.0),)

    def places(self, structure: Structure) -> tuple[str, ...]:
        """Every floor of a frame."""
        return () if structure.mesh is None else structure.floors

    def masses(self, structure: Structure, place: str) -> Floats:
        """What unit size adds to every point of the structure (m,), kg: the floor's mass."""
        whole, plan = super().masses(structure, place), structure.points.position[:, :2]
        own = plan[whole > 0.0]
        corner = (plan <= 0.5 * (own.min(axis=0) + own.max(axis=0))).all(axis=1)
        along = structure.points.axis == structure.direction
        there = np.where(corner, whole, 0.0)
        return there * (whole[along].sum() / there[along].sum())


class LocalCrack(Effect):
    """A crack across the foot of one end of the walls of a story."""

    name = "local_crack"
    title = "Crack at the foot of a wall"
    sentence = "One end of the story's walls is cracked at its foot."
    parameters = (EffectParameter("size", "1", 0.4, lower=-0.95, upper=0.0),)

    def places(self, structure: Structure) -> tuple[str, ...]:
        """Every story with walls."""
        if structure.mesh is None:
            return ()
        walls = [block.group[block.kind == "wall"] for block in structure.mesh.model.elements]
        return tuple(structure.mesh.story_names[k] for k in np.unique(np.concatenate(walls)))

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """The walls of the story."""
        return drawn.members(("wall",), place)

    def terms(self, structure: Structure, place: str) -> Terms:
        """The stiffness of the elements that are cracked."""
        assert structure.operators is not None
        assert structure.mesh is not None
        story = structure.mesh.story_names.index(place)
        twice = assemble(self.cracked(structure, place, 1.0)).stiffness_terms[story]
        own = csc_matrix(twice - structure.operators.stiffness_terms[story])
        return Terms(stiffness=(Stiffness(story, own),))

    def cracked(self, structure: Structure, place: str, size: float) -> FiniteElementModel:
        """The model with the crack in it."""
        mesh = structure.mesh
        assert mesh is not None
        story = mesh.story_names.index(place)

        def changed(block: Elements) -> Elements:
            walls = (block.kind == "wall") & (block.group == story)
            if not walls.any():
                return block
            middle = mesh.model.nodes[block.nodes].mean(axis=1)[:, [structure.direction, 2]]
            low, high = middle[walls].min(axis=0), middle[walls].max(axis=0)
            foot = (middle <= low + (high - low) / 3.0).all(axis=1)
            return block.scaled(np.where(walls & foot, 1.0 + size, 1.0))

        return mesh.model.mapped(changed)


UNCATALOGUED: tuple[Effect, ...] = (GroundTie(), SensorResonance(), CornerMass(), LocalCrack())
