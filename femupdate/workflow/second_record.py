"""A second record of the same building, at another level of motion."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from femupdate.discrepancy.thresholds import LEVEL
from femupdate.dynamics.level import motion_level
from femupdate.errors import MeasurementError
from femupdate.measurement.columns import BASE
from femupdate.measurement.observation import Observation
from femupdate.measurement.observation_file import Histories, read_observation_file
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import (
    ObservationSource,
    halves_of,
    observation_of,
    observed_direction,
)

_SILENT = 1e-300


@dataclass(frozen=True, eq=False)
class SecondRecord:
    """What another record shows.

    Attributes:
        observation: its FRFs.
        level: of its motion above the first record's, in doublings; zero where they are alike.
        halves: of it, where it can be parted.
    """

    observation: Observation
    level: float
    halves: tuple[Observation, ...] = ()

    @property
    def note(self) -> str:
        """One sentence for the user."""
        if self.level == 0.0:
            return "Both records have the same level: they are explained by one stiffness."
        return f"The second record has {2.0**self.level:.2g} times the level of the first."


def second_record(
    model: StudyModel, first: ObservationSource, second: ObservationSource
) -> SecondRecord:
    """Read another record and compare its level with the first one's.

    Raises:
        MeasurementError: it cannot be used, or a file holds FRFs, which know no level.
    """
    observation = observation_of(model.building, second)
    level = level_between(model, first, second)
    halves = halves_of(model.building, second)
    return SecondRecord(observation, 0.0 if abs(level) < LEVEL.alike else level, halves)


def level_between(model: StudyModel, first: ObservationSource, second: ObservationSource) -> float:
    """Doublings from the first to the second record's level, over the floors of both.

    Raises:
        MeasurementError: a file holds FRFs, or the files have no floor in common.
    """
    both = [record_levels(model, source) for source in (first, second)]
    if not set(both[0]) & set(both[1]):
        raise MeasurementError(
            f"{second.path}: it has no floor in common with {first.path}, so that their levels "
            "cannot be compared"
        )
    return doublings(both[0], both[1])


def doublings(first: Mapping[str, float], second: Mapping[str, float]) -> float:
    """Doublings from the first to the second level (m/s2 by floor), the median over the floors."""
    common = sorted(set(first) & set(second))
    ratio = [max(second[floor], _SILENT) / max(first[floor], _SILENT) for floor in common]
    return float(np.log2(np.median(ratio)))


def record_levels(model: StudyModel, source: ObservationSource) -> dict[str, float]:
    """Level (m/s2) of every floor's acceleration along the motion (see `motion_level`).

    Raises:
        MeasurementError: the file holds FRFs.
    """
    data = read_observation_file(source.path, source.unit, source.columns)
    if not isinstance(data, Histories):
        raise MeasurementError(
            f"{source.path}: a table of FRFs does not say at which level it was measured; give the "
            "histories of both records"
        )
    direction, found = observed_direction(model), {}
    for channel, row in zip(data.channels, data.acceleration, strict=True):
        if channel.floor != BASE and channel.direction == direction:
            found[channel.floor] = float(motion_level(row))
    return found
