"""What a building was observed to do: FRFs on a frequency grid, with their noise."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from femupdate.errors import MeasurementError

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Observation:
    """Measured FRFs, absolute floor acceleration over base acceleration.

    Phases follow H = Y / X of a time dependence exp(+i omega t): a delay tau gives -omega tau.

    Attributes:
        frequency_hz: (m,) the building's grid, increasing.
        floors: (f,) bottom to top.
        log_frf: (f, m) ln|H|; NaN where there is no estimate at all.
        noise_sd: (f, m) standard deviation of ln|H| (and of the phase, rad); NaN likewise.
        valid: (f, m) whether a point may be used. Estimates that are there but not to be trusted
            (low coherence, no power in the base) are kept for plots and flagged here.
        phase: (f, m) angle of H in (-pi, pi], rad, or None where only |H| was measured.
        coherence: (f, m) ordinary coherence of base and floor, or None.
        resolution_hz: bandwidth over which one estimate averages; points closer than this do not
            err independently. None where it is not known.
        source: where it comes from.
        notes: sentences on how it was made and what is missing.
    """

    frequency_hz: Floats
    floors: tuple[str, ...]
    log_frf: Floats
    noise_sd: Floats
    valid: NDArray[np.bool_]
    phase: Floats | None = None
    coherence: Floats | None = None
    resolution_hz: float | None = None
    source: str = "observation"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        shape = (len(self.floors), self.frequency_hz.size)
        arrays = (self.log_frf, self.noise_sd, self.valid, self.phase, self.coherence)
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
    phase, coherence = observation.phase, observation.coherence
    return replace(
        observation,
        floors=tuple(floors),
        log_frf=observation.log_frf[rows],
        noise_sd=observation.noise_sd[rows],
        valid=observation.valid[rows],
        phase=None if phase is None else phase[rows],
        coherence=None if coherence is None else coherence[rows],
    )


def require_floors_of_building(
    source: str, floors: Sequence[str], building_floors: Sequence[str]
) -> None:
    """Refuse the measurements of another building, told by the names of their floors.

    Raises:
        MeasurementError: a measured floor is none of the building's.
    """
    foreign = [floor for floor in floors if floor not in building_floors]
    if foreign:
        raise MeasurementError(
            f"{source}: this is the file of another building: it has floors {', '.join(floors)},"
            f" the building has {', '.join(building_floors)}; give the file that belongs to the"
            f" building, or map the columns of {', '.join(foreign)}"
        )
