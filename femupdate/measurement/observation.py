"""What was measured of a building, in SI units: histories of its floors, and FRFs with their noise.

Of the base's own rotation, vertical sensors tell that stand at places along the motion. A base that
turns by a small angle, so that what stands on it leans forward, goes down in front: at the place s
along the motion its vertical acceleration is that of its middle less s times the angular
acceleration. Of more than two sensors the slope is the least-squares one.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from femupdate.arrays import Complexes, Flags, Floats
from femupdate.dynamics.excitation import BASE_MOTION, Excitation
from femupdate.errors import MeasurementError, brief
from femupdate.measurement.clock import check_step
from femupdate.measurement.names import (
    BASE,
    FloorChannel,
    floor_height,
    newtons,
    parse_channel,
    si_factor,
)
from femupdate.measurement.recording import RecordedChannel, Recording, acceleration_unit, in_step
from femupdate.measurement.resolve import FEWEST_OF_SPECTRUM, placed_channels
from femupdate.measurement.text import TextFile
from femupdate.units import STANDARD_GRAVITY, factor, percent

if TYPE_CHECKING:
    from femupdate.measurement.estimated import Estimator


# Peaks of the ground: the largest recorded is about 4 g (2008, Iwate); no accelerograph resolves
# less than the smallest.
LARGEST_G, SMALLEST_G = 5.0, 1e-6
# m/s2.
LARGEST_PEAK, SMALLEST_PEAK = LARGEST_G * STANDARD_GRAVITY, SMALLEST_G * STANDARD_GRAVITY
# A floor feels forty times the largest peak of the ground; beyond it is a spike or a wrong unit.
LARGEST_RESPONSE = 40.0 * LARGEST_PEAK
DEFAULT_NOISE = 0.2  # of ln|H|, where neither the file nor the coherence says


@dataclass(frozen=True, eq=False)
class Histories:
    """Accelerations measured at the same times.

    Attributes:
        time_step: s.
        channels: (c,) what each row is.
        acceleration: (c, n) absolute acceleration, m/s2; of a force, which stands where the base
            would be, N.
        force: floor at which a force acts; empty where the base moves.
    """

    __repr__ = brief

    time_step: float
    channels: tuple[FloorChannel, ...]
    acceleration: Floats
    source: str = "histories"
    force: str = ""
    notes: tuple[str, ...] = ()
    # whether floors follow the base's motion across, which is an input where it was measured
    crosses: bool = False

    @property
    def floors(self) -> tuple[str, ...]:
        """Names of the floors that have a sensor, bottom to top, without the base."""
        names = {channel.floor for channel in self.channels} - {BASE}
        return tuple(sorted(names, key=floor_height))

    @property
    def excitation(self) -> Excitation:
        """Of what kind what drives the building is."""
        return Excitation(self.force)

    def inputs(self, direction: str) -> Floats:
        """What drives the building (c, n), a row a column of the `Excitation`; zero if unknown."""
        motion = [self.means(direction)[0]]
        rotation = rotation_of(self.channels, self.acceleration)
        across = (
            self.rows(BASE, other_horizontal(direction)) if self.crosses and not self.force else []
        )
        if rotation is not None or across:
            motion.append(np.zeros_like(motion[0]) if rotation is None else rotation)
        if across:
            motion.append(self.acceleration[across].mean(axis=0))
        return np.stack(motion)

    def rows(self, floor: str, direction: str) -> list[int]:
        """Rows of the sensors of a floor, or of the base, in one direction."""
        here = floor, direction
        return [k for k, to in enumerate(self.channels) if (to.floor, to.direction) == here]

    def means(self, direction: str) -> tuple[Floats, Floats, tuple[str, ...]]:
        """Mean over the sensors of base (n,) and of each floor (f, n), and the floors' names."""
        rows = {floor: self.rows(floor, direction) for floor in (BASE, *self.floors)}
        floors = tuple(floor for floor in self.floors if rows[floor])
        if not rows[BASE] or not floors:
            missing = "floor" if rows[BASE] else "base"
            there = ", ".join(channel.name for channel in self.channels)
            raise MeasurementError(
                f"{self.source}: there is no {missing} channel in direction {direction}; the file"
                f" has {there}"
            )
        base, *means = (self.acceleration[rows[place]].mean(axis=0) for place in (BASE, *floors))
        return base, np.array(means), floors


