"""A chain of masses and springs with what a model may lack, solved frequency by frequency."""

from dataclasses import dataclass, replace

import numpy as np

from tests.documents import reduced_stick


@dataclass(frozen=True)
class Chain:
    """Floors on stories, on a base that may sway or rock."""

    masses: np.ndarray  # (n,) kg, bottom to top
    springs: np.ndarray  # (n,) N/m, of the stories
    zeta: float | None = None  # damping ratio of every mode of the chain on a rigid base
    proportional: tuple[float, float] | None = None  # (a, b) of C = a M + b K instead
    heights: np.ndarray | None = None  # (n,) of the floors, m
    rocking: float | None = None  # rotational spring under the base, N m/rad
    sway: float | None = None  # horizontal spring under the base, N/m
    dashpots: np.ndarray | None = None  # (n,) N s/m, of the stories
    # (masses, springs, dashpots) of a second chain that stands on the roof
    tower: tuple | None = None

    def but(self, **changes):
        return replace(self, **changes)

    def at(self, theta, **changes):
        """With its springs times factors."""
        return self.but(springs=np.asarray(theta) * self.springs, **changes)

    def reduced(self):
        """The same as femupdate has it."""
        return reduced_stick(self.masses, self.springs)

    @property
    def matrices(self):
        """M and K of the floors on a rigid base."""
        return np.diag(self.masses), _stiffness(self.springs)

    def frf(self, frequency_hz):
        """Absolute acceleration of the floors over that of the ground, (n, k), complex."""
        K, M, C, absolute, load = self._matrices()
        count = len(self.masses)
        columns = []
        for w in 2.0 * np.pi * np.asarray(frequency_hz):
            moved = np.linalg.solve(K + 1j * w * C - w**2 * M, load)
            columns.append(1.0 + w**2 * (absolute @ moved)[:count])
        return np.stack(columns, axis=1)

    @property
    def modes(self):
        """Circular frequencies (n,) and mass-orthonormal shapes (n, n) on a rigid base."""
        root = np.sqrt(self.masses)
        squared, vectors = np.linalg.eigh(_stiffness(self.springs) / np.outer(root, root))
        return np.sqrt(squared), vectors / root[:, None]

    @property
    def static_roof(self):
        """Displacement of the roof under unit acceleration of the base, m/(m/s2)."""
        shear = np.cumsum(self.masses[::-1])[::-1]
        return float((shear / self.springs).sum())

    def _matrices(self):
        """K, M, C of the floors' own motions and the base's, absolute motions, and the load."""
        masses, springs = np.asarray(self.masses), np.asarray(self.springs)
        dashpots = np.zeros(len(springs)) if self.dashpots is None else np.asarray(self.dashpots)
        heights = np.zeros(len(masses)) if self.heights is None else np.asarray(self.heights)
        if self.tower:
            masses = np.append(masses, self.tower[0])
            springs = np.append(springs, self.tower[1])
            dashpots = np.append(dashpots, self.tower[2])
            heights = np.append(heights, np.full(len(self.tower[0]), heights[-1]))
        own, count = len(self.masses), len(masses)
        free = [
            (shape, spring)
            for shape, spring in ((np.ones(count), self.sway), (heights, self.rocking))
            if spring is not None
        ]
        absolute = np.column_stack([np.eye(count), *(shape for shape, _ in free)])
        M = absolute.T @ np.diag(masses) @ absolute
        K = np.diag(np.append(np.zeros(count), [spring for _, spring in free]))
        K[:count, :count] = _stiffness(springs)
        if self.proportional is not None:
            C = self.proportional[0] * M + self.proportional[1] * K
        else:
            omega, shapes = self.modes
            moved = np.diag(self.masses) @ shapes
            C = np.zeros_like(K)
            C[:own, :own] = moved @ np.diag(2.0 * self.zeta * omega) @ moved.T
        C[:count, :count] += _stiffness(dashpots)
        return K, M, C, absolute, absolute.T @ masses


def _stiffness(springs):
    above = np.append(springs[1:], 0.0)
    return np.diag(springs + above) - np.diag(springs[1:], 1) - np.diag(springs[1:], -1)


def rayleigh(ratio, low_hz, high_hz):
    """(a, b) of C = a M + b K with one ratio at two frequencies."""
    low, high = 2.0 * np.pi * low_hz, 2.0 * np.pi * high_hz
    return 2.0 * ratio * low * high / (low + high), 2.0 * ratio / (low + high)
