"""Ground-motion records: any of the known formats to one acceleration history in m/s2."""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from femupdate.arrays import Floats
from femupdate.errors import MeasurementError, brief
from femupdate.measurement.clock import check_step, rate_ratio, resampled
from femupdate.measurement.names import BASE, FloorChannel, parse_channel, plain_unit
from femupdate.measurement.observation import (
    LARGEST_G,
    LARGEST_PEAK,
    SMALLEST_G,
    SMALLEST_PEAK,
    fault_of,
    other_horizontal,
    rotation_of,
)
from femupdate.measurement.reader import read_measured
from femupdate.measurement.recording import (
    RecordedChannel,
    acceleration_unit,
    channel_listing,
    in_m_s2,
)
from femupdate.measurement.resolve import given_channels, positions, require_horizontal
from femupdate.measurement.text import TextFile
from femupdate.units import STANDARD_GRAVITY
from femupdate.units import factor as unit_factor

logger = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class GroundMotion:
    """One component of ground acceleration, sampled uniformly from time 0.

        >>> import femupdate
        >>> motion = femupdate.GroundMotion([0.0, 0.3, -0.5, 0.1], time_step=0.01)
        >>> motion.scaled(0.1).peak
        0.05

    Attributes:
        acceleration: (n,) m/s2.
        time_step: s.
        name: of the record, the file's name without its ending.
        rotation: (n,) of the base, rad/s2, that leans a building forward; None where it was not
            measured.
        scale: by which the values of the file were multiplied.
        across: (n,) of the base across, m/s2; None where it was not measured.
    """

    __repr__ = brief

    acceleration: Floats
    time_step: float
    name: str = "motion"
    channel: str = ""
    rotation: Floats | None = None
    scale: float = 1.0
    across: Floats | None = None

    @classmethod
    def from_arrays(
        cls, acceleration: ArrayLike, time_step: float, *, unit: str = "m/s2", name: str = "motion"
    ) -> "GroundMotion":
        """A motion (n,) in any unit, which `predict` takes as it takes a file.

            >>> femupdate.GroundMotion.from_arrays([0.0, 0.1, -0.2], 0.01, unit="g").peak
            1.96133

        Raises:
            MeasurementError: the values are not one row of numbers.
            UnitError: the unit is no acceleration's.
        """
        values = np.asarray(acceleration, dtype=float)
        return cls(values * unit_factor(unit, "acceleration"), time_step, name)

    def __post_init__(self) -> None:
        values = np.asarray(self.acceleration, dtype=np.float64)
        object.__setattr__(self, "acceleration", values)
        if values.ndim != 1 or values.size < 2 or not np.isfinite(values).all():
            raise MeasurementError(
                f"ground motion {self.name}: the acceleration must be one row of at least two"
                " finite numbers"
            )
        if not (np.isfinite(self.time_step) and self.time_step > 0):
            raise MeasurementError(
                f"ground motion {self.name}: the time step is {self.time_step}; give seconds"
                " above zero"
            )

    @property
    def inputs(self) -> Floats:
        """(c, n) translation, m/s2, rotation, rad/s2, and motion across, m/s2, zero if unknown.

        As many rows as the last that is known.
        """
        rows = [self.acceleration, self.rotation, self.across]
        count = 1 + max(number for number, row in enumerate(rows) if row is not None)
        still = np.zeros_like(self.acceleration)
        return np.stack([still if row is None else row for row in rows[:count]])

    def _changed(self, change: Callable[[Floats], Floats], **others: Any) -> "GroundMotion":
        """The same with all of its rows changed alike."""
        rotation, across = (
            None if row is None else change(row) for row in (self.rotation, self.across)
        )
        moved = change(self.acceleration)
        return replace(self, acceleration=moved, rotation=rotation, across=across, **others)

    @property
    def title(self) -> str:
        """For people: name, channel and scale, such as "kobe NS, scaled by 0.5"."""
        name = f"{self.name} {self.channel}".rstrip()
        return name if self.scale == 1.0 else f"{name}, scaled by {self.scale:g}"

    @property
    def time(self) -> Floats:
        """(n,) time of each sample, s."""
        return np.arange(self.acceleration.size, dtype=np.float64) * self.time_step

    @property
    def duration(self) -> float:
        """Time from the first sample to the last, s."""
        return (self.acceleration.size - 1) * self.time_step

    @property
    def peak(self) -> float:
        """Largest absolute acceleration, m/s2."""
        return float(np.abs(self.acceleration).max())

    def scaled(self, factor: float) -> "GroundMotion":
        """Return the motion times a factor; a negative one turns its direction round."""
        if not (np.isfinite(factor) and factor):
            raise MeasurementError(f"ground motion {self.name}: cannot be scaled by {factor:g}")
        # No shaking table reaches 100 g.
        if self.peak * abs(factor) > 100.0 * STANDARD_GRAVITY:
            raise MeasurementError(
                f"ground motion {self.name}: times {factor:g} it peaks at "
                f"{self.peak * abs(factor) / STANDARD_GRAVITY:.3g} g, which no shaking table"
                " reaches; give a smaller factor"
            )
        return self._changed(lambda row: row * factor, scale=self.scale * factor)

    def require_frequency(self, lowest_hz: float) -> None:
        """Refuse samples too far apart to show the lowest frequency of a building."""
        if self.time_step * lowest_hz > 0.5:
            raise MeasurementError(
                f"ground motion {self.name}: a value every {self.time_step:g} s shows no motion at "
                f"{lowest_hz:.3g} Hz, the building's lowest frequency; is the time's unit wrong? "
                "Times in ms have the name time_s (ms)"
            )

    def resampled(self, time_step: float) -> "GroundMotion":
        """Return the motion at another time step (s), band-limited to the lower Nyquist frequency.

        Flat within 0.1 % up to 0.9 of the lower Nyquist frequency, without delay; see
        `clock.resampled`.

        Raises:
            MeasurementError: the two steps are in no ratio of whole numbers up to 1000.
        """
        if time_step == self.time_step:
            return self
        ratio = rate_ratio(self.time_step, time_step, self.acceleration.size)
        if ratio is None:
            raise MeasurementError(
                f"ground motion {self.name}: cannot be resampled from {self.time_step:g} s to"
                f" {time_step:g} s; take a step in a ratio of whole numbers up to 1000"
            )
        return self._changed(lambda row: resampled(row, ratio), time_step=float(time_step))