def histories_of(
    file: TextFile, channels: Mapping[FloorChannel, RecordedChannel], unit: str | None = None
) -> Histories:
    """The histories of a building in channels; beside a force the base's motion is not used."""
    forces = [ours for ours in channels if ours.force]
    if len(forces) > 1:
        raise file.error(
            f"forces act at {' and '.join(force.floor for force in forces)}; give the record of"
            " each in a file of its own"
        )
    aside = {ours: c for ours, c in channels.items() if ours.floor == BASE} if forces else {}
    used = {ours: channel for ours, channel in channels.items() if ours not in aside}
    if not forces and all(ours.floor != BASE for ours in used):
        raise file.error(
            "there is no column base, and a response is measured against the base; name or map"
            " the base acceleration, or take modes from the floors alone by femupdate identify"
        )
    fault = None if forces else fault_of(tuple(used))
    if fault is not None:
        raise file.error(fault)
    if not forces and all(ours.floor == BASE for ours in used):
        raise file.error("there is no floor beside the base; add columns 2F ... RF")
    if forces and len(used) == 1:
        raise file.error("there is a force but no floor that responds; add columns 2F ... RF")
    used, done = _at_same_times(file, used)
    time_step, source = next(iter(used.values())).time_step, file.path.name
    if not forces:
        rows = [_acceleration(file, each, ours, unit) for ours, each in used.items()]
        return Histories(time_step, tuple(used), np.array(rows), source, notes=done)
    (force,) = forces
    excitation = used.pop(force)
    pushed = newtons(file, excitation.values, excitation.unit, repr(excitation.name))
    if np.ptp(excitation.values) == 0.0:
        raise file.error(
            f"every value is {excitation.values[0]:g}: the force was not recorded",
            column=repr(excitation.name),
        )
    moved = [_acceleration(file, each, ours, unit) for ours, each in used.items()]
    along = [o for o in aside if o.direction == force.direction]
    beneath = [float(np.std(_acceleration(file, aside[ours], ours, unit))) for ours in along]
    if beneath:
        largest = max(float(np.std(row)) for row in moved)
        share = f" ({percent(max(beneath) / largest)} of the largest floor's, rms)"
        done = (
            *done,
            f"The base's motion{share if largest > 0.0 else ''} is not used beside the force at"
            f" {force.floor}: the force is taken for all that moves the building.",
        )
    names = (FloorChannel(BASE, BASE, direction=force.direction), *used)
    return Histories(time_step, names, np.array([pushed, *moved]), source, force.floor, done)


def motions_in(
    recording: Recording, columns: Mapping[str, str] | None = None
) -> Mapping[FloorChannel, RecordedChannel]:
    """Histories of floors at the same times, of any quantity, with or without the base."""
    channels = placed_channels(recording, columns)
    motions = {ours: channel for ours, channel in channels.items() if not ours.force}
    return _at_same_times(recording.file, motions)[0]


def _at_same_times(
    file: TextFile, channels: Mapping[FloorChannel, RecordedChannel]
) -> tuple[dict[FloorChannel, RecordedChannel], tuple[str, ...]]:
    """The channels at the same times, and sentences on what was done for that."""
    channels = in_step(file, channels, one_rate=True)
    first = next(iter(channels.values()))
    if first.values.size < FEWEST_OF_SPECTRUM:
        raise file.error(
            f"{first.values.size} rows are too short for a spectrum; give at least"
            f" {FEWEST_OF_SPECTRUM}"
        )
    check_step(file, first.time_step, repr(first.name))
    for each in channels.values():
        if each.values.size != first.values.size:
            raise file.error(
                f"channel {each.name!r} has {each.values.size} values every {each.time_step:g} s,"
                f" {first.name!r} {first.values.size} every {first.time_step:g} s; bring them to"
                " the same times"
            )
    return channels, tuple(
        dict.fromkeys(words for each in channels.values() for words in each.done)
    )


