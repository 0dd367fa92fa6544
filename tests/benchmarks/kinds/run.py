"""Simulated buildings of known truth, calibrated to each kind of observation and to all."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

from femupdate.arrays import Floats
from femupdate.building.files import load_building
from femupdate.building.schema import Building
from femupdate.dynamics.equations import equations_at
from femupdate.effects.structure import TRANSLATION, structure_of
from femupdate.fe.factorization import factorize
from femupdate.measurement.columns import BASE
from femupdate.measurement.write import write_observation_histories
from femupdate.simulation.simulate import (
    SimulationSettings,
    simulate_observation,
    write_simulation,
)
from femupdate.study import Study
from femupdate.workflow.calibrate import calibrate_study
from femupdate.workflow.calibrate_settings import CalibrationSettings
from femupdate.workflow.identify import identify
from femupdate.workflow.model import open_study
from femupdate.workflow.observed import ObservationSource

from ..result import Job, Report, markdown_table

BUILDING = "shear_3dof"
KINDS = ("histories", "FRFs", "modes", "force", "ambient")
ALL = "all together"
_ZETA = 0.03
_MODE_SD, _SHAPE_SD, _FRF_SD = 0.005, 0.03, 0.1
_MODES = 300  # of the full model; what the others do is static
_GIVEN = 6  # modes along the motion that are identified


@dataclass(frozen=True, eq=False)
class _Full:
    """The full model at the true factors.

    Attributes:
        omega: (m,) rad/s.
        shapes: (f, m) of the floors, of unit modal mass.
        moved: (m,) what the base moves.
        lacked: (f, f) m/N and (f,) s2: static displacements under forces and under the base's
            acceleration, without these modes.
    """

    omega: Floats
    shapes: Floats
    moved: Floats
    lacked: tuple[Floats, Floats]

    def over_base(self, frequency_hz: Floats) -> Floats:
        """|H| (f, k) of the floors over the base."""
        return np.abs(1.0 + self._under(self.moved, self.lacked[1], frequency_hz))

    def under_roof(self, frequency_hz: Floats) -> Floats:
        """Accelerance (f, k) of the floors under a force at the roof, 1/kg."""
        return np.abs(self._under(self.shapes[-1], self.lacked[0][:, -1], frequency_hz))

    def _under(self, load: Floats, lacked: Floats, frequency_hz: Floats) -> Any:
        w = 2.0 * np.pi * frequency_hz[:, None]
        motion = 1.0 / (self.omega**2 - w**2 + 2j * _ZETA * self.omega * w)
        return w.T**2 * ((self.shapes * load) @ motion.T + lacked[:, None])


def _full(building: Building, theta: Floats) -> _Full:
    structure = structure_of(building)
    own = equations_at(structure, theta, [])
    rows, base = structure.floor_rows, own.force[:, TRANSLATION]
    count = own.stiffness.shape[0]
    if count <= _MODES:
        squared, vectors = eigh(own.stiffness.toarray(), own.mass.toarray())
    else:
        squared, vectors = eigsh(own.stiffness, _MODES, own.mass, sigma=0.0)
    shapes, moved = rows @ vectors, vectors.T @ base
    whole = factorize(own.stiffness.tocsc()).apply(np.column_stack([rows.T, base]))
    seen = np.column_stack([(shapes / squared) @ shapes.T, (shapes / squared) @ moved])
    lacked = rows @ whole - seen
    return _Full(np.sqrt(squared), shapes, moved, (lacked[:, :-1], lacked[:, -1]))


def run_kinds(job: Job, building: str, buildings: int) -> Report:
    """Calibrate every building to each kind and to all, and compare with the truth."""
    settings = CalibrationSettings(particles=2000, exact=True)
    job.progress.start("Calibrating", buildings * (len(KINDS) + 1))
    away: dict[str, list[Floats]] = {name: [] for name in (*KINDS, ALL)}
    width: dict[str, list[Floats]] = {name: [] for name in (*KINDS, ALL)}
    for number, rng in enumerate(np.random.default_rng(job.seed).spawn(buildings)):
        theta = rng.uniform(0.7, 1.4, len(load_building(building).stories))
        with TemporaryDirectory() as name:
            folder = Path(name)
            files = _files(folder, building, theta, number, rng)
            for kind in (*KINDS, ALL):
                paths = files if kind == ALL else [files[KINDS.index(kind)]]
                study = Study(folder / kind)
                source = ObservationSource(paths[0], further=tuple(paths[1:]))
                report = calibrate_study(study, open_study(study, building), source, settings)
                draws = report.posterior.samples
                width[kind].append(draws.std(axis=0))
                away[kind].append((draws.mean(axis=0) - theta) / draws.std(axis=0))
                job.progress.advance()
    return _report(job, building, {k: np.array(v) for k, v in away.items()}, width)


def _report(
    job: Job, building: str, away: dict[str, Floats], width: dict[str, list[Floats]]
) -> Report:
    content = {
        name: {
            "standard_deviation": float(np.mean(width[name])),
            "rms_z": float(np.sqrt((z**2).mean())),
            "within_90": float((np.abs(z) < 1.645).mean()),
        }
        for name, z in away.items()
    }
    rows = [
        [
            name,
            f"{own['standard_deviation']:.4f}",
            f"{own['rms_z']:.2f}",
            f"{own['within_90']:.0%}",
        ]
        for name, own in content.items()
    ]
    head = ["observations", "mean sd of a factor", "error over sd, rms", "truths within 90 %"]
    name = "kinds" if building == BUILDING else f"kinds_{building}"
    return job.write(name, {"kinds": content}, markdown_table(head, rows), answer=content)


def _files(
    folder: Path, building: str, theta: Floats, number: int, rng: np.random.Generator
) -> list[Path]:
    """Histories, FRFs, identified modes, responses to a force at the roof, ambient modes."""
    own = load_building(building)
    full, grid = _full(own, theta), own.frequency_grid.frequencies_hz()[::4]
    settings = SimulationSettings(
        theta=tuple(theta.tolist()),
        zeta=_ZETA,
        duration_s=60.0,
        sampling_hz=100.0,
        band_hz=(0.3, 30.0),
        sensor_noise_m_s2=0.1,
        seed=number,
    )
    simulation = simulate_observation(own, settings)
    histories = write_simulation(simulation, folder / "histories.csv").observation
    floors = own.floors
    over = _responses(folder / "frf.csv", grid, full.over_base(grid), floors, "", rng)
    pushed = _responses(folder / "force.csv", grid, full.under_roof(grid), floors, "/RF", rng)
    ambient = _ambient(folder, own, replace(settings, seed=1000 + number))
    return [histories, over, _modes(folder, full, floors, rng), pushed, ambient]


def _ambient(folder: Path, building: Building, settings: SimulationSettings) -> Path:
    """Modes that are identified from ten minutes of floors alone, the base moving unseen."""
    long = replace(
        settings, duration_s=600.0, band_hz=(0.3, 45.0), rms_m_s2=0.02, sensor_noise_m_s2=0.002
    )
    seen = simulate_observation(building, long).histories
    floors = [k for k, channel in enumerate(seen.channels) if channel.floor != BASE]
    record = replace(
        seen,
        channels=tuple(seen.channels[k] for k in floors),
        acceleration=seen.acceleration[floors],
    )
    path = write_observation_histories(folder / "ambient.csv", record)
    return identify(path, folder / "ambient_modes.csv").output


def _modes(folder: Path, full: _Full, floors: Sequence[str], rng: np.random.Generator) -> Path:
    """Those along the motion with most of the mass, with errors."""
    given = np.sort(np.argsort(-np.abs(full.moved))[: min(_GIVEN, len(floors))])
    shape = full.shapes[:, given]
    shape = shape / np.abs(shape).max(axis=0) + _SHAPE_SD * rng.standard_normal(shape.shape)
    own = full.omega[given] / (2.0 * np.pi)
    own = own * np.exp(np.hypot(_MODE_SD, 0.01) * rng.standard_normal(own.shape))
    rows = [
        [own[k], _MODE_SD * own[k], *shape[:, k], *[_SHAPE_SD] * len(floors)]
        for k in range(len(own))
    ]
    head = ["frequency_hz", "frequency_sd_hz", *floors, *(f"{name}_sd" for name in floors)]
    return _table(folder / "modes.csv", head, rows)


def _responses(
    path: Path,
    grid: Floats,
    size: Floats,
    floors: Sequence[str],
    over: str,
    rng: np.random.Generator,
) -> Path:
    """A table of responses over the base, or over a force (`/RF`), with errors."""
    size = size * np.exp(_FRF_SD * rng.standard_normal(size.shape))
    unit = " (m/s2/N)" if over else ""
    head = ["frequency_hz", *(f"{name}{over}{unit}" for name in floors)]
    head += [f"{name}{over}_sd" for name in floors]
    rows = np.column_stack([grid, size.T, np.full_like(size, _FRF_SD).T])
    return _table(path, head, rows.tolist())


def _table(path: Path, head: Sequence[str], rows: Sequence[Sequence[float]]) -> Path:
    lines = [",".join(head), *(",".join(f"{value:.8g}" for value in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
