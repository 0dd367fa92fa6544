"""What the steps are held against: a chain of masses and springs solved by numpy alone."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from femupdate.study import Study
from femupdate.workflow import StudyModel, open_study

MASSES = np.array([3000.0, 2000.0])  # of the tower, kg
SPRINGS = np.array([4e6, 2.5e6])  # N/m


@pytest.fixture(scope="session")
def tower_modes() -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Natural frequencies (2,), Hz, and mass-orthonormal modes (2, 2) of the tower at theta."""

    def solve(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        low, high = SPRINGS * np.asarray(theta)
        K = np.array([[low + high, -high], [-high, high]])
        root = np.sqrt(MASSES)
        squared, vectors = np.linalg.eigh(K / np.outer(root, root))
        return np.sqrt(squared) / (2 * np.pi), vectors / root[:, None]

    return solve


@pytest.fixture(scope="session")
def tower_frf(
    tower_modes: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
) -> Callable[..., np.ndarray]:
    """Floor over base acceleration (2, k) of the tower, complex, by its modes."""

    def respond(theta: np.ndarray, zeta: float, frequency_hz: np.ndarray) -> np.ndarray:
        own, modes = tower_modes(theta)
        share = modes * (MASSES @ modes)  # (floor, mode)
        ratio = np.asarray(frequency_hz)[:, None] / own
        # Absolute acceleration: base plus relative, of each mode r^2 / (1 - r^2 + 2 i zeta r).
        amplification = 1.0 + ratio**2 / (1.0 - ratio**2 + 2j * zeta * ratio)
        return share @ amplification.T

    return respond


@pytest.fixture(scope="session")
def grid_about() -> Callable[[np.ndarray], tuple[np.ndarray, float]]:
    """Points (n, 3) six sd to either side of draws (s, 3) of theta and zeta, and ln of the prior
    mass of each of the tower.

    Sums over steps of .6 sd are right to exp(-2 pi^2 / .6^2), were the posterior a Gaussian.
    """

    def spread(draws: np.ndarray) -> tuple[np.ndarray, float]:
        mean, sd = draws.mean(axis=0), draws.std(axis=0)
        axes = np.linspace(mean - 6.0 * sd, mean + 6.0 * sd, 21).T
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        return points, float(np.log(np.prod(0.6 * sd) / (1.5 * 1.5 * 0.09)))

    return spread


@pytest.fixture
def tower(calibrated: Path) -> Study:
    """A study of the tower with a posterior, for one test alone."""
    return Study(calibrated)


@pytest.fixture(scope="session")
def tower_model(tower_study: Path) -> StudyModel:
    """The tower's model."""
    return open_study(Study(tower_study))


@pytest.fixture
def cabin_study(cabin_built: Study, tmp_path: Path) -> Study:
    """A study of the cabin, built, for one test alone."""
    import shutil

    return Study(shutil.copytree(cabin_built.folder, tmp_path / "cabin"))


@pytest.fixture(scope="session")
def cabin_built(built_once: Callable[..., Path], cabin_file: Path) -> Study:
    """A study of the cabin with its model and nothing else."""
    return Study(built_once("cabin", lambda folder: open_study(Study(folder), str(cabin_file))))