def _acceleration(
    file: TextFile, recorded: RecordedChannel, channel: FloorChannel, unit: str | None
) -> Floats:
    """Return a history in m/s2; refuse one without motion, or with more than any earthquake."""
    title = repr(recorded.name)
    stated = acceleration_unit(file, recorded, unit)
    values = recorded.values * si_factor(file, stated, "acceleration")
    driven = channel.floor == BASE and channel.direction != "z"
    if np.ptp(values) == 0.0:
        raise file.error(
            f"every value is {recorded.values[0]:g}: the channel was dead; "
            + ("a response needs a base that moves" if driven else "leave it out"),
            column=title,
        )
    peak = float(np.abs(values).max())
    if channel.floor == BASE and peak > LARGEST_PEAK:
        raise file.error(
            f"the base peaks at {peak / STANDARD_GRAVITY:.3g} g when read in {stated}, which no"
            f" strong-motion record has (up to {LARGEST_G:g} g); is the unit wrong?",
            column=title,
        )
    if peak > LARGEST_RESPONSE:
        at = int(np.abs(values).argmax())
        raise file.error(
            f"value {at + 1} is {peak / STANDARD_GRAVITY:.3g} g when read in {stated}, which no"
            " floor feels; remove the spike, or correct the unit",
            column=title,
        )
    return values


def other_horizontal(direction: str) -> str:
    """The horizontal direction across another, x or y."""
    return "y" if direction == "x" else "x"


def rotation_of(channels: Sequence[FloorChannel], acceleration: Floats) -> Floats | None:
    """Angular acceleration (n,) of the base, rad/s2, forward positive, without its mean.

    None where fewer than two vertical sensors stand at known places of the base.

    Args:
        channels: c of them, all that were recorded.
        acceleration: (c, n) m/s2.
    """
    rows, places = _vertical(channels)
    if len(rows) < 2:
        return None
    arm = places - places.mean()
    slope = arm @ acceleration[rows] / (arm @ arm)
    return np.asarray(slope.mean() - slope)


def fault_of(channels: Sequence[FloorChannel]) -> str | None:
    """Why vertical sensors of the base cannot measure its rotation, or None where they can."""
    rows, places = _vertical(channels)
    # Within a centimetre they stand at one place.
    if len(rows) < 2 or np.ptp(places) >= 0.01:
        return None
    names = " and ".join(channels[row].name for row in rows)
    return (
        f"{names} stand at one place, and a rotation needs two places along the motion; correct the"
        " places, which are in metres, or leave the columns out"
    )


def said_of_rotation(
    channels: Sequence[FloorChannel], acceleration: Floats, base: Floats
) -> tuple[str, ...]:
    """Sentences on what vertical sensors of the base tell of its rotation.

    Args:
        channels, acceleration: see `rotation_of`.
        base: (n,) translation, m/s2.
    """
    _, places = _vertical(channels)
    rotation = rotation_of(channels, acceleration)
    if rotation is not None:
        at = ", ".join(f"{place:g}" for place in places)
        moved = float(np.sqrt((rotation**2).mean()))
        height = 10.0  # m, at which the rotation is compared with the translation
        share = height * moved / float(base.std())
        # A table that pitches by 0.3 rad/m moves such a point by three times the translation.
        doubt = " Is their unit right, and are the places in metres?" if share > 3.0 else ""
        return (
            f"The base's rotation is measured by vertical sensors at {at} m and is an input:"
            f" {moved:.3g} rad/s2 rms, which moves a point {height:g} m up by"
            f" {percent(share)} of what the translation does.{doubt}",
        )
    alone = [
        channel.name for channel in channels if channel.floor == BASE and channel.direction == "z"
    ]
    if not alone:
        return ()
    few = f"{alone[0]} alone does" if len(alone) == 1 else f"{', '.join(alone)} do"
    return (
        f"{few} not tell the base's rotation, which is taken as zero: that takes two vertical"
        " sensors with their places along the motion, such as base@-2.5.z and base@2.5.z.",
    )


def _vertical(channels: Sequence[FloorChannel]) -> tuple[list[int], Floats]:
    """Rows and places of the vertical sensors whose place is known."""
    known = [
        (row, channel.place) for row, channel in enumerate(channels) if channel.place is not None
    ]
    return [row for row, _ in known], np.array([place for _, place in known], dtype=np.float64)


