"""Truths that OpenSees makes: a building with an effect in it, rebuilt there on its own mesh."""

from dataclasses import replace

import numpy as np

from femupdate.dynamics import System, damping_law
from femupdate.effects import Effect, Terms
from femupdate.effects.catalogue.added_mass import AddedMass
from femupdate.effects.catalogue.members import FlexibleDiaphragm
from femupdate.effects.families import MemberStiffness
from femupdate.effects.structure import Structure
from femupdate.fe import Beams, Elements, FiniteElementModel, PointMasses
from femupdate.fe.model import DOF_PER_NODE
from femupdate.simulation.truth import FineModel, Truth

from ..frame_coverage.opensees import SHELLS, opensees_modes
from .measurement import HiddenEffect, MeasuredBuilding
from .uncatalogued import LocalCrack

# Of the building's mesh size: as fine as models of calibrations are.
MESH = 0.5


def shell_of(number: int) -> str:
    """The shell elements of a trial; the kinds of shaking change faster."""
    return SHELLS[(number // 4) % len(SHELLS)]


def made_by_opensees(effect: Effect) -> bool:
    """Whether an effect can be written for OpenSees: masses, members, a crack, instruments.

    Shells have one modulus there, in their plane and across it.
    """
    if isinstance(effect, FlexibleDiaphragm):
        return False
    return effect.instrument or isinstance(effect, AddedMass | MemberStiffness | LocalCrack)


def possible(effects: tuple[HiddenEffect, ...]) -> tuple[HiddenEffect, ...]:
    """Effects with more mass where less was drawn: no node's own mass may be negative."""
    return tuple(
        (placed, tuple(map(abs, values)) if isinstance(placed.effect, AddedMass) else values)
        for placed, values in effects
    )


def opensees_truth(fine: FineModel, measured: MeasuredBuilding, shell: str) -> Truth:
    """A building with effects, by OpenSees."""
    effects = measured.effects
    structure = fine.structure
    assert structure.mesh is not None
    model = structure.mesh.model
    for one, values in effects:
        if not one.effect.instrument:
            model = changed(structure, model, one.effect, one.place, values[0])
    nodes = np.concatenate([structure.mesh.floor_nodes[floor] for floor in structure.mesh.floors])
    seen = [
        (channel.floor, [int(node)]) for channel, node in zip(fine.channels, nodes, strict=True)
    ]
    reduced = opensees_modes(model, measured.theta, shell, structure.direction, seen)
    instruments = [(one, values) for one, values in effects if one.effect.instrument]
    placed = tuple(one for one, _ in instruments)
    law = damping_law(measured.building)
    system = System(reduced, law, placed, (Terms(),) * len(placed))
    frequency = np.sqrt(np.diag(reduced.stiffness_constant)) / (2.0 * np.pi)
    share = reduced.excitation**2 / structure.rigid_mass[0, 0]
    own = tuple(value for _, values in instruments for value in values)
    return Truth(fine, system, np.zeros(0), own, frequency, share)


def changed(
    structure: Structure, model: FiniteElementModel, effect: Effect, place: str, size: float
) -> FiniteElementModel:
    """A model with an effect in it."""
    if isinstance(effect, AddedMass):
        values = size * effect.masses(structure, place)
        values = values[structure.direction :: DOF_PER_NODE]
        node = np.flatnonzero(values)
        own = model.masses
        return replace(
            model,
            masses=PointMasses(
                node=np.concatenate([own.node, node]),
                mass=np.concatenate([own.mass, np.repeat(values[node][:, None], 3, axis=1)]),
                inertia=np.concatenate([own.inertia, np.zeros((len(node), 3))]),
            ),
        )
    if isinstance(effect, LocalCrack):
        return effect.cracked(structure, place, size)
    assert isinstance(effect, MemberStiffness)
    names = structure.building.story_names
    stories = range(len(names)) if place == "all" else [names.index(place)]

    def scaled(block: Elements) -> Elements:
        chosen = np.isin(block.kind, effect.kinds) & np.isin(block.group, stories)
        factor = np.where(chosen, 1.0 + size, 1.0)
        if not effect.bending_only:
            return block.scaled(factor)
        if not isinstance(block, Beams):
            return block
        return replace(
            block, inertia_y=factor * block.inertia_y, inertia_z=factor * block.inertia_z
        )

    return model.mapped(scaled)
