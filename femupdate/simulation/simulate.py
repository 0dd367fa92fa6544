"""simulate: a synthetic observation of a building whose truth is known, made in the time domain.

The motion comes from the full model on a finer mesh than the one that will explain it, and is seen
by single accelerometers with their noise.
"""

import json
import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from femupdate import __version__
from femupdate.arrays import Floats
from femupdate.building.common import EffectEntry
from femupdate.building.document import Building, factor_ranges, mechanics_hash
from femupdate.building.kinds import FrameBuilding, require_heights
from femupdate.dynamics.damping import damping_law
from femupdate.effects.effect import Placed
from femupdate.effects.registry import building_effects, check_places, effect_named
from femupdate.effects.structure import structure_of
from femupdate.errors import BuildingError, MeasurementError, StructureError
from femupdate.measurement.names import BASE, FloorChannel, channel_name, vertical_channel
from femupdate.measurement.observation import Histories, fault_of, other_horizontal
from femupdate.measurement.record import GroundMotion
from femupdate.measurement.write import write_observation_histories
from femupdate.progress import SILENT, Progress
from femupdate.result import Item, Note, Result
from femupdate.simulation.truth import SensorPoints, Truth, fine_model, truth_of
from femupdate.study import file_hash, write_text


@dataclass(frozen=True, kw_only=True)
class SimulationSettings:
    """What is simulated."""

    # stiffness factors, one a story; drawn from the prior where None
    theta: tuple[float, ...] | None = None
    zeta: float | None = None  # damping ratio of all modes; the building's own damping where None
    mesh_size: float | None = None  # m; two fifths of the building's own where None
    sensors: SensorPoints | None = None  # points on every floor, or by floor (see `sensor_places`)
    # motion of the base; band-limited white noise where None
    base_motion: GroundMotion | None = None
    # of the white noise; the rms is that between the ramps of one second at both ends
    duration_s: float = 80.0
    sampling_hz: float = 200.0  # of the file
    rms_m_s2: float = 0.3
    band_hz: tuple[float, float] = (0.5, 50.0)
    # of the base's rotation, rad/s2, half of whose power follows the translation; None for a base
    # that does not turn
    rotation_rms: float | None = None
    # of the base's motion across, m/s2, white as that along; None for a base that has none
    across_rms: float | None = None
    # places along the motion of the vertical sensors of a base that turns, m
    vertical_at: tuple[float, ...] = (-2.0, 2.0)
    sensor_noise_m_s2: float = 0.003  # rms of the white noise of every channel, the base's included
    quantisation_m_s2: float | None = None  # step of the recorder; None for none
    # put into the full model: label such as "added_mass@3F" and all parameters
    effects: tuple[tuple[str, tuple[float, ...]], ...] = ()
    seed: int = 0  # of theta, base motion and noise


@dataclass(frozen=True, eq=False)
class Simulation:
    """A synthetic observation."""

    histories: Histories  # as a recorder would have written them
    truth: Mapping[str, Any]  # what made them: what inference should find


@dataclass(frozen=True)
class WrittenSimulation(Result):
    """The files of a synthetic observation."""

    observation: Path  # the CSV file
    truth_file: Path  # beside it
    truth: Mapping[str, Any]  # what it holds

    def items(self) -> Iterator[Item]:
        """Files and stiffness factors."""
        factors = ", ".join(f"{value:.3f}" for value in self.truth["theta"])
        yield Note(str(self.observation), {"observation": self.observation})
        yield Note(str(self.truth_file), {"truth_file": self.truth_file})
        yield Note(f"  stiffness factors {factors}", {"truth": self.truth})


logger = logging.getLogger(__name__)


# Settings that are numbers or None: the lowest, the highest, and both in words.
_ABOVE_ZERO = float(np.nextafter(0.0, 1.0)), np.inf, "a number above zero"
_LIMITS: Mapping[str, tuple[float, float, str]] = {
    "duration_s": _ABOVE_ZERO,
    "sampling_hz": _ABOVE_ZERO,
    "rms_m_s2": (
        _ABOVE_ZERO[0],
        100.0,
        "above zero and at most 100: no shaking table reaches more",
    ),
    "rotation_rms": _ABOVE_ZERO,
    "across_rms": _ABOVE_ZERO,
    "sensor_noise_m_s2": (0.0, np.inf, "a number, zero or more"),
    "quantisation_m_s2": _ABOVE_ZERO,
}