HANN_BANDWIDTH = 1.5
"""Equivalent noise bandwidth of the Hann window times its length (Harris 1978)."""
_OF_FLOORS = (
    "log_frf",
    "noise_sd",
    "valid",
    "phase",
    "coherence",
    "scatter",
    "between",
    "leaking_sd",
)


@dataclass(frozen=True, eq=False)
class Observation:
    """Measured FRFs: absolute acceleration of floors over that of the base, or over a force.

        >>> import femupdate
        >>> how = {"exact": True, "particles": 400}
        >>> found = femupdate.calibrate("house", "run.csv", building="shear_3dof", **how)
        >>> seen = found.posterior.observation
        >>> isinstance(seen, femupdate.Observation), seen.floors
        (True, ('2F', '3F', 'RF'))

    Phases follow H = Y / X of a time dependence exp(+i omega t): a delay tau gives -omega tau.

    Attributes:
        frequency_hz: (m,) increasing: the building's grid, or of a table its own frequencies.
        floors: (f,) bottom to top.
        log_frf: (f, m) ln|H|, of responses to a force in 1/kg; NaN where there is no estimate.
        noise_sd: (f, m) standard deviation of ln|H| (and of the phase, rad); NaN likewise.
        valid: (f, m) whether a point may be used. Untrusted estimates (low
            coherence, no power in the base) are kept for plots and flagged here.
        phase: (f, m) angle of H in (-pi, pi], rad, or None where only |H| was measured.
        coherence: (f, m) ordinary coherence of base and floor, or None.
        resolution_hz: bandwidth over which one estimate averages, or the spacing of a table that
            is coarser than the grid; None where it is not known. See `independent_share`.
        scatter: (f, m) of several runs pooled into one (see `pooled`): sum of their squared
            deviations from what is pooled, each over the noise of its own run; None for one run.
        between: (f, m) variance of ln|H| from run to run beside the noise, below zero where runs
            are more alike than their noise; None for one run.
        leaking_sd: (f, m) like `noise_sd`, with what leaks: where the model errs, it errs in that
            as well; None where it is not known.
        estimator: what the estimate makes of an FRF; None for a table.
        beside: (c - 1, m) complex further columns of the base's motion that go with its unit
            translation, for pictures; None where none was measured. Fits go through the
            estimator, which has all of these motions.
        quantity: of responses to a force what the file holds: receptance, mobility, accelerance.
        level: doublings of the amplitude of motion above that of the first record.
        halves: the data in two parts that err independently; none where they were not parted.
        histories: that the FRFs are an estimate of; None for a table.
    """

    __repr__ = brief

    frequency_hz: Floats
    floors: tuple[str, ...]
    log_frf: Floats
    noise_sd: Floats
    valid: Flags
    phase: Floats | None = None
    coherence: Floats | None = None
    resolution_hz: float | None = None
    source: str = "observation"
    notes: tuple[str, ...] = ()
    scatter: Floats | None = None
    between: Floats | None = None
    leaking_sd: Floats | None = None
    estimator: "Estimator | None" = None
    beside: Complexes | None = None
    excitation: Excitation = BASE_MOTION
    quantity: str = "accelerance"
    level: float = 0.0
    halves: "tuple[Observation, ...]" = ()
    histories: "Histories | None" = None

    @classmethod
    def from_arrays(
        cls,
        frequency_hz: ArrayLike,
        responses: Mapping[str, ArrayLike],
        noise_sd: ArrayLike = DEFAULT_NOISE,
        source: str = "arrays",
    ) -> "Observation":
        """FRFs under base motion, |H| or complex H, which `calibrate` takes as it takes a file.

            >>> import femupdate
            >>> seen = femupdate.Observation.from_arrays([1.0, 1.1, 1.2], {"RF": [1.6, 1.8, 2.1]})
            >>> seen.floors
            ('RF',)

        Args:
            frequency_hz: (m,) increasing.
            responses: (m,) by the name of the floor, 2F, ..., RF.
            noise_sd: standard deviation of ln|H|, one or (f, m).

        Raises:
            MeasurementError: a name is no floor's, lengths differ, or a value is none.
        """
        frequency = np.asarray(frequency_hz, dtype=float)
        unknown = [name for name in responses if parse_channel(name) is None or name == BASE]
        floors = tuple(responses if unknown else sorted(responses, key=floor_height))
        h = [np.asarray(responses[floor], dtype=complex) for floor in floors]
        if unknown or not h or any(row.shape != frequency.shape for row in h):
            wrong = f"{unknown[0]!r} is no floor" if unknown else "the arrays differ in length"
            raise MeasurementError(f"{source}: {wrong}; give 2F, ..., RF, as long as frequency_hz")
        if not ((np.diff(frequency) > 0.0).all() and (np.abs(h) > 0.0).all()):
            raise MeasurementError(
                f"{source}: frequencies must increase, and no |H| be zero; sort, or leave out"
            )
        whole = all(np.iscomplexobj(responses[floor]) for floor in floors)
        return cls(
            frequency_hz=frequency,
            floors=floors,
            log_frf=np.log(np.abs(h)),
            noise_sd=np.broadcast_to(np.asarray(noise_sd, dtype=float), np.shape(h)).copy(),
            valid=np.ones(np.shape(h), dtype=bool),
            phase=np.angle(h).astype(np.float64) if whole else None,
            source=source,
        )

    @classmethod
    def from_accelerations(
        cls,
        time_step: float,
        accelerations: Mapping[str, ArrayLike],
        *,
        unit: str = "m/s2",
        source: str = "arrays",
    ) -> "Observation":
        """Histories of base and floors, whose FRFs `calibrate` estimates on the building's grid.

            >>> import femupdate
            >>> rows = {"base": [0.0, 0.1, 0.0], "RF": [0.0, 0.2, -0.1]}
            >>> femupdate.Observation.from_accelerations(0.01, rows, unit="g").floors
            ('RF',)

        Args:
            time_step: s.
            accelerations: (n,) by names as files have them: base, 2F, ..., RF, 2F:1, RF.y.

        Raises:
            MeasurementError: a name is not known, or the lengths differ.
            UnitError: the unit is no acceleration's.
        """

        channels = {name: parse_channel(name) for name in accelerations}
        unknown = [name for name, channel in channels.items() if channel is None]
        unlike = len({np.size(values) for values in accelerations.values()}) != 1
        if unknown or unlike or not time_step > 0.0:
            wrong = "the arrays differ in length" if unlike else f"the time step is {time_step}"
            wrong = f"{unknown[0]!r} is no channel" if unknown else wrong
            raise MeasurementError(
                f"{source}: {wrong}; give base, 2F, ..., RF, all of one length, and the step in s"
            )
        rows = factor(unit, "acceleration") * np.array([*accelerations.values()], dtype=float)
        known = tuple(channel for channel in channels.values() if channel is not None)
        histories = Histories(time_step, known, rows, source)
        none = np.zeros((len(histories.floors), 0))
        frfs = np.zeros(0), histories.floors, none, none, none > 0.0
        return cls(*frfs, source=source, histories=histories)

    def __post_init__(self) -> None:
        shape = (len(self.floors), self.frequency_hz.size)
        arrays = [getattr(self, name) for name in _OF_FLOORS]
        if any(array is not None and array.shape != shape for array in arrays):
            raise MeasurementError(
                f"{self.source}: every array must be floors by frequencies, {shape}"
            )
        used = self.valid
        finite = np.isfinite(self.log_frf[used]) & np.isfinite(self.noise_sd[used])
        if not (finite.all() and (self.noise_sd[used] > 0).all()):
            raise MeasurementError(
                f"{self.source}: a valid point needs a finite ln|H| and a noise above zero"
            )


