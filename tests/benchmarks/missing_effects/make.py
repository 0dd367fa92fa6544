"""Makes the frozen files of all tasks: python -m femupdate.benchmarks.missing_effects.make

Sticks are OpenSees', histories step by step. Frames are modes of OpenSees or MYSTRAN on a mesh
that is two thirds as wide as the one of the building's file.
"""

import csv
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import resample_poly

from femupdate.arrays import Floats
from femupdate.building import FrameBuilding, load_building

from .frames import frame_modes
from .stick import STEP_S, Stick

FOLDER = Path(__file__).parent
RATE_HZ = 50.0
EVERY = round(1.0 / (RATE_HZ * STEP_S))
_BAND_HZ = (0.2, 19.0)
_MEASURED_S, _NEXT_S = 60.0, 30.0
_WHITE, _QUAKE = "white", "quake"

_MASS = 1e3 * np.array([310.0, 295.0, 290.0, 285.0, 280.0, 230.0])
_STIFFNESS = 1e6 * np.array([560.0, 500.0, 455.0, 390.0, 310.0, 225.0])
_LEVELS = ("2F", "3F", "4F", "5F", "6F", "RF")

Missing = Sequence[Mapping[str, Any]]


@dataclass(frozen=True, kw_only=True)
class Task:
    """What is hidden, and how it is measured.

    Attributes:
        words: what is there, for people.
        missing: kind, places and size of each effect.
        verdicts: that are right.
        stick: changes the stick whose factors and damping are drawn; None for a frame.
        shell: of a frame; see `frame_modes`.
        shaking: of the measured record.
        strength: of it, as a factor on the usual one.
        noise: of every sensor, as a share of the rms of the base.
        channels: changes (1 + f, n) accelerations at `STEP_S`, the base first.
        sensors: floors with one; all where empty.
        what: accelerations, modes or hammer: what the measured file holds.
        building: file.
    """

    words: str
    missing: Missing = ()
    verdicts: tuple[str, ...] = ("effects",)
    stick: Any = None
    shell: str = ""
    shaking: str = _QUAKE
    strength: float = 1.0
    noise: float = 0.01
    channels: Any = None
    sensors: tuple[str, ...] = ()
    what: str = "accelerations"
    building: str = "stick6.toml"
    members: Sequence[tuple[str, str, float]] = ()


def effect(kind: str, *places: str, size: float | None = None) -> dict[str, Any]:
    """One missing effect: of stated kind and size, in all of its places alike."""
    return {"kind": kind, "places": list(places), "size": size}


def _heavier(**shares: float) -> Any:
    """A stick whose floors carry so much more."""
    change = np.array([1.0 + shares.get(f"f{name}", 0.0) for name in _LEVELS])
    return lambda stick: replace(stick, mass=stick.mass * change)


def dashpot(low: int, high: int, share: float) -> Any:
    """A damper between levels that adds so much to the first damping ratio."""

    def change(stick: Stick) -> Stick:
        omega, shapes = stick.modes()
        first = np.concatenate([[0.0], shapes[:, 0]])
        modal = float(stick.mass @ first[1:] ** 2)
        size = 2.0 * share * omega[0] * modal / (first[high] - first[low]) ** 2
        return replace(stick, dashpots=((low, high, size),))

    return change


def _spring(low: int, high: int, share: float) -> Any:
    """A spring between levels, as a share of the stiffness of the story below the upper one."""
    size = share * _STIFFNESS[high - 1]
    return lambda stick: replace(stick, springs=((low, high, size),))


def appendage(level: int, share: float, tuning: float, zeta: float) -> Any:
    """Something on a floor with a share of its mass, tuned to the first frequency."""

    def change(stick: Stick) -> Stick:
        kg, turning = share * float(stick.mass[level - 1]), tuning * stick.modes()[0][0]
        return replace(stick, appendage=(level, kg, kg * turning**2, 2.0 * zeta * kg * turning))

    return change


def hysteretic(story: int, yield_m: float, alpha: float) -> Any:
    """A story of Bouc and Wen that is smooth about its yield displacement."""

    def change(stick: Stick) -> Stick:
        initial = float(stick.stiffness[story])
        slope = 0.5 / yield_m
        law = ("BoucWen", alpha, initial, 1.0, slope, slope, 1.0, 0.0, 0.0, 0.0)
        return replace(stick, materials={story: law})

    return change