def simulate_observation(
    building: Building, settings: SimulationSettings | None = None, progress: Progress = SILENT
) -> Simulation:
    """Simulate what accelerometers in a building record.

    Raises:
        BuildingError: a sensor point, mesh size or damping ratio does not fit the building.
        MeasurementError: the base motion cannot be made or sampled as asked.
        StructureError: theta does not fit, or the structure is a mechanism.
    """
    chosen = settings or SimulationSettings()
    _check_settings(chosen)
    streams = np.random.default_rng(chosen.seed).spawn(5)
    theta = _theta(building, chosen.theta, streams[0])
    zeta, fixed = chosen.zeta, building.damping.is_rayleigh
    if zeta is None and not fixed:
        zeta = building.damping.ratio
    elif zeta is not None and fixed:
        raise BuildingError(
            f"{building.name}: damping.law is rayleigh, which gives every mode its own ratio; "
            "leave zeta out"
        )
    elif zeta is not None and not 0.0 < zeta < 1.0:
        raise StructureError(f"zeta is {zeta:g}; it must lie between 0 and 1 (0.02 means 2 %)")
    if chosen.base_motion is not None:
        motion = chosen.base_motion.resampled(1.0 / chosen.sampling_hz)
    else:
        noise = chosen.duration_s, chosen.sampling_hz, chosen.rms_m_s2, chosen.band_hz
        motion = white_noise(*noise, streams[1])
    if chosen.rotation_rms is not None:  # as strong as the translation at all times
        window = np.ones(round(chosen.sampling_hz)) / chosen.sampling_hz
        envelope = np.sqrt(np.convolve(motion.acceleration**2, window, mode="same"))
        turning = envelope * streams[3].standard_normal(len(envelope))
        parts = (row / np.sqrt((row**2).mean()) for row in (motion.acceleration, turning))
        rotation = chosen.rotation_rms * sum(parts, np.zeros(())) * 0.5**0.5
        motion = replace(motion, rotation=rotation)
    if motion.rotation is not None:
        require_heights(building)
    if chosen.across_rms is not None:
        length = motion.acceleration.size / chosen.sampling_hz
        noise = length, chosen.sampling_hz, chosen.across_rms, chosen.band_hz
        motion = replace(motion, across=white_noise(*noise, streams[4]).acceleration)
    effects = tuple(parse_effect(building, name, sizes) for name, sizes in chosen.effects)
    progress.start("Solving the full model", 1)
    fine, law = fine_model(building, chosen.mesh_size, chosen.sensors), damping_law(building)
    top = 0.5 * chosen.sampling_hz  # modes are kept up to there, well above the motion's band
    if chosen.base_motion is None:
        top = max(top, 1.5 * chosen.band_hz[1])
    truth = truth_of(fine, theta, law, top, effects, len(motion.inputs))
    progress.advance()
    progress.start("Integrating the motion", 1)
    exact = truth.respond(0.0 if zeta is None else zeta, motion)
    progress.advance()
    base = FloorChannel(channel_name(BASE, direction=fine.direction), BASE, "", fine.direction)
    others = {}
    if motion.rotation is not None:
        others = {vertical_channel(x): -x * motion.rotation for x in chosen.vertical_at}
    if motion.across is not None:
        across = other_horizontal(fine.direction)
        name = channel_name(BASE, direction=across)
        others[FloorChannel(name, BASE, "", across)] = motion.across
    exact = np.vstack([motion.acceleration, exact, *others.values()])
    recorded = exact + chosen.sensor_noise_m_s2 * streams[2].standard_normal(exact.shape)
    if (step := chosen.quantisation_m_s2) is not None:
        recorded = step * np.round(recorded / step)
    histories = Histories(
        motion.time_step,
        (base, *fine.channels, *others),
        recorded,
        f"synthetic observation of {building.name}",
    )
    return Simulation(histories, _told(building, chosen, truth, (theta, zeta), motion, effects))