def select_floors(observation: Observation, floors: Sequence[str]) -> Observation:
    """Return the observation of some of its floors, in the order asked for.

    Raises:
        MeasurementError: a floor was not observed, is named twice, or none is named.
    """
    unknown = [floor for floor in floors if floor not in observation.floors]
    if unknown or not floors or len(set(floors)) != len(floors):
        asked = ", ".join(floors) or "none"
        raise MeasurementError(
            f"{observation.source}: cannot take floors {asked}; choose among"
            f" {', '.join(observation.floors)}, each once"
        )
    rows = [observation.floors.index(floor) for floor in floors]
    halves = tuple(
        select_floors(half, [floor for floor in floors if floor in half.floors])
        for half in observation.halves
    )
    return replace(_with_rows(observation, floors, lambda values: values[rows]), halves=halves)


def at_frequencies(observation: Observation, used: Flags) -> Observation:
    """The observation at some of its frequencies (m,); its resolution stays what it is."""
    grid, estimator = observation.frequency_hz, observation.estimator
    spacing = float(np.median(np.diff(grid))) if grid.size > 1 else None
    seen = {name: getattr(observation, name) for name in _OF_FLOORS}
    arrays = {name: array[:, used] for name, array in seen.items() if array is not None}
    return replace(
        observation,
        frequency_hz=grid[used],
        **{**arrays, "scatter": None},
        resolution_hz=observation.resolution_hz or spacing,
        estimator=None if estimator is None else estimator.at(used),
        beside=None if observation.beside is None else observation.beside[:, used],
        halves=tuple(at_frequencies(half, used) for half in observation.halves),
    )


