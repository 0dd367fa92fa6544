"""Histories of a building's floors, in SI units, and what of them is refused."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.measurement.base_rotation import fault_of
from femupdate.measurement.channel import RecordedChannel, acceleration_unit
from femupdate.measurement.columns import BASE, Channel, ForceChannel, floor_height
from femupdate.measurement.quantity import newtons, si_factor
from femupdate.measurement.record import LARGEST_PEAK
from femupdate.measurement.recording import Recording
from femupdate.measurement.resolve import Motion, placed_channels
from femupdate.measurement.sampling import check_step
from femupdate.measurement.text import TextFile
from femupdate.measurement.thresholds import RECORD
from femupdate.units import STANDARD_GRAVITY, percent

LARGEST_RESPONSE = RECORD.largest_floor * LARGEST_PEAK  # m/s2


@dataclass(frozen=True, eq=False)
class Histories:
    """Accelerations measured at the same times.

    Attributes:
        time_step: s.
        channels: (c,) what each row is.
        acceleration: (c, n) absolute acceleration, m/s2.
        source: where they come from, for messages and reports.
    """

    time_step: float
    channels: tuple[Channel, ...]
    acceleration: Floats
    source: str = "histories"

    @property
    def floors(self) -> tuple[str, ...]:
        """Names of the floors that have a sensor, bottom to top, without the base."""
        names = {channel.floor for channel in self.channels} - {BASE}
        return tuple(sorted(names, key=floor_height))

    def rows(self, floor: str, direction: str) -> list[int]:
        """Rows of the sensors of a floor, or of the base, in one direction."""
        here = floor, direction
        return [k for k, one in enumerate(self.channels) if (one.floor, one.direction) == here]


@dataclass(frozen=True, eq=False)
class ForceHistories:
    """Accelerations of floors under one force.

    Attributes:
        force: floor at which it acts.
        histories: where the base would be stands the force, N.
        notes: for people.
    """

    force: str
    histories: Histories
    notes: tuple[str, ...] = ()


def histories_of(
    file: TextFile, channels: Mapping[Motion, RecordedChannel], unit: str | None = None
) -> Histories | ForceHistories:
    """The histories of a building in channels.

    Args:
        file: that they are of, for messages.
        channels: of the base and floors, or of a force and floors.
        unit: of the accelerations, where the file does not give it.

    Raises:
        MeasurementError: a channel cannot be used; the message names it.
    """
    motions = {ours: one for ours, one in channels.items() if isinstance(ours, Channel)}
    forces = [ours for ours in channels if isinstance(ours, ForceChannel)]
    if forces:
        return _under_force(file, forces, channels, motions, unit)
    _require_base_and_floors(file, tuple(motions))
    _require_same_times(file, motions)
    first = next(iter(motions.values()))
    rows = [_acceleration(file, each, channel, unit) for channel, each in motions.items()]
    return Histories(first.time_step, tuple(motions), np.array(rows), file.path.name)


def motions_in(
    recording: Recording, columns: Mapping[str, str] | None = None
) -> Mapping[Channel, RecordedChannel]:
    """Histories of floors at the same times, of any quantity, with or without the base.

    Args:
        columns: our column name to the file's column or channel.

    Raises:
        MeasurementError: the file holds no histories, their times differ, or a column or cell
            cannot be used; the message names it.
    """
    channels = placed_channels(recording, columns)
    motions = {ours: one for ours, one in channels.items() if isinstance(ours, Channel)}
    _require_same_times(recording.file, motions)
    return motions


def _under_force(
    file: TextFile,
    forces: Sequence[ForceChannel],
    channels: Mapping[Motion, RecordedChannel],
    motions: Mapping[Channel, RecordedChannel],
    unit: str | None,
) -> ForceHistories:
    if len(forces) > 1:
        raise file.error(
            f"forces act at {' and '.join(one.floor for one in forces)}; give the record of each in"
            " a file of its own"
        )
    (force,) = forces
    floors = {ours: one for ours, one in motions.items() if ours.floor != BASE}
    if not floors:
        raise file.error("there is a force but no floor that responds; add columns 2F ... RF")
    excitation = channels[force]
    _require_same_times(file, {force: excitation, **floors})
    pushed = newtons(file, excitation.values, excitation.unit, repr(excitation.name))
    if np.ptp(excitation.values) == 0.0:
        raise file.error(
            f"every value is {excitation.values[0]:g}: the force was not recorded",
            column=repr(excitation.name),
        )
    moved = [_acceleration(file, each, ours, unit) for ours, each in floors.items()]
    names = (Channel(BASE, BASE, direction=force.direction), *floors)
    rows = np.array([pushed, *moved])
    histories = Histories(excitation.time_step, names, rows, file.path.name)
    base = [
        _acceleration(file, each, ours, unit)
        for ours, each in motions.items()
        if ours.floor == BASE and ours.direction == force.direction
    ]
    return ForceHistories(force.floor, histories, _base_beside(force.floor, base, moved))


def _base_beside(forced: str, base: Sequence[Floats], floors: Sequence[Floats]) -> tuple[str, ...]:
    """What is told of motion of the base that was measured beside a force."""
    if not base:
        return ()
    largest, own = (max(float(np.std(one)) for one in rows) for rows in (floors, base))
    share = f" ({percent(own / largest)} of the largest floor's, rms)" if largest > 0.0 else ""
    return (
        f"The base's motion{share} is not used beside the force at {forced}: the force is taken"
        " for all that moves the building.",
    )


def _require_same_times(file: TextFile, channels: Mapping[Any, RecordedChannel]) -> None:
    first = next(iter(channels.values()))
    if first.values.size < RECORD.fewest_of_spectrum:
        raise file.error(
            f"{first.values.size} rows are too short for a spectrum; give at least"
            f" {RECORD.fewest_of_spectrum}"
        )
    check_step(file, first.time_step, repr(first.name))
    for each in channels.values():
        if (each.time_step, each.values.size) != (first.time_step, first.values.size):
            raise file.error(
                f"channel {each.name!r} has {each.values.size} values every {each.time_step:g} s,"
                f" {first.name!r} {first.values.size} every {first.time_step:g} s; bring them to"
                " the same times"
            )


def _require_base_and_floors(file: TextFile, channels: tuple[Channel, ...]) -> None:
    floors = [channel.floor for channel in channels]
    if BASE not in floors:
        raise file.error(
            "there is no column base, and a response is measured against the base; name or map"
            " the base acceleration, or take modes from the floors alone by femupdate identify"
        )
    fault = fault_of(channels)
    if fault is not None:
        raise file.error(fault)
    if all(floor == BASE for floor in floors):
        raise file.error("there is no floor beside the base; add columns 2F ... RF")


def _acceleration(
    file: TextFile, recorded: RecordedChannel, channel: Channel, unit: str | None
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