def bilinear(story: int, yield_m: float, alpha: float) -> Any:
    """A story that yields at once."""

    def change(stick: Stick) -> Stick:
        initial = float(stick.stiffness[story])
        law = ("Steel01", initial * yield_m, initial, alpha)
        return replace(stick, materials={story: law})

    return change


def late(level: int, seconds: float) -> Any:
    """Channels of which that of a level is late."""

    def change(seen: Floats) -> Floats:
        return _with(seen, level, np.roll(seen[level], round(seconds / STEP_S)))

    return change


def gain(level: int, share: float) -> Any:
    """Channels of which that of a level has a wrong gain."""
    return lambda seen: _with(seen, level, (1.0 + share) * seen[level])


def _crossed(seen: Floats) -> Floats:
    """3F and 4F exchanged, 6F reversed."""
    return seen[[0, 1, 3, 2, 4, 5, 6]] * np.array([1, 1, 1, 1, 1, -1, 1])[:, None]


def _with(seen: Floats, level: int, row: Floats) -> Floats:
    changed = seen.copy()
    changed[level] = row
    return changed


def _both(*changes: Any) -> Any:
    def change(value: Any) -> Any:
        for each in changes:
            value = each(value)
        return value

    return change


def _masses(spread: float) -> Any:
    """Floors whose masses differ by chance, of so large a standard deviation."""
    shares = spread * np.random.default_rng(77).standard_normal(6)
    return _heavier(**{f"f{name}": share for name, share in zip(_LEVELS, shares, strict=True)})


_NONE, _NONLINEAR, _OUTSIDE = ("none",), ("nonlinear",), ("unknown", "nonlinear")


def _as_it_is(stick: Stick) -> Stick:
    return stick


TASKS = (
    Task(words="nothing", verdicts=_NONE, stick=_as_it_is),
    Task(words="nothing", verdicts=_NONE, stick=_as_it_is, shaking=_WHITE, noise=0.05,
         sensors=("3F", "5F", "RF")),
    Task(words="nothing but masses known to half a per cent", verdicts=_NONE,
         stick=_masses(0.005), building="stick6_one_per_cent.toml"),
    Task(words="nothing but masses known to one per cent, and a gain of .5 % at 4F",
         verdicts=_NONE, stick=_masses(0.01), channels=gain(3, 0.005), shaking=_WHITE,
         building="stick6_one_per_cent.toml"),
    Task(words="the mass of 4F", stick=_heavier(f4F=0.12),
         missing=(effect("mass", "4F", size=0.12),)),
    Task(words="little mass at 5F, few sensors", stick=_heavier(f5F=0.04), noise=0.03,
         sensors=("3F", "5F", "RF"), missing=(effect("mass", "5F", size=0.04),)),
    Task(words="a damper in the first story", stick=dashpot(0, 1, 0.03), shaking=_WHITE,
         missing=(effect("damper", "S1", size=0.03),)),
    Task(words="a brace from 3F to 5F", stick=_spring(2, 4, 0.15),
         missing=(effect("brace", "3F-5F"),)),
    Task(words="the roof's sensor is late", stick=_as_it_is, channels=late(6, 0.004),
         missing=(effect("delay", "RF", size=0.004),)),
    Task(words="something at 6F vibrates by itself", stick=appendage(5, 0.09, 2.2, 0.02),
         shaking=_WHITE, missing=(effect("appendage", "6F", size=0.09),)),
    Task(words="the mass of the roof, and a late sensor at 3F", stick=_heavier(fRF=0.1),
         channels=late(2, 0.005),
         missing=(effect("mass", "RF", size=0.1), effect("delay", "3F", size=0.005))),
    Task(words="the mass of 3F, and a damper in the third story",
         stick=_both(_heavier(f3F=0.15), dashpot(2, 3, 0.02)), shaking=_WHITE,
         missing=(effect("mass", "3F", size=0.15), effect("damper", "S3", size=0.02))),
    Task(words="3F and 4F exchanged, 6F reversed", stick=_as_it_is, channels=_crossed,
         missing=(effect("exchanged", "3F", "4F"), effect("reversed", "6F"))),
    Task(words="damping proportional to mass",
         stick=lambda stick: replace(stick, mass_proportional=True), shaking=_WHITE,
         missing=(effect("damping"),)),
    Task(words="a hysteretic first story", verdicts=_NONLINEAR, strength=3.0,
         stick=hysteretic(0, 0.008, 0.1), missing=(effect("nonlinear", "S1"),)),
    Task(words="a third story that yields", verdicts=_NONLINEAR, strength=3.0,
         stick=bilinear(2, 0.007, 0.2), missing=(effect("nonlinear", "S3"),)),
    Task(words="a neighbour that 5F pounds against", verdicts=_OUTSIDE, strength=3.0,
         stick=lambda stick: replace(stick, pounding=(4, 0.004, 0.3 * _STIFFNESS[3]))),
    Task(words="a tie from 6F to the ground", verdicts=("unknown",),
         stick=_spring(0, 5, 0.08)),
    Task(words="modes alone; the mass of the roof", what="modes", stick=_heavier(fRF=0.2),
         missing=(effect("mass", "RF", size=0.2),)),
    Task(words="a hammer at 4F; nothing", verdicts=_NONE, what="hammer", stick=_as_it_is),
    Task(words="nothing, by OpenSees", verdicts=_NONE, shell="ASDShellQ4", shaking=_WHITE,
         building="frame3.toml"),
    Task(words="cracked columns in the first story, by MYSTRAN", shell="MIN4T",
         building="frame3.toml", members=(("cracked_columns", "S1", -0.4),),
         missing=(effect("columns", "S1", size=-0.4),)),
    Task(words="the walls of both stories that have one, by OpenSees", shell="ASDShellQ4",
         building="frame3.toml", members=(("wall_stiffness", "all", -0.5),), shaking=_WHITE,
         missing=(effect("walls", "S1", "S2", size=-0.5),)),
    Task(words="the mass of 3F, by MYSTRAN", shell="MIN4T", building="frame3.toml",
         members=(("added_mass", "3F", 0.1),), missing=(effect("mass", "3F", size=0.1),)),
)  # fmt: skip


