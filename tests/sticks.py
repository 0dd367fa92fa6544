"""Sticks as building files, and records that a chain solved by hand makes."""

from pathlib import Path

import numpy as np

from femupdate.dynamics import Excitation

MASSES, SPRINGS = np.array([3.0, 2.0, 1.5]), np.array([9e3, 5e3, 4e3])
STEP = 0.01
BUILDING = """\
name = "three"
kind = "shear"
frequency_grid = { start = "0.2 Hz", step = "0.2 Hz", count = 75 }
prior = { theta = { lower = 0.5, upper = 2 }, zeta = { lower = 0.01, upper = 0.1 } }
damping = { law = "constant", ratio = 0.04 }
"""
STORY = '[[stories]]\nname = "S{}"\nmass = "{} kg"\nstiffness = "{} N/m"\n'
EFFECT = '[[effects]]\nname = "{}"\nplace = "{}"\n'


def accelerance(system, parameters, zeta, frequency_hz, forced, rest=None):
    """Accelerations (N, f, k) of the floors over a force at one of them, 1/kg."""
    force, (theta, sizes) = Excitation(system.floors[forced]), system.split(parameters)
    return system.respond(force, theta, zeta, sizes, frequency_hz, rest)[:, :, 0]


def shear_stick(damping=None, effects="", stories=3):
    """Text of the lower stories of the four-story benchmark, at a tenth of its frequencies."""
    text = (Path(__file__).parents[1] / "models" / "shear_4dof.toml").read_text(encoding="utf-8")
    grid, prior, law, seen, end = (
        text.index(f"[{name}]")
        for name in ("frequency_grid", "prior.theta", "damping", "observation", "provenance")
    )
    upper = text.index(f'[[stories]]\nname = "S{stories + 1}"') if stories < 4 else grid
    coarse = '[frequency_grid]\nstart = "0.2 Hz"\nstep = "0.2 Hz"\ncount = 102\n\n'
    head, tail = text[:upper] + coarse + text[prior:law], text[seen:end]
    return head + (damping or text[law:seen]) + tail + effects


def write_stick(path, *effects):
    """The file of the stick, with (name, place) of effects, of size nothing."""
    stories = [STORY.format(n, m, k) for n, m, k in zip((1, 2, 3), MASSES, SPRINGS, strict=True)]
    path.write_text("".join([BUILDING, *stories, *(EFFECT.format(*one) for one in effects)]))
    return path


def write_shaken(path, chain, seed, rms=0.5, hum=0.0):
    """Two minutes of band-limited noise at the base (rms, m/s2) with the chain's exact response."""
    rng, count = np.random.default_rng(seed), 12_000
    frequency = np.fft.rfftfreq(count, STEP)
    white = np.fft.rfft(rng.standard_normal(count))
    white[(frequency < 0.15) | (frequency > 18.0)] = 0.0
    base = np.fft.irfft(white, count) * (np.arange(count) < count - 1000)
    frf = np.ones((4, frequency.size), dtype=complex)
    frf[1:, 1:] = chain.frf(frequency[1:])
    motion = np.fft.irfft(frf * np.fft.rfft(rms / base.std() * base), count, axis=1)
    motion += 0.002 * rng.standard_normal(motion.shape)
    motion[1:] += hum * np.sin(2.0 * np.pi * 40.0 * STEP * np.arange(count))  # above all that fits
    rows = [f"{n * STEP:.2f}," + ",".join(f"{v:.7g}" for v in r) for n, r in enumerate(motion.T)]
    path.write_text("\n".join(["time_s,base,2F,3F,RF", "s,m/s2,m/s2,m/s2,m/s2", *rows]) + "\n")
    return path
