"""Full equations written out with dense matrices."""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import eigh

from femupdate.fe import Beams, Shells, assemble


@dataclass(frozen=True)
class Equations:
    """Relative motion u of a building on a base that moves by y = (translation, rotation)."""

    # K, M: (n, n)
    K: np.ndarray
    M: np.ndarray
    rigid: np.ndarray  # (n, 2) motion of the degrees of freedom with the base
    force: np.ndarray  # (n, 2) inertia force per unit acceleration of the base
    rigid_mass: np.ndarray  # (2, 2) force and moment on the base per unit acceleration of it
    rows: np.ndarray  # (f, n) floors
    levels: np.ndarray  # (f,) their heights
    # Spring under the base by direction, 0 translation, 1 rotation; others rigid
    ground: dict = field(default_factory=dict)
    pitch: float = 0.0  # rotation of the ground per unit translation of it
    moved: tuple = (1.0, 0.0)  # translation and rotation of the ground by itself
    dashpots: tuple = ()  # (row (n,), rate)
    appendages: tuple = ()  # (floor, mass, circular frequency, damping ratio)
    # (f, n) mean motion of the floors over their mass, that of the rows where None
    means: np.ndarray | None = None

    def but(self, **changes):
        return replace(self, **changes)

    def with_mass(self, diagonal):
        """More point masses (n,) on the degrees of freedom."""
        force = diagonal[:, None] * self.rigid
        return self.but(
            M=self.M + np.diag(diagonal),
            force=self.force + force,
            rigid_mass=self.rigid_mass + self.rigid.T @ force,
        )

    def frf(self, frequency_hz, zeta=None, proportional=None):
        """Absolute acceleration of the floors over that of the ground, (f, k)."""
        K, M, load, rows, direct = self._on_ground()
        if proportional is None:
            C = _modal_damping(K, M, zeta)
        else:
            C = proportional[0] * M + proportional[1] * K
        for row, rate in self.dashpots:
            wide = np.append(row, np.zeros(len(K) - len(row)))
            C = C + rate * np.outer(wide, wide)
        for floor, mass, omega, ratio in self.appendages:
            K, M, C, load, rows = self._appended((K, M, C, load, rows), floor, mass, omega, ratio)
        columns = []
        for w in 2.0 * np.pi * np.asarray(frequency_hz):
            moved = np.linalg.solve(K + 1j * w * C - w**2 * M, load)
            columns.append(direct + w**2 * (rows @ moved))
        return np.stack(columns, axis=1)

    @property
    def _motion(self):
        translation, rotation = self.moved
        return np.array([translation, rotation + self.pitch * translation])

    def _on_ground(self):
        """Matrices with the motion of the base against the ground as last coordinates."""
        free = sorted(self.ground)
        F, R = self.force[:, free], self.rigid_mass[np.ix_(free, free)]
        springs = np.diag([self.ground[k] for k in free])
        nothing = np.zeros_like(F)
        K = np.block([[self.K, nothing], [nothing.T, springs]])
        M = np.block([[self.M, F], [F.T, R]])
        load = np.concatenate([self.force @ self._motion, (self.rigid_mass @ self._motion)[free]])
        floors = np.column_stack([np.ones(len(self.levels)), self.levels])
        return K, M, load, np.column_stack([self.rows, floors[:, free]]), floors @ self._motion

    def _appended(self, matrices, floor, mass, omega, ratio):
        """One more coordinate: the appendage's own motion, against where its floor's frame is."""
        K, M, C, load, rows = matrices
        n = len(K)
        row = (self.rows if self.means is None else self.means)[floor]
        stretch = np.append(-row, np.zeros(n + 1 - len(row)))
        stretch[-1] = 1.0
        with_base = np.array([1.0, self.levels[floor]])
        absolute = np.zeros(n + 1)
        free = sorted(self.ground)
        own = len(self.K)
        absolute[own : own + len(free)] = with_base[free]
        absolute[-1] = 1.0

        def wide(matrix):
            return np.pad(matrix, (0, 1))

        K = wide(K) + mass * omega**2 * np.outer(stretch, stretch)
        C = wide(C) + 2.0 * ratio * omega * mass * np.outer(stretch, stretch)
        M = wide(M) + mass * np.outer(absolute, absolute)
        load = np.append(load, 0.0) + mass * absolute * (with_base @ self._motion)
        return K, M, C, load, np.pad(rows, ((0, 0), (0, 1)))


