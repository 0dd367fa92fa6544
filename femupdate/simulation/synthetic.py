"""What a simulation is asked for, what comes of it, and the label that says so."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from femupdate import __version__
from femupdate.arrays import Floats
from femupdate.measurement.observation_file import Histories
from femupdate.measurement.record import GroundMotion
from femupdate.simulation.sensors import SensorPoints
from femupdate.simulation.truth import FineModel, Truth


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
        seed: of the simulation.
        effects: what was put into the full model, with all parameters.
    """

    parameters: tuple[str, ...]
    theta: Floats
    zeta: float | None
    frequency_hz: Floats
    effective_mass: Floats
    building: str
    building_hash: str
    mesh_size: float | None
    seed: int
    effects: tuple[tuple[str, tuple[float, ...]], ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        return {
            "building": self.building,
            "building_hash": self.building_hash,
            "mesh_size_m": self.mesh_size,
            "seed": self.seed,
            "parameters": list(self.parameters),
            "theta": self.theta.tolist(),
            "zeta": self.zeta,
            "frequencies_hz": np.round(self.frequency_hz, 4).tolist(),
            "effective_mass": np.round(self.effective_mass, 4).tolist(),
            "effects": [{"effect": name, "parameters": list(own)} for name, own in self.effects],
        }


@dataclass(frozen=True, eq=False)
class Simulation:
    """A synthetic observation.

    Attributes:
        histories: as a recorder would have written them.
        truth: what made them.
        comments: sentences that say so, for the file.
    """

    histories: Histories
    truth: SimulationTruth
    comments: tuple[str, ...]


@dataclass(frozen=True)
class WrittenSimulation:
    """The files of a synthetic observation.

    Attributes:
        observation: the CSV file.
        truth_file: beside it.
        truth: what it holds.
    """

    observation: Path
    truth_file: Path
    truth: SimulationTruth

    def as_dict(self) -> dict[str, Any]:
        """What `--json` holds."""
        files = {"observation": self.observation, "truth_file": self.truth_file}
        return {**files, "truth": self.truth.as_dict()}

    def lines(self) -> tuple[str, ...]:
        """Files and stiffness factors, for people."""
        factors = ", ".join(f"{value:.3f}" for value in self.truth.theta)
        return str(self.observation), str(self.truth_file), f"  stiffness factors {factors}"


def label(
    model: Truth, truth: SimulationTruth, settings: SimulationSettings, motion: GroundMotion
) -> tuple[str, ...]:
    """Return the sentences that say what a simulated observation is."""
    quantised = settings.quantisation_m_s2
    step = "" if quantised is None else f", quantised to {quantised:g} m/s2"
    return (
        f"synthetic: made by femupdate {__version__} from building {truth.building}, "
        f"{_mesh_words(model)}, theta = {', '.join(f'{t:.6g}' for t in truth.theta)}, "
        f"{_damping_words(truth.zeta)}, seed {truth.seed}; not a measurement",
        *(f"hidden effect: {n}, {', '.join(f'{v:g}' for v in own)}" for n, own in truth.effects),
        f"base motion along {model.fine.direction}: {_motion_words(settings, motion)}",
        *_rotation_words(settings),
        f"white noise of {settings.sensor_noise_m_s2:g} m/s2 rms on every channel{step}",
        *_place_words(model.fine),
    )


def _mesh_words(model: Truth) -> str:
    fine = model.fine
    if fine.structure.is_stick:
        return "the chain itself"
    mesh = "its own mesh" if fine.mesh_size is None else f"mesh {fine.mesh_size:g} m"
    return f"{mesh} ({fine.dof} degrees of freedom, {len(model.frequency_hz)} shapes)"


def _damping_words(zeta: float | None) -> str:
    return "damping as in its file" if zeta is None else f"zeta = {zeta:g} in every mode"


def _motion_words(settings: SimulationSettings, motion: GroundMotion) -> str:
    sampled = f"{motion.duration:.4g} s at {settings.sampling_hz:g} Hz"
    if settings.base_motion is not None:
        return f"{motion.title}, {sampled}"
    low, high = settings.band_hz
    return (
        f"white noise, {settings.rms_m_s2:g} m/s2 rms, {low:g} to {high:g} Hz, {sampled}, rising "
        "from and falling to rest within a second"
    )


def _rotation_words(settings: SimulationSettings) -> tuple[str, ...]:
    if settings.rotation_rms is None:
        return ()
    return (
        f"base rotation of {settings.rotation_rms:g} rad/s2 rms, half of its power in phase with "
        "the translation, half of its own; vertical sensors at "
        f"{', '.join(f'{place:g}' for place in settings.vertical_at)} m",
    )


def _place_words(seen: FineModel) -> tuple[str, ...]:
    """Where the sensors are: one line where all floors are alike, else one a floor."""
    by_floor: dict[str, list[str]] = {}
    for channel, place in zip(seen.channels, seen.places, strict=True):
        by_floor.setdefault(channel.floor, []).append(f"{channel.sensor} at {place}".strip())
    lines: Mapping[str, str] = {floor: ", ".join(words) for floor, words in by_floor.items()}
    if not any(seen.places):
        return ()
    if len(set(lines.values())) == 1:
        return (f"sensors of every floor: {next(iter(lines.values()))}",)
    return tuple(f"sensors of {floor}: {words}" for floor, words in lines.items())
