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
TOP_HZ = 20.48  # end of the frequency grid of shear_4dof

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

    Sizes have the units of femupdate's catalogue; `other` is a second floor or number.
    """

    name: str
    floor: int
    size: float = 0.0
    other: float = 0.0


def stick_frf(theta: Floats, changes: Sequence[Change], frequency_hz: Floats) -> Complexes:
    """H (f, k): absolute acceleration of the floors over that of the base.

    Points move by `motion @ q` against the base; an appendage is one more point and one more
    freedom, a rocking base one more freedom. Springs and dashpots act on rows of q.
    """
    floors = len(theta)
    mass, ground = [1.0] * floors, np.ones(floors)
    motion = np.eye(floors)
    springs = [(SPRING * factor, _drift(k, floors)) for k, factor in enumerate(theta)]
    dashpots: list[tuple[float, Floats]] = []
    first, shape, static = _nominal(floors)
    tie = floors / static[-1]  # base shear over roof displacement, under unit acceleration
    heights = np.arange(1.0, floors + 1.0)
    for change in changes:
        floor, size = change.floor, change.size
        unit = np.eye(motion.shape[1])[floor]
        if change.name == "added_mass":
            mass[floor] *= 1.0 + size
        elif change.name == "table_pitch":
            ground = ground + size * heights
        elif change.name == "story_damper":
            drift = _drift(floor, floors)
            dashpots.append((2.0 * first * size / float(drift @ shape) ** 2, drift))
        elif change.name == "ground_tie":
            springs.append((tie * size, unit))
        elif change.name == "long_brace":
            springs.append((tie * size, unit - np.eye(motion.shape[1])[floor - 2]))
        elif change.name == "foundation_rocking":
            motion = np.column_stack([motion, heights])
            moment = float(heights.sum()) * heights[-1]
            springs.append((moment / (static[-1] * size), np.eye(motion.shape[1])[-1]))
        elif change.name == "tuned_appendage":
            omega = change.other * first
            motion = np.pad(motion, ((0, 1), (0, 1)))
            motion[-1, -1] = 1.0
            stretch = motion[-1] - motion[floor]
            mass, ground = [*mass, size], np.append(ground, 1.0)
            springs.append((size * omega**2, stretch))
            dashpots.append((2.0 * DAMPING * size * omega, stretch))
    relative = _relative(np.array(mass), motion, ground, springs, dashpots, frequency_hz)
    absolute: Complexes = (ground[:, None] + relative)[:floors]
    for change in changes:
        absolute = _recorded(absolute, change, frequency_hz)
    return absolute


def _drift(story: int, size: int) -> Floats:
    return np.eye(size)[story] - (np.eye(size)[story - 1] if story else 0.0)


def _nominal(floors: int) -> tuple[float, Floats, Floats]:
    """First circular frequency, its shape of unit modal mass, static shape at theta = 1."""
    rows = np.array([_drift(k, floors) for k in range(floors)])
    stiffness = SPRING * rows.T @ rows
    squares, shapes = np.linalg.eigh(stiffness)
    static = np.linalg.solve(stiffness, np.ones(floors))
    return float(np.sqrt(squares[0])), shapes[:, 0], static


def _relative(
    mass: Floats,
    motion: Floats,
    ground: Floats,
    springs: Sequence[tuple[float, Floats]],
    dashpots: Sequence[tuple[float, Floats]],
    frequency_hz: Floats,
) -> Complexes:
    """Acceleration (points, k) of the points against the base, for unit base acceleration."""
    size = motion.shape[1]

    def matrix(parts: Sequence[tuple[float, Floats]]) -> Floats:
        rows = [(value, np.pad(row, (0, size - len(row)))) for value, row in parts]
        return sum((value * np.outer(row, row) for value, row in rows), np.zeros((size, size)))

    low, high = 2.0 * np.pi * np.array(ANCHORS_HZ)
    stiffness, inertia = matrix(springs), motion.T @ (mass[:, None] * motion)
    of_mass, of_stiffness = np.array([low * high, 1.0]) * 2.0 * DAMPING / (low + high)
    damping = of_mass * inertia + of_stiffness * stiffness + matrix(dashpots)
    omega = 2.0 * np.pi * frequency_hz[:, None, None]
    dynamic = stiffness + 1j * omega * damping - omega**2 * inertia
    load = -np.broadcast_to((motion.T @ (mass * ground))[:, None], (len(omega), size, 1))
    displacement: Complexes = np.linalg.solve(dynamic, load)[..., 0].T
    return np.asarray(-(omega[:, 0].T ** 2) * (motion @ displacement), dtype=np.complex128)


def _recorded(frf: Complexes, change: Change, frequency_hz: Floats) -> Complexes:
    """What an instrument makes of the floors' motion (f, k)."""
    seen, floor, size = frf.copy(), change.floor, change.size
    if change.name == "channel_gain":
        seen[floor] *= 1.0 + size
    elif change.name == "base_gain":
        seen /= 1.0 + size
    elif change.name == "reversed_channel":
        seen[floor] *= -1.0
    elif change.name == "channel_delay":
        seen[floor] *= np.exp(-2j * np.pi * frequency_hz * size)
    elif change.name == "roll_off":
        seen /= 1.0 + 1j * np.sqrt(size) * frequency_hz / 10.0
    elif change.name == "swapped_channels":
        pair = [floor, int(change.other)]
        seen[pair] = seen[pair[::-1]]
    elif change.name == "sensor_resonance":
        ratio = frequency_hz / (0.4 * TOP_HZ)
        mount = (1.0 + 0.1j * ratio) / (1.0 + 0.1j * ratio - ratio**2)
        seen[floor] *= 1.0 + size * (mount - 1.0)
    return seen


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


