"""A second record of the same building, at another level of motion."""

from collections.abc import Mapping

import numpy as np

from femupdate.dynamics.level import RunLevels, levels_in_run, motion_level
from femupdate.errors import MeasurementError
from femupdate.measurement.histories import Histories
from femupdate.measurement.names import BASE
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import ObservationSource, direction_of

_SILENT = 1e-300


def level_between(model: StudyModel, first: ObservationSource, second: ObservationSource) -> float:
    """Doublings from the first to the second record's level, over the floors of both.

    Raises:
        MeasurementError: the files of one hold no histories, or the two have no floor in common.
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

    Of several files the first one with histories counts.

    Raises:
        MeasurementError: no file holds histories.
    """
    direction, found = direction_of(model.building), {}
    data = _histories(source, direction)
    for channel, row in zip(data.channels, data.acceleration, strict=True):
        if channel.floor != BASE and channel.direction == direction:
            found[channel.floor] = float(motion_level(row))
    return found


def run_levels(model: StudyModel, source: ObservationSource) -> RunLevels:
    """How the motion along the building's direction is spread about its mean level.

    Raises:
        MeasurementError: no file holds histories of the base.
    """
    direction = direction_of(model.building)
    data = _histories(source, direction)
    base, floors, _ = data.means(direction)
    return levels_in_run(base, floors, data.time_step)


def _histories(source: ObservationSource, direction: str) -> Histories:
    for path in source.paths:
        read = source.read(path, direction)
        if isinstance(read, Histories):
            return read
    raise MeasurementError(
        f"{source.path}: response functions and modes do not say at which level they"
        " were measured; give the histories of both records"
    )
