"""Observations of shear buildings, made with numpy alone.

They do not depend on femupdate: every version is given the same files. All
quantities are SI; a stick has unit masses, stories one metre high and springs of 1000 theta N/m.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]
Complexes = NDArray[np.complexfloating]

SPRING = 1000.0  # N/m
DAMPING, ANCHORS_HZ = 0.02, (1.0, 20.0)  # Rayleigh's law of shear_4dof
DURATION_S, SAMPLING_HZ, RMS, BAND_HZ = 80.0, 200.0, 0.3, (0.5, 50.0)
SENSOR_NOISE, STEP = 0.003, 1e-4  # m/s2: rms of the noise, and step of the recorder

TWO_STORIES = """
name = "shear_2dof"
title = "Two-story shear building"
description = "For observations that cannot tell effects apart."
kind = "shear"
masses_known = false
stories = [
    { name = "S1", mass = "1 kg", stiffness_per_mass = "1000 1/s2" },
    { name = "S2", mass = "1 kg", stiffness_per_mass = "1000 1/s2" },
]
frequency_grid = { start = "0.02 Hz", step = "0.02 Hz", count = 1024 }
prior = { theta = { lower = 0.33, upper = 3.0 } }
damping = { law = "rayleigh", ratio = 0.02, anchors = ["1 Hz", "20 Hz"] }
observation = { noise_sd = 0.2 }
reduction = { tolerance = 0.02 }