def write_simulation(
    simulation: Simulation, path: str | Path, comments: Sequence[str] = ()
) -> WrittenSimulation:
    """Write the observation file and, beside it, its truth as `<name>.truth.json`.

    Args:
        comments: lines to add at its top to those that say what it is.

    Raises:
        MeasurementError, StudyError: a file cannot be written.
    """
    truth, told = truth_path(path), simulation.truth
    label = (
        f"synthetic: made by femupdate {__version__} from building {told['building']}, seed "
        f"{told['seed']}; not a measurement",
        *(
            f"hidden effect: {one['effect']}, {', '.join(f'{v:g}' for v in one['parameters'])}"
            for one in told["effects"]
        ),
        f"all settings are in {truth.name}",
    )
    written = write_observation_histories(path, simulation.histories, (*label, *comments), 6)
    content = {
        "what": "truth behind a synthetic observation; not a measurement",
        "observation": written.name,
        "observation_sha256": file_hash(written),
        "femupdate": __version__,
        **told,
    }
    write_text(truth, json.dumps(content, indent=2) + "\n")
    return WrittenSimulation(written, truth, told)


def truth_path(observation: str | Path) -> Path:
    """Return where the truth of an observation file lies."""
    return Path(observation).with_suffix(".truth.json")


def _check_settings(settings: SimulationSettings) -> None:
    for name, (lowest, highest, words) in _LIMITS.items():
        value = getattr(settings, name)
        if value is not None and not (np.isfinite(value) and lowest <= value <= highest):
            raise MeasurementError(f"{name} is {value}; it must be {words}")
    if fault := fault_of([vertical_channel(place) for place in settings.vertical_at]):
        raise MeasurementError(fault)
    if settings.base_motion is not None:
        return
    samples, most = settings.sampling_hz * settings.duration_s, 500_000  # an hour at 100 Hz
    if samples > most:
        raise MeasurementError(
            f"{samples:.3g} samples a channel are too many to simulate; ask for at most "
            f"{most:,}, by a shorter duration or a lower sampling rate"
        )
    low, high = settings.band_hz
    if not 0.0 < low < high:
        raise MeasurementError(f"the band {low:g} to {high:g} Hz is empty; give the lower first")
    flat = 0.45  # of the sampling rate: the record is interpolated flat up to .46
    top = flat * settings.sampling_hz
    if high > top:
        raise MeasurementError(
            f"a band up to {high:g} Hz does not fit {settings.sampling_hz:g} samples a second; "
            f"stay below {top:g} Hz or sample at {high / flat:.4g} Hz or more"
        )


def _theta(building: Building, asked: tuple[float, ...] | None, rng: np.random.Generator) -> Floats:
    ranges = factor_ranges(building)
    lower, upper = np.array(list(ranges.values())).T
    if asked is None:
        return np.asarray(lower + (upper - lower) * rng.random(len(ranges)))
    theta = np.asarray(asked, dtype=np.float64)
    if theta.shape != lower.shape or not (np.isfinite(theta) & (theta > 0.0)).all():
        raise StructureError(
            f"theta is {theta.tolist()}; the building {building.name} needs {len(ranges)} numbers "
            f"above zero: {', '.join(ranges)}"
        )
    far = (theta < lower) | (theta > upper)
    outside = [name for name, out in zip(ranges, far, strict=True) if out]
    if outside:
        logger.warning("%s: %s lies outside the prior", building.name, ", ".join(outside))
    return theta


