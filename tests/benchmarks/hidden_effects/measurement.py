"""What a trial measures: a building of known parameters and effects, its records and FRFs."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.document import Building
from femupdate.dynamics import damping_law
from femupdate.effects import Placed
from femupdate.measurement import (
    FloorChannel,
    GroundMotion,
    Histories,
    Observation,
    estimate_frf,
    read_record,
)
from femupdate.measurement.names import BASE
from femupdate.simulation import truth_of, white_noise
from femupdate.simulation.truth import FineModel, Truth

# Shaking of the base: half of the trials white, a quarter each an earthquake simulated or recorded.
WHITE, SIMULATED, RECORDED = "white", "simulated", "recorded"
SHAKINGS = (WHITE, SIMULATED, WHITE, RECORDED)
RECORD = Path(__file__).parents[3] / "examples" / "records" / "ridgecrest_2019_clc_90.csv"

# What is put into a building: an effect at its place, with the values of its parameters.
HiddenEffect = tuple[Placed, tuple[float, ...]]


@dataclass(frozen=True, kw_only=True)
class TrialSettings:
    """How the trials are measured."""

    # Of the base motion, by turns; a recorded earthquake has its own
    durations_s: tuple[float, ...] = (60.0, 120.0, 240.0)
    # sampling_hz, rms_m_s2: of the base motion, white over the grid
    sampling_hz: float = 200.0
    rms_m_s2: float = 0.3
    sensor_noise_m_s2: float = 0.003  # rms on every channel
    quantisation_m_s2: float = 5e-4  # step of the recorder


@dataclass(frozen=True)
class MeasuredBuilding:
    """A building whose parameters and effects are known, as it can be measured."""

    building: Building  # as its file says
    settings: TrialSettings  # of the measurement
    theta: Floats  # (p,) stiffness factors
    zeta: float  # damping ratio
    effects: tuple[HiddenEffect, ...]  # in the building, and missing in its file
    shaking: str = WHITE  # of the base, one of `SHAKINGS`
    duration_s: float = 120.0  # of it

    def truth(self, fine: FineModel) -> Truth:
        """Its response, on the fine mesh."""
        law, top_hz = damping_law(self.building), self.building.frequency_grid.stop
        return truth_of(fine, self.theta, law, top_hz, self.effects)

    def record(self, truth: Truth, rng: np.random.Generator, share: float = 1.0) -> Histories:
        """What the recorder writes, of a share of the duration."""
        settings = self.settings
        top = min(self.building.frequency_grid.stop, 0.44 * settings.sampling_hz)
        duration = share * self.duration_s
        motion = self._motion(duration, top, rng)
        exact = np.vstack([motion.acceleration, truth.respond(self.zeta, motion)])
        noisy = exact + settings.sensor_noise_m_s2 * rng.standard_normal(exact.shape)
        step = settings.quantisation_m_s2
        base = FloorChannel(BASE, BASE, "", truth.fine.direction)
        channels = (base, *truth.fine.channels)
        return Histories(motion.time_step, channels, step * np.round(noisy / step), "trial")

    def _motion(self, duration: float, top: float, rng: np.random.Generator) -> GroundMotion:
        """Shaking of the base, all kinds of the same rms."""
        settings = self.settings
        if self.shaking == RECORDED:
            real = read_record(RECORD)
            scale = settings.rms_m_s2 / float(np.sqrt(np.mean(real.acceleration**2)))
            return replace(real, acceleration=scale * real.acceleration)
        motion = white_noise(duration, settings.sampling_hz, settings.rms_m_s2, (0.3, top), rng)
        if self.shaking == WHITE:
            return motion
        count = motion.acceleration.size
        shaped = motion.acceleration * _strength(np.linspace(0.0, duration, count, endpoint=False))
        scale = settings.rms_m_s2 / float(np.sqrt(np.mean(shaped**2)))
        return replace(motion, acceleration=scale * shaped)

    def observe(
        self, truth: Truth, rng: np.random.Generator
    ) -> tuple[Observation, tuple[Observation, ...]]:
        """FRFs by Welch's method of what the recorder wrote, and of both halves of it."""
        grid, direction = self.building.frequency_grid.frequencies_hz(), truth.fine.direction
        record = self.record(truth, rng)
        halves = tuple(estimate_frf(record, grid, direction, half=number) for number in (0, 1))
        return estimate_frf(record, grid, direction), halves


def _strength(time: Floats) -> Floats:
    """Envelope of an earthquake: it rises for 3 s, is strong for 10 s, and dies away in 12 s.

    The shape of Amin and Ang (1968, J. Eng. Mech. Div. ASCE 94, 559).
    """
    return np.minimum(np.minimum((time / 3.0) ** 2, 1.0), np.exp(-(time - 13.0) / 12.0))


def floor_means(histories: Histories, floors: tuple[str, ...], direction: str) -> Floats:
    """Accelerations (f, t) of floors, each the mean of its channels in one direction, m/s2."""
    rows: dict[str, list[int]] = {floor: [] for floor in floors}
    for row, channel in enumerate(histories.channels):
        if channel.floor != BASE and channel.direction == direction:
            rows[channel.floor].append(row)
    return np.stack([histories.acceleration[own].mean(axis=0) for own in rows.values()])