def make(number: int, task: Task, folder: Path = FOLDER) -> None:
    """Write the files of a task."""
    rng = np.random.default_rng([2026, number])
    building = load_building(FOLDER / "buildings" / task.building)
    count = len(building.story_names)
    theta = np.exp(rng.uniform(np.log(0.75), np.log(1.35), count)).round(3)
    zeta = round(float(rng.uniform(0.008, 0.03)), 4)
    if isinstance(building, FrameBuilding):
        size = 0.66 * building.mesh.size
        modes = frame_modes(building, theta, task.members, mesh_size=size, shell=task.shell)
        respond = partial(modes.respond, zeta)
    else:
        stick = task.stick(Stick(mass=_MASS, stiffness=_STIFFNESS * theta, zeta=zeta))
        respond = stick.respond
    measured, hidden = (folder / kind / f"{number:02d}" for kind in ("tasks", "answers"))
    for place in (measured, hidden):
        place.mkdir(parents=True, exist_ok=True)
    floors = tuple(building.floors)
    sensors = task.sensors or floors
    if task.what == "modes":
        write_modes(measured / "measured.csv", stick, zeta, floors, rng)
    elif task.what == "hammer":
        write_hammer(measured / "measured.csv", stick, zeta, floors, rng)
    else:
        base = motion(task.shaking, _MEASURED_S, rng) * task.strength
        _write(measured / "measured.csv", task, base, respond, floors, sensors, rng)
    base = motion(_QUAKE, _NEXT_S, rng) * task.strength
    seen = replace(task, channels=None)
    _write(hidden / "next.csv", seen, base, respond, floors, floors, rng)
    rows = list(csv.reader((hidden / "next.csv").open()))
    with (measured / "next_base.csv").open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(row[:2] for row in rows)
    question = {
        "building": f"buildings/{task.building}",
        "measured": {"accelerations": "floors and base, m/s2", "modes": "identified modes",
                     "hammer": "accelerance of all floors to a force at 4F, 1/kg"}[task.what],
        "floors": list(floors),
    }  # fmt: skip
    answer = {
        "words": task.words,
        "verdicts": list(task.verdicts),
        "missing": list(task.missing),
        "factors": None if "nonlinear" in task.verdicts else theta.tolist(),
        "damping_ratio": zeta,
    }
    for place, content in ((measured / "task.json", question), (hidden / "answer.json", answer)):
        place.write_text(json.dumps(content, indent=1) + "\n")