def read_record(
    path: str | Path,
    unit: str | None = None,
    channel: str | int | None = None,
    columns: Mapping[str, str] | None = None,
    direction: str = "",
) -> GroundMotion:
    """Read one channel of a ground-motion record.

    With the base's own channel come its vertical ones at places along the motion, which measure
    how it turns, and that of its motion across.

    Args:
        unit: of the accelerations, where the file does not say it.
        channel: its name in the file or in `columns`, or its number from 1; needed where there
            are several and none, or more than one, is called base.
        columns: our name, such as base or base@2.5.z, to the file's name or number of a channel.
        direction: x or y, of the base's own channel, where it has both.

    Raises:
        MeasurementError: the file cannot be read as a record, the channel is not in it, or its
            peak is one that no earthquake has, which tells of a wrong unit.
    """
    recording = read_measured(path)
    file, channels = recording.file, recording.histories(columns)
    if not channels:
        raise file.error("there are no histories in the file; give the record of the ground")
    asked = str(channel)
    told = {k: v for k, v in (columns or {}).items() if k.lower().startswith(BASE) or k == asked}
    named = {parse_channel(channel.name): channel for channel in channels}
    given = named | given_channels(file, channels, told, unit)
    base = {
        ours: channel
        for ours, channel in given.items()
        if isinstance(ours, FloorChannel) and ours.floor == BASE
    }
    mapped = given.get(parse_channel(asked)) if asked in told else None
    chosen = mapped or _choose(file, channels, channel, unit, base, direction)
    require_horizontal(file, chosen)
    for words in chosen.done:
        logger.warning("%s: %s", file.path, words)
    rotation, across = _beside(file, chosen, base, unit)
    motion = GroundMotion(
        acceleration=in_m_s2(file, chosen, unit),
        time_step=chosen.time_step,
        name=file.path.stem,
        channel=chosen.name,
        rotation=rotation,
        across=across,
    )
    where = repr(motion.channel)
    check_step(file, motion.time_step, where)
    # Ten samples of the ground are the least.
    if motion.acceleration.size < 10:
        raise file.error(
            f"{motion.acceleration.size} values are no record; give the whole time history",
            column=where,
        )
    swing = float(np.abs(motion.acceleration - motion.acceleration.mean()).max())
    if np.ptp(motion.acceleration) == 0.0:
        raise file.error(
            "every value is the same: the channel was dead; choose another", column=where
        )
    if max(motion.peak, swing) > LARGEST_PEAK or swing < SMALLEST_PEAK:
        peak = motion.peak if motion.peak > LARGEST_PEAK else swing
        raise file.error(
            f"the peak is {peak / STANDARD_GRAVITY:.3g} g when the values are read in"
            f" {plain_unit(acceleration_unit(file, chosen, unit)).lower()}, which no strong-motion"
            f" record has ({SMALLEST_G:g} to {LARGEST_G:g} g); is the unit wrong?",
            column=where,
        )
    if offset := float((motion.acceleration - without_offset(motion.acceleration))[0]):
        words = "%s, channel %s: the mean is %.3g m/s2, an offset, which predictions take off"
        logger.warning(words, file.path, motion.channel, offset)
    return motion


