"""Simulated buildings of known truth, calibrated to each kind of observation and to all."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

from femupdate.arrays import Floats
from femupdate.building.files import load_building
from femupdate.dynamics.force_response import accelerance
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
from femupdate.workflow.model import StudyModel, open_study
from femupdate.workflow.observed import ObservationSource

from ..result import Job, Report, markdown_table

BUILDING = "shear_3dof"
KINDS = ("histories", "modes", "force", "ambient")
ALL = "all together"
_ZETA = 0.03
_MODE_SD, _SHAPE_SD, _FORCE_SD = 0.005, 0.03, 0.1


def run_kinds(job: Job, buildings: int) -> Report:
    """Calibrate every building to each kind and to all, and compare with the truth."""
    settings = CalibrationSettings(particles=2000, exact=True)
    job.progress.start("Calibrating", buildings * (len(KINDS) + 1))
    away: dict[str, list[Floats]] = {name: [] for name in (*KINDS, ALL)}
    width: dict[str, list[Floats]] = {name: [] for name in (*KINDS, ALL)}
    for number, rng in enumerate(np.random.default_rng(job.seed).spawn(buildings)):
        theta = rng.uniform(0.7, 1.4, 3)
        with TemporaryDirectory() as name:
            folder = Path(name)
            model = open_study(Study(folder / "model"), BUILDING)
            files = _files(folder, model, theta, number, rng)
            for kind in (*KINDS, ALL):
                paths = files if kind == ALL else [files[KINDS.index(kind)]]
                study = Study(folder / kind)
                source = ObservationSource(paths[0], further=tuple(paths[1:]))
                report = calibrate_study(study, open_study(study, BUILDING), source, settings)
                draws = report.posterior.samples
                width[kind].append(draws.std(axis=0))
                away[kind].append((draws.mean(axis=0) - theta) / draws.std(axis=0))
                job.progress.advance()
    return _report(job, {k: np.array(v) for k, v in away.items()}, width)


def _report(job: Job, away: dict[str, Floats], width: dict[str, list[Floats]]) -> Report:
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
    return job.write("kinds", {"kinds": content}, markdown_table(head, rows), answer=content)


def _files(
    folder: Path, model: StudyModel, theta: Floats, number: int, rng: np.random.Generator
) -> list[Path]:
    """Histories, identified modes, responses to a force at the roof, modes of an ambient record."""
    settings = SimulationSettings(
        theta=tuple(theta.tolist()),
        zeta=_ZETA,
        duration_s=60.0,
        sampling_hz=100.0,
        band_hz=(0.3, 30.0),
        sensor_noise_m_s2=0.1,
        seed=number,
    )
    simulation = simulate_observation(load_building(BUILDING), settings)
    histories = write_simulation(simulation, folder / "histories.csv").observation
    modes, force = _modes(folder, model, theta, rng), _force(folder, model, theta, rng)
    return [histories, modes, force, _ambient(folder, replace(settings, seed=1000 + number))]


def _ambient(folder: Path, settings: SimulationSettings) -> Path:
    """Modes that are identified from ten minutes of floors alone, the base moving unseen."""
    long = replace(
        settings, duration_s=600.0, band_hz=(0.3, 45.0), rms_m_s2=0.02, sensor_noise_m_s2=0.002
    )
    seen = simulate_observation(load_building(BUILDING), long).histories
    floors = [k for k, channel in enumerate(seen.channels) if channel.floor != BASE]
    record = replace(
        seen,
        channels=tuple(seen.channels[k] for k in floors),
        acceleration=seen.acceleration[floors],
    )
    path = write_observation_histories(folder / "ambient.csv", record)
    return identify(path, folder / "ambient_modes.csv").output


def _modes(folder: Path, model: StudyModel, theta: Floats, rng: np.random.Generator) -> Path:
    at = torch.from_numpy(theta)[None]
    found = model.system.modes(at, at[:, :0])
    shape = found.rows[0].numpy() / np.abs(found.rows[0].numpy()).max(axis=0)
    shape = shape + _SHAPE_SD * rng.standard_normal(shape.shape)
    own = found.frequency_hz[0].numpy()
    own = own * np.exp(np.hypot(_MODE_SD, 0.01) * rng.standard_normal(own.shape))
    floors = model.system.floors
    rows = [
        [own[k], _MODE_SD * own[k], *shape[:, k], *[_SHAPE_SD] * len(floors)]
        for k in range(len(own))
    ]
    head = ["frequency_hz", "frequency_sd_hz", *floors, *(f"{name}_sd" for name in floors)]
    return _table(folder / "modes.csv", head, rows)


def _force(folder: Path, model: StudyModel, theta: Floats, rng: np.random.Generator) -> Path:
    frequency = model.frequency_hz[::4]
    zeta = torch.tensor([_ZETA], dtype=torch.float64)
    roof = len(model.system.floors) - 1
    exact = accelerance(model.system, torch.from_numpy(theta)[None], zeta, frequency, roof)
    size = exact[0].abs().numpy()
    size = size * np.exp(_FORCE_SD * rng.standard_normal(size.shape))
    names = model.system.floors
    head = ["frequency_hz", *(f"{name}/RF (m/s2/N)" for name in names)]
    head += [f"{name}/RF_sd" for name in names]
    spread = np.full_like(size, _FORCE_SD)
    rows = np.column_stack([frequency.numpy(), size.T, spread.T])
    return _table(folder / "force.csv", head, rows.tolist())


def _table(path: Path, head: Sequence[str], rows: Sequence[Sequence[float]]) -> Path:
    lines = [",".join(head), *(",".join(f"{value:.8g}" for value in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