def on_all_floors(observation: Observation, floors: Sequence[str]) -> Observation:
    """The same observation with rows of NaN for the floors that were not measured."""
    rows = [list(floors).index(name) for name in observation.floors]

    def spread(values: Any) -> Any:
        missing = False if values.dtype == bool else np.nan
        wide = np.full((len(floors), values.shape[1]), missing, dtype=values.dtype)
        wide[rows] = values
        return wide

    halves = tuple(on_all_floors(half, floors) for half in observation.halves)
    return replace(_with_rows(observation, floors, spread), halves=halves)


def _with_rows(
    observation: Observation, floors: Sequence[str], change: Callable[[Any], Any]
) -> Observation:
    """The observation with other floors, every array of theirs changed alike."""
    arrays = {name: getattr(observation, name) for name in _OF_FLOORS}
    changed = {name: change(array) for name, array in arrays.items() if array is not None}
    return replace(observation, floors=tuple(floors), **changed)


def independent_share(observation: Observation) -> float:
    """Share of the points that err independently of their neighbours."""
    estimated = observation.coherence is not None
    return resolved_share(observation.frequency_hz, observation.resolution_hz, estimated=estimated)


def resolved_share(frequency_hz: Floats, resolution_hz: float | None, *, estimated: bool) -> float:
    """Spacing of a grid (m,) over that of independent points, at most one.

    Args:
        estimated: whether FRFs were estimated from histories, by Hann segments.
    """
    if resolution_hz is None or len(frequency_hz) < 2:
        return 1.0
    # The spectra of Hann segments of length T at frequencies x / T apart are correlated by 1, 2/3,
    # 1/6, 0 at x = 0, 1, 2, 3, as base and noise both are: the errors of H1, their product over a
    # mean power, by the squares of that. A mean over many frequencies, and with it what changes
    # slowly with frequency, is known as from independent points that much times 1 / T apart.
    independent = 1.0 + 2.0 * ((2.0 / 3.0) ** 2 + (1.0 / 6.0) ** 2)
    apart = resolution_hz * (independent / HANN_BANDWIDTH if estimated else 1.0)
    return min(1.0, float(np.median(np.diff(frequency_hz))) / apart)


def require_floors_of_building(
    source: str, floors: Sequence[str], building_floors: Sequence[str]
) -> None:
    """Refuse measurements of another building, recognised by the names of its floors.

    Raises:
        MeasurementError: the building has no floor of a measured name.
    """
    foreign = [floor for floor in floors if floor not in building_floors]
    if foreign:
        raise MeasurementError(
            f"{source}: this is the file of another building: it has floors {', '.join(floors)},"
            f" the building has {', '.join(building_floors)}; give the file that belongs to the"
            f" building, or map the columns of {', '.join(foreign)}"
        )


def band_edges(frequency_hz: Floats) -> Floats:
    """Edges (bands + 1,) Hz, a third of an octave or wider, over the upper part of the grid."""
    bottom, top = float(frequency_hz.min()), float(frequency_hz.max())
    # Floors are compared in ten bands.
    edges = np.geomspace(max(bottom, top / 64.0), top * 1.0001, 10 + 1)
    edges[0] = bottom
    return edges
