"""Makes the small files that the guides use, all of the shipped four-story shear building.

Run it to make them again: python examples/make_records.py. Earthquakes come from the simulator of
femupdate; force tests and modes from the equation of motion, in closed form.
"""

import re
from pathlib import Path

import numpy as np
from scipy.linalg import eigh
from scipy.signal import lsim

from femupdate.building.files import load_building
from femupdate.building.mesh import mesh_building
from femupdate.building.model_files import write_draft
from femupdate.building.shipped import building_text
from femupdate.fe import bulk_data
from femupdate.measurement.record import read_record
from femupdate.measurement.recording import RecordedMode
from femupdate.measurement.write import write_modes, write_modes_uff
from femupdate.simulation.simulate import SimulationSettings, simulate_observation, write_simulation

FLOORS = ("2F", "3F", "4F", "RF")
HEAVY = (("added_mass@3F", (0.1,)),)
TRUTH = np.array([0.7, 1.3, 0.9, 1.1])
# What is made by the simulator: factors, effects, record with its scale, and seed.
QUAKES = {
    "run1.csv": (TRUTH, HEAVY, ("records/ridgecrest_2019_clc_90.csv", None, 1.0), 1),
    "run2.csv": (TRUTH, HEAVY, ("hotel/quake_3.csv", "base", 4.0), 2),
    "before.csv": (np.array([0.9, 1.0, 1.1, 1.0]), (), ("hotel/quake_3.csv", "base", 1.0), 3),
    "after.csv": (np.array([0.9, 0.9, 1.1, 1.0]), (), ("hotel/quake_7.csv", "base", 1.0), 4),
}


def chain(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Squared circular frequencies and mass-normalised shapes (columns), masses of 1 kg."""
    stiffness = 1000.0 * theta
    K = np.diag(stiffness + np.append(stiffness[1:], 0.0))
    K -= np.diag(stiffness[1:], 1) + np.diag(stiffness[1:], -1)
    return eigh(K)


def damping(omega: np.ndarray) -> np.ndarray:
    """Rayleigh's ratios of the building's file: 2 % at 1 and 20 Hz."""
    low, high = 2.0 * np.pi * np.array([1.0, 20.0])
    return 0.02 * (low * high / omega + omega) / (low + high)


def accelerance(theta: np.ndarray, frequency_hz: np.ndarray, at: int) -> np.ndarray:
    """(f, m) acceleration of the floors over a force at one of them, 1/kg."""
    squared, shapes = chain(theta)
    w, zeta = 2.0 * np.pi * frequency_hz[:, None], damping(np.sqrt(squared))
    modal = -(w**2) / (squared - w**2 + 2j * zeta * w * np.sqrt(squared))
    return (modal * shapes[at]) @ shapes.T


def shaken(theta: np.ndarray, load: np.ndarray, shape: np.ndarray, step: float) -> np.ndarray:
    """(f, n) acceleration of the floors under a load (n,) of a shape (f,)."""
    squared, modes = chain(theta)
    time, rows = step * np.arange(load.size), np.zeros((len(FLOORS), load.size))
    for omega, mode in zip(np.sqrt(squared), modes.T, strict=True):
        zeta = damping(omega)
        q = ([1.0, 0.0, 0.0], [1.0, 2.0 * zeta * omega, omega**2])
        rows += np.outer(mode * (mode @ shape), lsim(q, load, time)[1])
    return rows


def table(path: Path, head: str, rows: np.ndarray, form: str | list[str] = "%.5g") -> Path:
    """Write a table that says it is synthetic."""
    np.savetxt(path, rows, form, ",", header=f"# synthetic, not a measurement\n{head}", comments="")
    return path


def make(folder: Path) -> None:
    """Write all files into a folder that holds the shipped records."""
    building = load_building("shear_4dof")
    for name, (theta, effects, (record, channel, scale), seed) in QUAKES.items():
        motion = read_record(folder / record, None, channel).scaled(scale)
        how = SimulationSettings(
            theta=tuple(theta),
            effects=effects,
            base_motion=motion,
            sampling_hz=1.0 / motion.time_step,
            sensor_noise_m_s2=0.02 if effects else 0.003,
            quantisation_m_s2=0.001,
            seed=seed,
        )
        write_simulation(simulate_observation(building, how), folder / name)
    rng = np.random.default_rng(5)
    frequency = np.arange(0.5, 12.0, 0.05)
    H = accelerance(TRUTH, frequency, 3)
    H = H * (1.0 + 0.03 * (rng.normal(size=H.shape) + 1j * rng.normal(size=H.shape)))
    head = ",".join(["frequency_hz", *(f"{f}/RF_{p}" for f in FLOORS for p in ("re", "im"))])
    parts = np.stack([H.real, H.imag], axis=2).reshape(len(frequency), -1)
    units = "Hz" + ",m/s2/N" * 8
    table(folder / "hammer.csv", f"{head}\n{units}", np.column_stack([frequency, parts]))
    squared, shapes = chain(TRUTH)
    modes = [
        RecordedMode(
            frequency_hz=float(f * (1.0 + 0.003 * rng.normal())),
            frequency_sd_hz=0.005 * float(f),
            damping=None,
            damping_sd=None,
            sensors=FLOORS,
            shape=shape / shape[np.argmax(np.abs(shape))] + 0.01 * rng.normal(size=4),
            shape_sd=None,
            name=str(k),
        )
        for k, (f, shape) in enumerate(
            zip(np.sqrt(squared) / (2.0 * np.pi), shapes.T, strict=True), 1
        )
    ]
    write_modes(folder / "modes.csv", modes, ["synthetic, not a measurement"])
    write_modes_uff(folder / "modes.uff", modes, [3.0, 6.0, 9.0, 12.0], "x")
    step = 0.04
    wind = rng.normal(size=15_000)
    rows = sum(shaken(TRUTH, rng.normal(size=wind.size), unit, step) for unit in np.eye(4))
    rows = 0.01 * np.asarray(rows) + 1e-4 * rng.normal(size=(4, wind.size))
    time = step * np.arange(wind.size)
    head = ",".join(["time_s", *FLOORS])
    table(folder / "ambient.csv", head, np.column_stack([time, rows.T]), ["%.6g", *["%.3g"] * 4])
    bench = SimulationSettings(
        theta=(0.9, 1.1, 1.0),
        duration_s=40.0,
        sampling_hz=100.0,
        band_hz=(0.3, 40.0),
        quantisation_m_s2=0.001,
        seed=6,
    )
    seen = simulate_observation(load_building("shear_3dof"), bench).histories
    time = seen.time_step * np.arange(seen.acceleration.shape[1])
    head = "Time (s),a_base,a_1F,a_2F,a_3F"
    table(folder / "logger.csv", head, np.column_stack([time, seen.acceleration.T]))
    house = folder / "house.toml"
    text = building_text("two_story_openings")[1]
    house.write_text(re.sub(r'size = "[^"]*"', 'size = "1.2 m"', text, count=1), encoding="utf-8")
    model = mesh_building(load_building(str(house))).model
    house.unlink()
    (folder / "tower.bdf").write_text(bulk_data(model), encoding="utf-8")
    (folder / "tower.toml").unlink(missing_ok=True)
    write_draft(str(folder / "tower.bdf"), "N,m", folder / "tower.toml")


if __name__ == "__main__":
    make(Path(__file__).resolve().parent)