def motion(shaking: str, seconds: float, rng: np.random.Generator) -> Floats:
    """Motion of the base every `STEP_S`, m/s2: white, or Kanai and Tajimi's in an envelope.

    The envelope is that of Amin and Ang (1968, J. Eng. Mech. Div. ASCE 94, 559).
    """
    count = round(seconds / STEP_S)
    frequency = np.fft.rfftfreq(count, STEP_S)
    driven = np.fft.rfft(rng.standard_normal(count))
    driven[(frequency < _BAND_HZ[0]) | (frequency > _BAND_HZ[1])] = 0.0
    time = np.arange(count) * STEP_S
    if shaking == _WHITE:
        motion = np.fft.irfft(driven, count)
        return 0.3 * motion / motion.std() * np.clip(np.minimum(time, seconds - time), 0.0, 1.0)
    ratio = frequency / rng.uniform(2.0, 4.0)
    motion = np.fft.irfft(driven * (1.0 + 1.2j * ratio) / (1.0 - ratio**2 + 1.2j * ratio), count)
    motion *= np.minimum(np.minimum((time / 3.0) ** 2, 1.0), np.exp(-(time - 10.0) / 8.0))
    return np.asarray(1.5 * motion / np.abs(motion).max())


def _write(
    path: Path,
    task: Task,
    base: Floats,
    respond: Callable[[Floats], Floats],
    floors: tuple[str, ...],
    sensors: tuple[str, ...],
    rng: np.random.Generator,
) -> None:
    """A record of base and floors, with noise."""
    seen = np.vstack([base, respond(base)])
    if task.channels is not None:
        seen = task.channels(seen)
    rows = [0, *(1 + floors.index(floor) for floor in sensors)]
    kept = resample_poly(seen[rows], 1, EVERY, axis=1)
    kept = kept + task.noise * kept[0].std() * rng.standard_normal(kept.shape)
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time_s", *(f"{name} (m/s2)" for name in ("base", *sensors))])
        for k, row in enumerate(kept.T):
            writer.writerow([f"{k / RATE_HZ:.2f}", *(f"{value:.5f}" for value in row)])


def write_modes(
    path: Path, stick: Stick, zeta: float, floors: Sequence[str], rng: np.random.Generator
) -> None:
    """The first four modes: .2 % on frequencies, 1 % of the largest component on shapes."""
    omega, shapes = stick.modes()
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["mode", "frequency_hz", "damping", *floors])
        for k in range(4):
            shape = shapes[:, k] / np.abs(shapes[:, k]).max() + 0.01 * rng.standard_normal(
                len(floors)
            )
            hertz = omega[k] / (2.0 * np.pi) * (1.0 + 0.002 * rng.standard_normal())
            ratio = zeta * (1.0 + 0.1 * rng.standard_normal())
            figures = (f"{value:.5f}" for value in (hertz, ratio, *shape))
            writer.writerow([k + 1, *figures])


def write_hammer(
    path: Path, stick: Stick, zeta: float, floors: Sequence[str], rng: np.random.Generator
) -> None:
    """Accelerance of all floors to a force at the third, 2 % of noise."""
    omega, shapes = stick.modes()
    modal = shapes / np.sqrt(stick.mass @ shapes**2)
    hertz = np.arange(0.5, 18.0, 0.05)
    turning = 2.0 * np.pi * hertz
    by_mode = -(turning**2) / (
        omega[:, None] ** 2 - turning**2 + 2j * zeta * omega[:, None] * turning
    )
    frf = (modal * modal[2]) @ by_mode
    noise = rng.standard_normal((2, *frf.shape))
    frf = frf * (1.0 + 0.02 * (noise[0] + 1j * noise[1]) / np.sqrt(2.0))
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        heads = [f"{name}/{floors[2]}_{part} (m/s2/N)" for name in floors for part in ("re", "im")]
        writer.writerow(["frequency_hz", *heads])
        for k, frequency in enumerate(hertz):
            parts = [f"{v:.6e}" for value in frf[:, k] for v in (value.real, value.imag)]
            writer.writerow([f"{frequency:.2f}", *parts])


if __name__ == "__main__":
    for number, task in enumerate(TASKS, 1):
        print(number, task.words, flush=True)
        make(number, task)
