"""Histories of a building's floors, in SI units, and what of them is refused.

Of the base's own rotation, vertical sensors tell that stand at places along the motion. A base that
turns by a small angle, so that what stands on it leans forward, goes down in front: at the place s
along the motion its vertical acceleration is that of its middle less s times the angular
acceleration. Of more than two sensors the slope is the least-squares one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats
from femupdate.dynamics.excitation import Excitation
from femupdate.errors import MeasurementError, brief
from femupdate.measurement.clock import check_step
from femupdate.measurement.names import BASE, FloorChannel, floor_height
from femupdate.measurement.quantity import newtons, si_factor
from femupdate.measurement.recording import RecordedChannel, Recording, acceleration_unit, in_step
from femupdate.measurement.resolve import placed_channels
from femupdate.measurement.text import TextFile
from femupdate.measurement.thresholds import RECORD
from femupdate.units import STANDARD_GRAVITY, percent

# m/s2.
LARGEST_PEAK = RECORD.largest_g * STANDARD_GRAVITY
SMALLEST_PEAK = RECORD.smallest_g * STANDARD_GRAVITY
# A floor feels forty times the largest peak of the ground; beyond it is a spike or a wrong unit.
LARGEST_RESPONSE = 40.0 * LARGEST_PEAK


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

    @property
    def floors(self) -> tuple[str, ...]:
        """Names of the floors that have a sensor, bottom to top, without the base."""
        names = {channel.floor for channel in self.channels} - {BASE}
        return tuple(sorted(names, key=floor_height))

    @property
    def rotation(self) -> Floats | None:
        """Angular acceleration (n,) of the base, see `rotation_of`."""
        return rotation_of(self.channels, self.acceleration)

    @property
    def excitation(self) -> Excitation:
        """What drives the building."""
        return Excitation(self.force, self.rotation is not None)

    def rows(self, floor: str, direction: str) -> list[int]:
        """Rows of the sensors of a floor, or of the base, in one direction."""
        here = floor, direction
        return [
            k
            for k, channel in enumerate(self.channels)
            if (channel.floor, channel.direction) == here
        ]

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
    if first.values.size < RECORD.fewest_of_spectrum:
        raise file.error(
            f"{first.values.size} rows are too short for a spectrum; give at least"
            f" {RECORD.fewest_of_spectrum}"
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
            f" strong-motion record has (up to {RECORD.largest_g:g} g); is the unit wrong?",
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


def rotation_of(channels: Sequence[FloorChannel], acceleration: Floats) -> Floats | None:
    """Angular acceleration (n,) of the base, rad/s2, forward positive, without its mean.

    Args:
        channels: c of them, all that were recorded.
        acceleration: (c, n) m/s2.

    Returns:
        None where fewer than two vertical sensors stand at known places of the base.
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
