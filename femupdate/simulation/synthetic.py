"""What a simulation is asked for, and what comes of it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.measurement.histories import Histories
from femupdate.measurement.record import GroundMotion
from femupdate.result import Item, Note, Result
from femupdate.simulation.sensors import SensorPoints


@dataclass(frozen=True, kw_only=True)
class SimulationSettings:
    """What is simulated.

    Attributes:
        theta: stiffness factors, one a story; drawn from the prior where None.
        zeta: damping ratio of all modes; the building's own damping where None.
        mesh_size: m; two fifths of the building's own where None.
        sensors: points on every floor, or by floor (see `sensor_places`).
        base_motion: motion of the base; band-limited white noise where None.
        duration_s, rms_m_s2, band_hz: of the white noise; the rms is that between the ramps of one
            second at both ends.
        sampling_hz: of the file.
        rotation_rms: of the base's rotation, rad/s2, half of whose power follows the translation;
            None for a base that does not turn.
        vertical_at: places along the motion of the vertical sensors of a base that turns, m.
        sensor_noise_m_s2: rms of the white noise of every channel, the base's included.
        quantisation_m_s2: step of the recorder; None for none.
        effects: put into the full model: label such as "added_mass@3F" and all parameters.
        seed: of theta, base motion and noise.
    """

    theta: tuple[float, ...] | None = None
    zeta: float | None = None
    mesh_size: float | None = None
    sensors: SensorPoints | None = None
    base_motion: GroundMotion | None = None
    duration_s: float = 80.0
    sampling_hz: float = 200.0
    rms_m_s2: float = 0.3
    band_hz: tuple[float, float] = (0.5, 50.0)
    rotation_rms: float | None = None
    vertical_at: tuple[float, ...] = (-2.0, 2.0)
    sensor_noise_m_s2: float = 0.003
    quantisation_m_s2: float | None = None
    effects: tuple[tuple[str, tuple[float, ...]], ...] = ()
    seed: int = 0


@dataclass(frozen=True, eq=False, kw_only=True)
class SimulationTruth:
    """What inference should find.

    Attributes:
        parameters: names of the stiffness factors.
        theta: (p,) their true values.
        zeta: damping ratio of all modes; None where the building's law gives each mode its own.
        frequency_hz: natural frequencies of the modes that the base motion drives, Hz.
        effective_mass: share of the mass that each of them moves.
        building: name of the building.
        building_hash: of its mechanics.
        mesh_size: m; None for a shear building.
        dof: degrees of freedom of the full model.
        places: where each sensor of a frame is, by its name.
        seed: of the simulation.
        effects: what was put into the full model, with all parameters.
        motion: what moved the base, and how that was sampled.
        noise: of the sensors and the recorder.
    """

    parameters: tuple[str, ...]
    theta: Floats
    zeta: float | None
    frequency_hz: Floats
    effective_mass: Floats
    building: str
    building_hash: str
    mesh_size: float | None
    dof: int
    places: Mapping[str, str]
    seed: int
    motion: Mapping[str, Any] = field(default_factory=dict)
    noise: Mapping[str, Any] = field(default_factory=dict)
    effects: tuple[tuple[str, tuple[float, ...]], ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        return {
            "building": self.building,
            "building_hash": self.building_hash,
            "mesh_size_m": self.mesh_size,
            "degrees_of_freedom": self.dof,
            "seed": self.seed,
            "parameters": list(self.parameters),
            "theta": self.theta.tolist(),
            "zeta": self.zeta,
            "frequencies_hz": np.round(self.frequency_hz, 4).tolist(),
            "effective_mass": np.round(self.effective_mass, 4).tolist(),
            "effects": [{"effect": name, "parameters": list(own)} for name, own in self.effects],
            "motion": dict(self.motion),
            "noise": dict(self.noise),
            "sensors": dict(self.places),
        }


@dataclass(frozen=True, eq=False)
class Simulation:
    """A synthetic observation.

    Attributes:
        histories: as a recorder would have written them.
        truth: what made them.
    """

    histories: Histories
    truth: SimulationTruth


@dataclass(frozen=True)
class WrittenSimulation(Result):
    """The files of a synthetic observation.

    Attributes:
        observation: the CSV file.
        truth_file: beside it.
        truth: what it holds.
    """

    observation: Path
    truth_file: Path
    truth: SimulationTruth

    def items(self) -> Iterator[Item]:
        """Files and stiffness factors."""
        factors = ", ".join(f"{value:.3f}" for value in self.truth.theta)
        yield Note(str(self.observation), {"observation": self.observation})
        yield Note(str(self.truth_file), {"truth_file": self.truth_file})
        yield Note(f"  stiffness factors {factors}", {"truth": self.truth.as_dict()})