EFFECTS = (
    Change("added_mass", 1, 0.1),
    Change("foundation_rocking", -1, 0.1),
    Change("story_damper", 2, 0.03),
    Change("tuned_appendage", 3, 0.03, 1.8),
    Change("table_pitch", -1, 0.03),
    Change("channel_gain", 2, 0.07),
    Change("channel_delay", 0, 0.003),
    Change("roll_off", -1, 0.06),
    Change("swapped_channels", 1, other=2),
    Change("base_gain", -1, 0.06),
)
PAIRS = tuple(
    (EFFECTS[first], EFFECTS[second])
    for first, second in (
        *((0, 1), (0, 5), (0, 7), (1, 2), (1, 9)),
        *((2, 6), (3, 5), (4, 0), (7, 6), (8, 0)),
    )
)
OUTSIDE = (
    *(
        Change("ground_tie", floor, size)
        for floor, size in ((1, 0.1), (2, 0.2), (2, 0.5), (3, 0.1))
    ),
    *(Change("long_brace", floor, size) for floor, size in ((2, 0.2), (3, 0.2), (3, 0.5))),
    *(Change("sensor_resonance", floor, 0.3) for floor in (0, 2, 3)),
)
# In two stories mass on either floor does the same; where one floor is measured, either gain.
TWINS = tuple(Change("added_mass", k % 2, size) for k, size in enumerate((0.1, 0.1, 0.2, 0.2, 0.3)))
ROOF_TWINS = tuple(Change("base_gain", -1, size) for size in (-0.08, 0.06, 0.08, 0.1, 0.15))
KINDS = ("clean", "one", "two", "outside", "twin", "roof")


def cases() -> Iterator[tuple[str, Floats, tuple[Change, ...], int, float]]:
    """Name, stiffness factors, changes, seed and rms of every observation of a stick.

    Stiffness factors lie in the inner part of the prior.
    """
    rng = np.random.default_rng(15)
    one, outside, twins, roof = (
        [(change,) for change in group] for group in (EFFECTS, OUTSIDE, TWINS, ROOF_TWINS)
    )
    groups: tuple[Sequence[tuple[Change, ...]], ...] = ([()] * 10, one, PAIRS, outside, twins, roof)
    for first, (kind, group) in enumerate(zip(KINDS, groups, strict=True)):
        for k, changes in enumerate(group):
            theta = np.exp(rng.uniform(np.log(0.5), np.log(2.0), 2 if kind == "twin" else 4))
            yield f"{kind}_{k}", theta, changes, 100 * first + k, RMS
    theta = np.array([0.7, 1.3, 0.9, 1.1])
    for k in (1, 2):
        yield f"mass_{k}", theta, EFFECTS[:1], 1000 + k, RMS
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