def _told(
    building: Building,
    settings: SimulationSettings,
    truth: Truth,
    sample: tuple[Floats, float | None],
    motion: GroundMotion,
    effects: Sequence[tuple[Placed, tuple[float, ...]]],
) -> dict[str, Any]:
    """What inference should find, of a sample: stiffness factors and damping ratio."""
    # Modes are named that move a hundredth of the mass.
    driven, fine = truth.effective_mass >= 0.01, truth.fine
    noise, turns = settings.base_motion is None, motion.rotation is not None
    places = zip(fine.channels, fine.places, strict=True)
    return {
        "building": building.name,
        "building_hash": mechanics_hash(building),
        "mesh_size_m": fine.mesh_size,
        "degrees_of_freedom": fine.dof,
        "seed": settings.seed,
        "parameters": list(factor_ranges(building)),
        "theta": sample[0].tolist(),
        "zeta": sample[1],
        "frequencies_hz": np.round(truth.frequency_hz[driven], 4).tolist(),
        "effective_mass": np.round(truth.effective_mass[driven], 4).tolist(),
        "effects": [
            {"effect": placed.label, "parameters": list(values)} for placed, values in effects
        ],
        "motion": {
            "title": motion.title,
            "direction": fine.direction,
            "duration_s": motion.acceleration.size / settings.sampling_hz,
            "sampling_hz": settings.sampling_hz,
            "rms_m_s2": settings.rms_m_s2 if noise else None,
            "band_hz": list(settings.band_hz) if noise else None,
            "rotation_rms_rad_s2": settings.rotation_rms,
            "across_rms_m_s2": settings.across_rms,
            "vertical_sensors_m": list(settings.vertical_at) if turns else [],
        },
        "noise": {
            "sensor_rms_m_s2": settings.sensor_noise_m_s2,
            "quantisation_m_s2": settings.quantisation_m_s2,
        },
        "sensors": {channel.name: place for channel, place in places if place},
    }


def white_noise(
    duration_s: float,
    sampling_hz: float,
    rms: float,
    band_hz: tuple[float, float],
    rng: np.random.Generator,
) -> GroundMotion:
    """Return Gaussian noise of an even spectrum within a band and nothing outside it.

    The noise has just the given rms (m/s2) before its first and last second rise from and fall to
    zero by half a cosine.

    Raises:
        MeasurementError: the record is too short for the band.
    """
    count = round(duration_s * sampling_hz)
    frequency = np.fft.rfftfreq(count, 1.0 / sampling_hz)
    inside = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    ramp = round(sampling_hz)  # a table starts and stops smoothly
    if np.count_nonzero(inside) < 2 or count < 4 * ramp:
        raise MeasurementError(
            f"{duration_s:g} s are too short for white noise from {band_hz[0]:g} to "
            f"{band_hz[1]:g} Hz; take 4 s or more"
        )
    noise = np.fft.irfft(np.where(inside, np.fft.rfft(rng.standard_normal(count)), 0.0), count)
    noise *= rms / np.sqrt(np.mean(noise**2))
    rise = 0.5 - 0.5 * np.cos(np.pi * np.arange(ramp) / ramp)
    noise[:ramp] *= rise
    noise[-ramp:] *= rise[::-1]
    return GroundMotion(noise, 1.0 / sampling_hz, "white noise")


def parse_effect(
    building: Building, label: str, values: tuple[float, ...]
) -> tuple[Placed, tuple[float, ...]]:
    """An effect and its parameters from its label, such as "added_mass@3F".

    Args:
        values: its first parameters; the others are neutral.

    Raises:
        BuildingError: no such effect or place, or too few, too many or impossible parameters.
    """
    name, _, place = label.partition("@")
    effect = effect_named(name)
    if effect.needs_levels:
        raise BuildingError(
            f"{building.name}: {name} shows between two levels of motion; simulate each with its "
            "own --theta, --zeta and --rms"
        )
    parameters = effect.parameters
    if len(values) > len(parameters):
        raise BuildingError(
            f"{label}: {len(values)} numbers were given; it takes "
            f"{', '.join(p.name for p in parameters) or 'none'}"
        )
    if parameters and not values:
        raise BuildingError(
            f"{label}: give its {parameters[0].name}, such as {label}={parameters[0].scale:g}"
        )
    sizes = {p.name: value for p, value in zip(parameters, values, strict=False)}
    entry = EffectEntry.model_construct(name=name, place=place, parameters=sizes)
    alone = building.model_copy(update={"effects": (entry,), "tolerances": None})
    listed = building_effects(alone)
    # A coarse mesh is enough to know the places of effects.
    coarse = 2.0 * building.mesh.size if isinstance(building, FrameBuilding) else None
    check_places(structure_of(building, coarse), listed)
    return listed.placed[0], listed.values
