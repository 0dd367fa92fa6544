"""A frame by OpenSees or MYSTRAN: modes of a finer mesh with an effect in it."""

import os
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from femupdate.arrays import Floats
from femupdate.building import FrameBuilding
from femupdate.effects import CATALOGUE, Effect
from femupdate.effects.catalogue.added_mass import AddedMass
from femupdate.effects.families import MemberStiffness
from femupdate.effects.structure import Structure
from femupdate.fe import Beams, Elements, FiniteElementModel, PointMasses, assemble, bulk_data
from femupdate.fe.model import DOF_PER_NODE
from femupdate.simulation import fine_model

from ..frame_coverage.opensees import opensees_modes
from .stick import STEP_S

MYSTRAN = "MYSTRAN"  # environment variable with the path of the program
_MODES = 60


@dataclass(frozen=True)
class Modes:
    """Modes that a motion of the base drives.

    Attributes:
        omega: (m,) rad/s.
        floors: (f, m) shapes times participation.
    """

    omega: Floats
    floors: Floats

    def respond(self, zeta: float, base: Floats) -> Floats:
        """Absolute accelerations (f, n), every `STEP_S`, by the transform of a padded record."""
        count = 4 * len(base)
        turning = 2.0 * np.pi * np.fft.rfftfreq(count, STEP_S)
        driven = np.fft.rfft(base, count)
        seen = np.repeat(driven[None], len(self.floors), axis=0)
        for omega, shape in zip(self.omega, self.floors.T, strict=True):
            denominator = omega**2 - turning**2 + 2j * zeta * omega * turning
            seen = seen + shape[:, None] * (turning**2 / denominator * driven)
        return np.fft.irfft(seen, count)[:, : len(base)]


def frame_modes(
    building: FrameBuilding,
    theta: Floats,
    effects: Sequence[tuple[str, str, float]],
    *,
    mesh_size: float,
    shell: str,
) -> Modes:
    """Modes by OpenSees, or by MYSTRAN where the kind of shell is its own.

    Args:
        building: a frame.
        effects: name, place and size of effects of mass or of members, in the catalogue's words.
        mesh_size: m.
        shell: ASDShellQ4 or ShellMITC4 of OpenSees, MIN4T of MYSTRAN.
    """
    fine = fine_model(building, mesh_size, building.sensors.points)
    structure = fine.structure
    mesh = structure.mesh
    model = mesh.model
    for name, place, size in effects:
        model = changed(structure, model, CATALOGUE[name], place, size)
    nodes = {floor: [int(node) for node in mesh.floor_nodes[floor]] for floor in mesh.floors}
    if shell != "MIN4T":
        modal = opensees_modes(model, theta, shell, structure.direction, list(nodes.items()))
        omega = np.sqrt(np.diag(modal.stiffness_constant))
        return Modes(omega, modal.floor_shapes * modal.excitation)
    omega, shapes = _by_mystran(model, theta, shell)
    operators = assemble(model)
    everywhere = operators.rigid_translation(structure.direction)
    share = shapes.reshape(len(omega), -1) @ (operators.mass_full @ everywhere)
    axis = structure.direction
    floors = [shapes[:, own, axis].mean(axis=1) * share for own in nodes.values()]
    return Modes(omega, np.array(floors))


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


def _by_mystran(model: FiniteElementModel, theta: Floats, shell: str) -> tuple[Floats, Floats]:
    """Angular frequencies (m,) and shapes (m, nodes, 6) of unit generalised mass."""
    scaled = model.mapped(lambda block: block.scaled(np.asarray(theta)[block.group]))
    case = "SPC = 1\nMETHOD = 1\nDISPLACEMENT = ALL\n"
    bulk = f"BEGIN BULK\nPARAM,QUAD4TYP,{shell}\nPARAM,COUPMASS,1\nEIGRL,1,,,{_MODES}\n"
    deck = bulk_data(scaled).replace("SPC = 1\n", case).replace("BEGIN BULK\n", bulk)
    with TemporaryDirectory() as folder:
        Path(folder, "frame.bdf").write_text(deck)
        subprocess.run([os.environ[MYSTRAN], "frame.bdf"], cwd=folder, check=True, stdout=-3)
        lines = Path(folder, "frame.F06").read_text(errors="replace").splitlines()
    start = next(k for k, line in enumerate(lines) if "R E A L   E I G E N V A L U E S" in line)
    omega = np.array([float(line.split()[3]) for line in lines[start + 4 : start + 4 + _MODES]])
    shapes = np.zeros((_MODES, len(model.nodes), 6))
    mode = -1
    for line in lines[start + 4 + _MODES :]:
        words = line.split()
        if "OUTPUT FOR EIGENVECTOR" in line:
            mode += 1
        elif mode >= 0 and len(words) == 8 and words[0].isdigit() and words[1].isdigit():
            shapes[mode, int(words[0]) - 1] = [float(word) for word in words[2:]]
    return omega, shapes
