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
# The encoder takes an estimate this uncertain rather than a straight line across its place.
_WORST_NOISE = 0.7


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

    The band is where, as a rule, all observed floors have usable estimates; what is missing inside
    is filled by straight lines in ln|H|, and the notes say how much.

    Raises:
        MeasurementError: no floor has enough valid points in common with the others.
    """
    rows = {name: row for row, name in enumerate(observation.floors)}
    usable = _usable(observation)
    first, last = _common_band(observation, usable)
    points = observation.frequency_hz.size
    log_values = np.zeros((1, len(floors), points))
    mask = np.zeros((1, len(floors)))
    notes = []
    for column, floor in enumerate(floors):
        if floor not in rows:
            continue
        own = usable[rows[floor]]
        share = own[first : last + 1].mean()
        if share < _LEAST_SHARE:
            notes.append(f"Floor {floor} is left out: {share:.0%} of its points can be used.")
            continue
        mask[0, column] = 1.0
        known = observation.frequency_hz[own], observation.log_frf[rows[floor], own]
        log_values[0, column] = np.interp(observation.frequency_hz, *known)
        if share < 1.0:
            notes.append(f"Floor {floor}: {1 - share:.1%} of the band is interpolated.")
    if not mask.any():
        raise MeasurementError(
            f"{observation.source}: no floor has enough valid points; use a longer record"
        )
    band = np.array([[first, last]]) / (points - 1)
    return EncoderInput(
        torch.from_numpy(log_values).float(),
        Visibility(torch.from_numpy(mask).float(), torch.from_numpy(band).float()),
        tuple(notes),
    )


def _usable(observation: Observation) -> NDArray[np.bool_]:
    """Points (f, m) that the encoder may see: valid, or uncertain but better than a guess."""
    if not observation.valid.any():
        raise MeasurementError(
            f"{observation.source}: no floor has enough valid points; use a longer record"
        )
    finite = np.isfinite(observation.log_frf) & np.isfinite(observation.noise_sd)
    noise = np.where(finite, observation.noise_sd, np.inf)
    low, high = np.flatnonzero(observation.valid.any(axis=0))[[0, -1]]
    span = np.zeros(observation.frequency_hz.size, dtype=bool)
    span[low : high + 1] = True
    return np.asarray(observation.valid | (finite & (noise <= _WORST_NOISE) & span))


def _common_band(observation: Observation, usable: NDArray[np.bool_]) -> tuple[int, int]:
    """First and last frequency around which most floors are usable; stray points do not count."""
    share = usable.mean(axis=0)
    width = max(3, observation.frequency_hz.size // 40)
    window = np.ones(width) / width
    # At the ends of the grid part of the window is missing.
    around = np.convolve(share, window, mode="same") / np.convolve(
        np.ones_like(share), window, mode="same"
    )
    inside = np.flatnonzero((around >= 0.5) & (share > 0.0))
    if not inside.size:
        raise MeasurementError(
            f"{observation.source}: in no band can most floors be used; leave out the worst floors "
            "with --sensors"
        )
    return int(inside[0]), int(inside[-1])
