"""An observation made ready for the observation encoder: its floors, one band, no gaps."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from femupdate.errors import MeasurementError
from femupdate.measurement.observation import Observation
from femupdate.surrogate.network import Visibility

Floats = NDArray[np.float64]

# A floor with less of the observed band than this is left to the data-space likelihood.
_LEAST_SHARE = 0.5


@dataclass(frozen=True)
class EncoderInput:
    """An observation as the observation encoder takes it.

    Attributes:
        log_frf: (1, f, k) ln|H| of all floors of the surrogate; zero where nothing is observed.
        visibility: which floors, and the band that they have in common.
        notes: what was filled or left out, in sentences.
    """

    log_frf: Tensor
    visibility: Visibility
    notes: tuple[str, ...]


def encoder_input(observation: Observation, floors: tuple[str, ...]) -> EncoderInput:
    """Bring an observation to the surrogate's floors, one band and no gaps.

    Floors with too few valid points are left out. The band reaches from the first to the last
    frequency at which all others are valid; gaps inside it are filled by straight lines in ln|H|,
    and the notes say how much.

    Raises:
        MeasurementError: no floor has a valid point, or at no frequency are all floors valid.
    """
    used, notes = _usable_floors(observation, floors)
    rows = [observation.floors.index(name) for name in used]
    common = np.flatnonzero(observation.valid[rows].all(axis=0))
    if not common.size:
        raise MeasurementError(
            f"{observation.source}: at no frequency are all floors valid; leave out the worst "
            "floor with --sensors"
        )
    first, last = common[[0, -1]]
    points = observation.frequency_hz.size
    log_values = np.zeros((1, len(floors), points))
    mask = np.zeros((1, len(floors)))
    for name, row in zip(used, rows, strict=True):
        column = floors.index(name)
        mask[0, column] = 1.0
        log_values[0, column] = _filled(observation, row)
        missing = 1.0 - observation.valid[row, first : last + 1].mean()
        if missing > 0.0:
            notes.append(f"Floor {name}: {missing:.1%} of the band is interpolated.")
    band = np.array([[first, last]]) / (points - 1)
    return EncoderInput(
        torch.from_numpy(log_values).float(),
        Visibility(torch.from_numpy(mask).float(), torch.from_numpy(band).float()),
        tuple(notes),
    )


def _usable_floors(
    observation: Observation, floors: tuple[str, ...]
) -> tuple[list[str], list[str]]:
    """Observed floors of the surrogate with enough valid points, and notes on the others.

    What is enough is judged over the band that the best of them cover: one bad sensor shall not
    narrow the band of all.
    """
    known = [name for name in floors if name in observation.floors]
    valid = {name: observation.valid[observation.floors.index(name)] for name in known}
    most = max((int(row.sum()) for row in valid.values()), default=0)
    if not most:
        raise MeasurementError(
            f"{observation.source}: no floor has a valid point; use a longer or a stronger record"
        )
    shares = {name: row.sum() / most for name, row in valid.items()}
    notes = [
        f"Floor {name} is left out: it has {share:.0%} of the valid points of the best floor."
        for name, share in shares.items()
        if share < _LEAST_SHARE
    ]
    return [name for name in known if shares[name] >= _LEAST_SHARE], notes


def _filled(observation: Observation, row: int) -> Floats:
    """ln|H| of one floor at all frequencies, straight lines across what is not valid."""
    valid = observation.valid[row]
    frequency = observation.frequency_hz
    return np.interp(frequency, frequency[valid], observation.log_frf[row, valid])