def without_offset(values: Floats) -> Floats:
    """A history (n,) less its mean, where that is an offset: above 5 % of the largest swing."""
    mean = values.mean()
    return values - mean if abs(mean) > 0.05 * np.abs(values - mean).max() else values


def _beside(
    file: TextFile,
    chosen: RecordedChannel,
    base: Mapping[FloorChannel, RecordedChannel],
    unit: str | None,
) -> tuple[Floats | None, Floats | None]:
    """How the base turns (n,), rad/s2, and moves across (n,), m/s2.

    None where its own channel was not chosen, or no others tell.
    """
    along = [ours.direction for ours, channel in base.items() if channel is chosen]
    aside = other_horizontal(along[0]) if along else ""
    used = {
        to: row
        for to, row in base.items()
        if along and (to.place is not None or to.direction == aside)
    }
    for channel in used.values():
        if (channel.time_step, channel.values.size) != (chosen.time_step, chosen.values.size):
            raise file.error(
                "it has other times than the base's own channel; cut both to the same times",
                column=repr(channel.name),
            )
    fault = fault_of(tuple(used))
    if fault is not None:
        raise file.error(fault)
    rows = np.array([in_m_s2(file, channel, unit) for channel in used.values()])
    across = [row for to, row in zip(used, rows, strict=True) if to.direction == aside]
    moved = np.mean(across, axis=0) if across else None
    return rotation_of(tuple(used), rows), moved


def _choose(
    file: TextFile,
    channels: Sequence[RecordedChannel],
    asked: str | int | None,
    unit: str | None,
    base: Mapping[FloorChannel, RecordedChannel],
    direction: str,
) -> RecordedChannel:
    if asked is not None:
        names, listing = [c.name for c in channels], channel_listing(file, channels, unit)
        at = positions(file, "channel", names, {"the record": str(asked)}, listing)
        chosen = channels[at["the record"]]
        return next((known for known in base.values() if known.name == chosen.name), chosen)
    if len(channels) == 1:
        return channels[0]
    for wanted in ((direction,), ("x", "y")):
        along = [known for ours, known in base.items() if ours.direction in wanted]
        if len(along) == 1:
            return along[0]
    raise file.error(
        f"the record has {len(channels)} channels; choose one by name or number:"
        f" {channel_listing(file, channels, unit)}"
    )