[provenance]
source = "Made for a record of figures."
published = []
assumed = ["stories", "frequency_grid", "prior", "damping", "observation", "reduction"]
"""


@dataclass(frozen=True)
class Change:
    """Something the model does not know: its name, floor (from 0; base: -1) and size.

    Sizes have the units of femupdate's catalogue; of a tie to the ground, those of a brace.
    """

    name: str
    floor: int
    size: float


def stick_frf(theta: Floats, changes: Sequence[Change], frequency_hz: Floats) -> Complexes:
    """H (f, k): absolute acceleration of the floors over that of the base."""
    mass, stiffness = np.ones(len(theta)), _chain(theta)
    roof = float(np.linalg.solve(_chain(np.ones(len(theta))), mass)[-1])
    for change in changes:
        if change.name == "added_mass":
            mass[change.floor] *= 1.0 + change.size
        elif change.name == "ground_tie":  # of the building's base shear over roof displacement
            stiffness[change.floor, change.floor] += change.size * len(theta) / roof
    low, high = 2.0 * np.pi * np.array(ANCHORS_HZ)
    of_mass, of_stiffness = np.array([low * high, 1.0]) * 2.0 * DAMPING / (low + high)
    inertia = np.diag(mass)
    damping = of_mass * inertia + of_stiffness * stiffness
    omega = 2.0 * np.pi * frequency_hz[:, None, None]
    dynamic = stiffness + 1j * omega * damping - omega**2 * inertia
    moved = np.linalg.solve(dynamic, np.broadcast_to(mass[:, None], (len(omega), *theta.shape, 1)))
    frf = np.asarray(1.0 + (omega**2 * moved)[..., 0].T, dtype=np.complex128)
    for change in changes:
        if change.name == "channel_gain":
            frf[change.floor] *= 1.0 + change.size
        elif change.name == "base_gain":
            frf /= 1.0 + change.size
    return frf


def _chain(theta: Floats) -> Floats:
    """Stiffness (f, f) of stories, N/m."""
    rows = np.eye(len(theta)) - np.eye(len(theta), k=-1)
    return np.asarray(SPRING * rows.T @ np.diag(theta) @ rows)


def floor_names(count: int) -> tuple[str, ...]:
    """2F, 3F, ..., RF."""
    return (*(f"{k}F" for k in range(2, count + 1)), "RF")


def write_histories(
    path: Path, theta: Floats, changes: Sequence[Change], seed: int, rms: float = RMS
) -> None:
    """Write accelerations of base and floors under white noise, as noisy sensors record them."""
    rng = np.random.default_rng(seed)
    count = round(DURATION_S * SAMPLING_HZ)
    spectrum = np.fft.rfft(rng.standard_normal(count))
    frequency = np.fft.rfftfreq(count, 1.0 / SAMPLING_HZ)
    spectrum[(frequency < BAND_HZ[0]) | (frequency > BAND_HZ[1])] = 0.0
    base = np.fft.irfft(spectrum, count)
    time = np.arange(count) / SAMPLING_HZ
    ramp = np.clip(np.minimum(time, time[::-1]), 0.0, 1.0)
    base *= rms / base.std() * (0.5 - 0.5 * np.cos(np.pi * ramp))
    padded = 2 * count  # the motion dies away before it comes round again
    frf = stick_frf(theta, changes, np.fft.rfftfreq(padded, 1.0 / SAMPLING_HZ))
    floors = np.fft.irfft(frf * np.fft.rfft(base, padded), padded)[:, :count]
    exact = np.vstack([base, floors])
    seen = STEP * np.round((exact + SENSOR_NOISE * rng.standard_normal(exact.shape)) / STEP)
    names = floor_names(len(theta))
    head = f"time_s,base,{','.join(names)}\ns{',m/s2' * (len(names) + 1)}"
    table = np.column_stack([time, seen.T])
    np.savetxt(path, table, "%.6g", ",", header=head, comments="")


def write_frf_table(path: Path, floors: Sequence[str], noise: float, seed: int) -> None:
    """Write |H| of some floors of the four-story stick at theta = 1, with noise on ln|H|."""
    frequency = 0.02 * np.arange(1, 1025)
    rows = [floor_names(4).index(floor) for floor in floors]
    clean = np.log(np.abs(stick_frf(np.ones(4), (), frequency)))[rows]
    noisy = clean + noise * np.random.default_rng(seed).standard_normal(clean.shape)
    columns = [frequency]
    for row in noisy:
        columns += [np.exp(row), np.full(frequency.size, noise)]
    head = ",".join(["frequency_hz", *(f"{floor},{floor}_sd" for floor in floors)])
    np.savetxt(path, np.column_stack(columns), "%.9g", ",", header=head, comments="")


MASS = Change("added_mass", 1, 0.1)
# What a diagnosis is asked about: stiffness factors, changes and seed of each observation. In two
# stories mass on either floor does the same; where one floor is measured, either gain.
FINDER: dict[str, tuple[tuple[float, ...], tuple[Change, ...], int]] = {
    "clean_0": ((1.306300, 1.549319, 0.805979, 0.532066), (), 0),
    "one_0": ((0.956939, 0.891742, 1.739952, 0.565559), (MASS,), 100),
    "two_1": (
        (1.175415, 0.965919, 1.249965, 0.664555),
        (MASS, Change("channel_gain", 2, 0.07)),
        201,
    ),
    "outside_0": (
        (1.190279, 1.096742, 0.511804, 1.248737),
        (Change("ground_tie", 1, 0.1),),
        300,
    ),
    "twin_0": ((1.602998, 0.697314), (Change("added_mass", 0, 0.1),), 400),
    "roof_0": ((0.783612, 1.192993, 1.083847, 1.639095), (Change("base_gain", -1, -0.08),), 500),
}


def cases() -> Iterator[tuple[str, Floats, tuple[Change, ...], int, float]]:
    """Name, stiffness factors, changes, seed and rms of every observation of a stick."""
    for name, (factors, changes, seed) in FINDER.items():
        yield name, np.array(factors), changes, seed, RMS
    theta = np.array([0.7, 1.3, 0.9, 1.1])
    for k in (1, 2):
        yield f"mass_{k}", theta, (MASS,), 1000 + k, RMS
        level = 1.0 if k == 1 else 0.9
        yield f"softer_{k}", level * theta, (), 1010 + k, 0.1 * 4.0 ** (k - 1)


def read_columns(path: Path) -> dict[str, float]:
    """Root mean square of every column of an observation file but its first."""
    names, table = _read(path)
    return dict(zip(names[1:], np.sqrt((table[:, 1:] ** 2).mean(axis=0)).tolist(), strict=True))


def scale_floor(source: Path, target: Path, floor: str, factor: float) -> None:
    """Copy an observation file with the sensors of one floor read too large."""
    names, table = _read(source)
    table[:, [name.split(":")[0] == floor for name in names]] *= factor
    head = f"{','.join(names)}\ns{',m/s2' * (len(names) - 1)}"
    np.savetxt(target, table, "%.7g", ",", header=head, comments="")


def _read(path: Path) -> tuple[list[str], Floats]:
    """Column names and values of a file of histories with comments, names and units."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return lines[0].split(","), np.loadtxt(lines[2:], delimiter=",")