def _modal_damping(K, M, zeta):
    """C with given ratios; a base without mass has modes that neither move mass nor dissipate."""
    inverse, modes = eigh(M, K)  # of unit modal stiffness
    inverse, modes = inverse[inverse > 1e-12 * inverse[-1]], modes[:, inverse > 1e-12 * inverse[-1]]
    ratio = zeta(inverse**-0.5) if callable(zeta) else zeta
    return K @ modes @ np.diag(2.0 * ratio * inverse**0.5) @ modes.T @ K


def chain_equations(building, theta):
    """A shear building by hand: k_i + k_{i+1} on the diagonal, -k_{i+1} beside it."""
    mass = np.array([story.mass for story in building.stories])
    k = np.append(np.asarray(theta) * [story.spring for story in building.stories], 0.0)
    K = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    heights = np.cumsum([story.height or 1.0 for story in building.stories])
    rigid = np.column_stack([np.ones(len(mass)), heights])
    force = mass[:, None] * rigid
    return Equations(K, np.diag(mass), rigid, force, rigid.T @ force, np.eye(len(mass)), heights)


def frame_equations(mesh, model, theta):
    """A frame by hand, from the mesh's meaning and any model on its nodes."""
    operators = assemble(model)
    x, y, z = model.nodes.T
    along = mesh.direction
    place = (x, y)[along]
    middle = 0.5 * (place.min() + place.max())
    motion = np.zeros((len(model.nodes), 6, 2))
    motion[:, along, 0] = 1.0
    # A small rotation about the horizontal axis that brings what is above forward.
    spin = np.array([0.0, 1.0, 0.0]) if along == 0 else np.array([-1.0, 0.0, 0.0])
    arm = np.column_stack([x, y, z])
    arm[:, along] -= middle
    motion[:, :3, 1] = np.cross(spin, arm)
    motion[:, 3:, 1] = spin
    motion = motion.reshape(-1, 2)
    whole = operators.mass_full.toarray()
    rows = np.zeros((len(mesh.floors), operators.dof))
    for row, nodes in zip(rows, mesh.floor_nodes.values(), strict=True):
        row[6 * np.asarray(nodes) + along] = 1.0 / len(nodes)
    free = operators.free
    means = np.zeros((len(mesh.floors), len(model.nodes), 6))
    for mean, level in zip(means, mesh.floor_level, strict=True):
        mean[:, along] = np.where(np.isclose(z, level), lumped_masses(model), 0.0)
    means = means.reshape(len(means), -1)[:, free]
    return Equations(
        operators.stiffness(theta).toarray(),
        operators.mass.toarray(),
        motion[free],
        (whole @ motion)[free],
        motion.T @ whole @ motion,
        rows[:, free],
        mesh.floor_level,
        means=means / means.sum(axis=1, keepdims=True),
    )


def lumped_masses(model):
    """(N,) mass of each node: a quarter of each shell, half of each bar, and point masses."""
    mass = np.zeros(len(model.nodes))
    shells, beams = model.elements_of(Shells), model.elements_of(Beams)
    sides = model.nodes[shells.nodes]
    area = np.linalg.norm(
        np.cross(sides[:, 1] - sides[:, 0], sides[:, 3] - sides[:, 0]), axis=1
    )  # rectangles
    share = area * shells.thickness * shells.density / 4.0
    np.add.at(mass, shells.nodes, np.repeat(share[:, None], 4, axis=1))
    length = np.linalg.norm(np.diff(model.nodes[beams.nodes], axis=1)[:, 0], axis=1)
    share = length * beams.area * beams.density / 2.0
    np.add.at(mass, beams.nodes, np.repeat(share[:, None], 2, axis=1))
    np.add.at(mass, model.masses.node, model.masses.mass[:, 0])
    return mass
