"""An observation made ready for the observation encoder: its floors, one band, no gaps."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Flags, Floats
from femupdate.errors import MeasurementError
from femupdate.measurement.observation import Observation
from femupdate.surrogate.network import EARLIEST_END, LATEST_START, Visibility
from femupdate.units import percent


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

    Floors with few usable estimates in the band of most floors are left out. The band that is
    passed on is where all others have them; what is missing inside it is filled by straight lines
    in ln|H|, and the notes say how much.

    Raises:
        MeasurementError: no floor has enough valid points in common with the others.
    """
    usable = _usable(observation)
    used, notes = _choose_floors(observation, floors, usable)
    rows = [observation.floors.index(name) for name in used]
    first, last = _band(_around(usable[rows]).min(axis=0), observation.source)
    points = observation.frequency_hz.size
    log_values = np.zeros((1, len(floors), points))
    mask = np.zeros((1, len(floors)))
    filled = []
    for name, row in zip(used, rows, strict=True):
        column, own = floors.index(name), usable[row]
        mask[0, column] = 1.0
        known = observation.frequency_hz[own], observation.log_frf[row, own]
        log_values[0, column] = np.interp(observation.frequency_hz, *known)
        share = own[first : last + 1].mean()
        if share < 1.0:
            filled.append(f"{name} {100.0 * (1.0 - share):.1f} %")
    if filled:
        notes.append(f"Interpolated parts of the band: {', '.join(filled)}.")
    band = np.array([[first, last]]) / (points - 1)
    if band[0, 0] > LATEST_START or band[0, 1] < EARLIEST_END:
        low, high = observation.frequency_hz[[first, last]]
        notes.append(
            f"The usable band, {low:.3g} to {high:.3g} Hz, is narrower than the surrogate was "
            "trained for; --exact does not mind."
        )
    return EncoderInput(
        torch.from_numpy(log_values).float(),
        Visibility(torch.from_numpy(mask).float(), torch.from_numpy(band).float()),
        tuple(notes),
    )


def _choose_floors(
    observation: Observation, floors: tuple[str, ...], usable: Flags
) -> tuple[list[str], list[str]]:
    """Floors with enough usable points in the band of most floors, and notes on the others."""
    first, last = _band(_around(usable).mean(axis=0), observation.source)
    used, notes = [], []
    for name in (name for name in floors if name in observation.floors):
        share = usable[observation.floors.index(name), first : last + 1].mean()
        if share >= 0.5:
            used.append(name)
        else:
            notes.append(f"Floor {name} is left out: {percent(share)} of its points can be used.")
    if not used:
        raise MeasurementError(
            f"{observation.source}: no floor has enough valid points; use a longer record"
        )
    return used, notes


def _usable(observation: Observation) -> Flags:
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
    uncertain = finite & (noise > 0.0) & (noise <= 0.7) & span
    return np.asarray(observation.valid | uncertain)


def _around(usable: Flags) -> Floats:
    """Share of usable points near every frequency (f, m); zero where no floor is usable at all."""
    width = max(3, usable.shape[1] // 40)
    window = np.ones(width)
    # At the ends of the grid part of the window is missing.
    there = np.convolve(np.ones(usable.shape[1]), window, mode="same")
    near = np.stack([np.convolve(row, window, mode="same") for row in usable]) / there
    return np.where(usable.any(axis=0), near, 0.0)


def _band(share: Floats, source: str) -> tuple[int, int]:
    """First and last frequency around which at least half can be used; stray points do not count."""
    inside = np.flatnonzero(share >= 0.5)
    if not inside.size:
        raise MeasurementError(
            f"{source}: in no band can most floors be used; leave out the worst floors with "
            "--sensors"
        )
    return int(inside[0]), int(inside[-1])
