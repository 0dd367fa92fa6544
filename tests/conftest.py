"""Two buildings small enough to be calibrated in seconds, and a study of one of them."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import HealthCheck, settings

from tests import documents

# A busy machine is no fault of what is tested.
settings.register_profile(
    "any machine", deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("any machine")

# Each of several test processes has one processor: threads of their own would fight for it. Read by
# the numerical libraries when they are first imported, which is after this.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("OMP_NUM_THREADS", "1")


# What takes longest goes first, so that no process ends long after the others. The walk through all
# commands that tests/cli shares is made by its first file.
FIRST = ("cli/test_commands", "test_pages", "workflow", "discrepancy", "benchmarks", "cli")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Files as a whole: what the tests of one share is made once, by one process."""
    from xdist.scheduler import LoadFileScheduling

    config.option.loadscopereorder = False
    return LoadFileScheduling(config, log)


def pytest_collection_modifyitems(items):
    def rank(item):
        starts = (item.nodeid.startswith(f"tests/{name}") for name in FIRST)
        return next((place for place, found in enumerate(starts) if found), len(FIRST))

    if "PYTEST_XDIST_WORKER" in os.environ:
        items.sort(key=rank)


@pytest.fixture(scope="session")
def opensees():
    """OpenSeesPy, which fails to import where the system lacks BLAS."""
    try:
        import openseespy.opensees as module
    except (ImportError, RuntimeError) as error:
        pytest.skip(f"OpenSeesPy cannot be imported: {error}")
    return module


def harmonic_displacement(operators, theta, frequency_hz, load, damping):
    """(K + i w C - w^2 M)^-1 f of the whole model, (m, 6N), zero at the supports."""
    from scipy.sparse import csc_matrix
    from scipy.sparse.linalg import spsolve

    stiffness, mass = operators.stiffness(theta), operators.mass
    if isinstance(damping, tuple):
        damping = damping[0] * mass + damping[1] * stiffness
    force = operators.gather(load).astype(complex)
    return [
        operators.expand(spsolve(csc_matrix(stiffness + 1j * w * damping - w**2 * mass), force))
        for w in 6.283185307179586 * frequency_hz
    ]


@pytest.fixture(scope="session")
def harmonic():
    return harmonic_displacement


# No two stories are alike, so that no story can stand for another unnoticed.
TOWER = """\
name = "tower"
title = "Two-story tower"
kind = "shear"
frequency_grid = { start = "0.2 Hz", step = "0.2 Hz", count = 60 }
prior.theta = { lower = 0.5, upper = 2 }
prior.zeta = { lower = 0.01, upper = 0.1 }

[[stories]]
name = "low"
mass = "3 t"
stiffness = "4 MN/m"

[[stories]]
name = "high"
mass = "2 t"
stiffness = "2.5 MN/m"

[damping]
law = "constant"
ratio = 0.05
"""


def cabin():
    """A wall on one side of the lower story; the lowest mode goes across the base motion."""
    return documents.frame(
        {"A": 0.0, "B": 4.0},
        {"P": 0.0, "Q": 5.0},
        {"low": 3.2, "high": 2.8},
        name="cabin",
        title="Two-story cabin",
        size=2.5,
        grid=(0.25, 80),
        ratio=0.03,
        sections={
            "column": documents.rectangle(0.25, 0.35),
            "beam": documents.rectangle(0.2, 0.4),
        },
        walls=[{"along": "P", "from": "A", "to": "B", "thickness": 0.06, "stories": ["low"]}],
        slabs=[{"x": ["A", "B"], "y": ["P", "Q"], "thickness": 0.15}],
        floor_mass=[{"total": 40e3}],
        sensors={"direction": "x", "points": ["P-B", "Q-A"]},
        prior={"theta": {"lower": 0.5, "upper": 2.0}, "zeta": {"lower": 0.01, "upper": 0.06}},
        reduction={"tolerance": 0.1},
    )


@pytest.fixture(scope="session")
def built_once(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """A folder by its name, which is filled once for all processes that run tests."""
    from filelock import FileLock

    base = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        base = base.parent

    def build(name: str, fill: Callable[[Path], object]) -> Path:
        folder, done = base / f"shared_{name}", base / f"shared_{name}.done"
        with FileLock(base / f"shared_{name}.lock"):
            if not done.exists():
                shutil.rmtree(folder, ignore_errors=True)
                folder.mkdir()
                fill(folder)
                done.touch()
        return folder

    return build


@pytest.fixture(scope="session")
def buildings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with tower.toml, a shear building, and cabin.toml, a frame."""
    from femupdate.building import from_document, save_building

    folder = tmp_path_factory.mktemp("buildings")
    (folder / "tower.toml").write_text(TOWER, encoding="utf-8")
    save_building(from_document(cabin()), folder / "cabin.toml")
    return folder


@pytest.fixture(scope="session")
def tower_file(buildings: Path) -> Path:
    """A two-story shear building."""
    return buildings / "tower.toml"


@pytest.fixture(scope="session")
def cabin_file(buildings: Path) -> Path:
    """A two-story frame of one bay on a coarse mesh."""
    return buildings / "cabin.toml"


@pytest.fixture(scope="session")
def tower_observation(buildings: Path, tower_file: Path) -> SimpleNamespace:
    """Histories of the tower: `path`, and the true `theta` and `zeta` behind them."""
    from femupdate.building import load_building
    from femupdate.simulation import SimulationSettings, simulate_observation, write_simulation

    settings = SimulationSettings(
        theta=(0.8, 1.3), zeta=0.05, duration_s=60.0, sampling_hz=50.0, band_hz=(0.3, 20.0), seed=3
    )
    simulation = simulate_observation(load_building(tower_file), settings)
    path = write_simulation(simulation, buildings / "tower_observation.csv").observation
    return SimpleNamespace(path=path, theta=(0.8, 1.3), zeta=0.05, histories=simulation.histories)


@pytest.fixture(scope="session")
def tower_study(built_once, tower_file: Path, tower_observation: SimpleNamespace) -> Path:
    """The folder of a study of the tower with a posterior; tests work on copies of it."""
    from femupdate.study import Study
    from femupdate.workflow import (
        CalibrationSettings,
        ObservationSource,
        calibrate_study,
        open_study,
    )

    def fill(folder: Path) -> None:
        study, settings = Study(folder), CalibrationSettings(particles=400, exact=True)
        source = ObservationSource(tower_observation.path)
        calibrate_study(study, open_study(study, str(tower_file)), source, settings)

    return built_once("tower", fill)


@pytest.fixture
def calibrated(tower_study: Path, tmp_path: Path) -> Path:
    """A study of the tower with a posterior, for one test alone."""
    return Path(shutil.copytree(tower_study, tmp_path / "calibrated"))
