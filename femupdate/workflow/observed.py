"""Observation files on a building's floors and frequency grid; several runs as one observation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.building.document import Building
from femupdate.building.kinds import require_heights
from femupdate.errors import MeasurementError
from femupdate.measurement.frf import observation_for, with_halves
from femupdate.measurement.modes import IdentifiedModes
from femupdate.measurement.observation import Histories, Observation, select_floors
from femupdate.measurement.reader import AnyKind, base_motion_in, kind_in, read_measured
from femupdate.measurement.recording import Recording
from femupdate.measurement.runs import agreement, pooled
from femupdate.measurement.text import read_head
from femupdate.study import Study, file_hash


@dataclass(frozen=True)
class ObservationSource:
    """Where an observation comes from and how to read it.

    Attributes:
        unit: of the accelerations where the file does not say.
        columns: our column name to the file's.
        sensors: floors to use; all of the file's where empty.
        band_hz: lowest and highest frequency to use, or None for all.
        further: files of other runs, read in the same way, to be explained together.
        force: floor at which a force acts, for responses to it whose columns do not say it.
        mode_error: sd of the model's own ln f beside what is learned, for identified modes.
        files: hash and content of those that were read (see `opened`); others are read whenever
            they are needed.
    """

    path: Path
    unit: str | None = None
    columns: Mapping[str, str] | None = None
    sensors: tuple[str, ...] = ()
    band_hz: tuple[float, float] | None = None
    further: tuple[Path, ...] = ()
    force: str | None = None
    mode_error: float | None = None
    files: Mapping[Path, tuple[str, Recording]] = field(
        default_factory=dict, repr=False, compare=False
    )

    @property
    def paths(self) -> tuple[Path, ...]:
        """All files."""
        return (self.path, *self.further)

    def opened(self) -> "ObservationSource":
        """The source with its files read: all that follows sees them as they are now.

        Raises:
            MeasurementError: a file cannot be read.
        """
        if self.files:
            return self
        files = {}
        for path in self.paths:
            read_head(path)  # says what is wrong with a path that cannot be hashed
            # The hash comes first, so that a file that changes meanwhile counts as changed.
            files[path] = file_hash(path), read_measured(path).without_text()
        return replace(self, files=files)

    def read(self, path: Path, direction: str, **noise: float) -> AnyKind:
        """What one of the files holds, for a direction of the motion.

        Args:
            noise: standard deviation of ln|H| where a table of FRFs gives none.

        Raises:
            MeasurementError: the file cannot be used.
        """
        recording = self._recording(path)
        return kind_in(recording, self.unit, self.columns, direction, self.force, **noise)

    def read_base_motion(self) -> Histories | Observation:
        """Histories or response functions under base motion in the first file.

        Raises:
            MeasurementError: the file cannot be used, or is of another kind.
        """
        return base_motion_in(self._recording(self.path), self.unit, self.columns)

    def asked_of(self, modes: IdentifiedModes, path: Path) -> IdentifiedModes:
        """Identified modes on the floors and in the band that are asked for.

        Raises:
            MeasurementError: no mode lies in the band.
        """
        if self.sensors:
            modes = modes.of_floors([name for name in modes.floors if name in self.sensors])
        if self.band_hz is None:
            return modes
        low, high = self.band_hz
        within = (modes.frequency_hz >= low) & (modes.frequency_hz <= high)
        if not within.any():
            raise MeasurementError(
                f"{path}: no mode lies between {low:g} and {high:g} Hz; widen --band"
            )
        return modes.some(np.flatnonzero(within).tolist())

    def _recording(self, path: Path) -> Recording:
        return self.files[path][1] if path in self.files else read_measured(path)

    def made_from(self) -> dict[str, str]:
        """Hash of every file as it was read, for the record of what is made from them."""
        names = ("observation", *(f"observation {k}" for k in range(2, len(self.paths) + 1)))
        hashes = [
            self.files[path][0] if path in self.files else file_hash(path) for path in self.paths
        ]
        return dict(zip(names, hashes, strict=True))

    def files_as_settings(self) -> dict[str, Any]:
        """The files, and how they are read, as the study's record of settings names them."""
        further = [str(path) for path in self.further] or None
        read = {"further": further, "unit": self.unit, "columns": self.columns and {**self.columns}}
        return {"file": str(self.path), **{k: v for k, v in read.items() if v is not None}}


def as_one(building: Building, runs: Sequence[Observation]) -> Observation:
    """Runs of a building as one observation, whose notes say whether they agree."""
    if len(runs) == 1:
        return runs[0]
    together = f"{len(runs)} runs are explained together: {', '.join(r.source for r in runs)}."
    said = agreement(runs, building.floors)
    notes = [f"{run.source}: {note}" for run in runs for note in run.notes]
    halves = tuple(pooled(runs[number::2], building.floors) for number in (0, 1))
    pool = pooled(runs, building.floors)
    return replace(pool, notes=(f"{together} {said}", *notes), halves=halves)


def runs_of(
    building: Building,
    source: ObservationSource,
    read: Sequence[tuple[Path, Histories | Observation]],
    halves: bool = False,
) -> tuple[Observation, ...]:
    """What files hold of base motion, an observation each, under a name that no other has.

    Args:
        read: what every file holds.
        halves: part every run in two halves.

    Raises:
        MeasurementError: a file cannot be used, belongs to another building, or two are the same.
    """
    grid, direction = building.frequency_grid.frequencies_hz(), direction_of(building)
    runs: Sequence[Observation] = [
        observation_for(building.floors, held, grid, direction, source.sensors) for _, held in read
    ]
    if any(run.estimator is not None and run.estimator.turns for run in runs):
        require_heights(building)
    if halves:
        runs = [with_halves(run, direction) for run in runs]
    if len({run.source for run in runs}) < len(runs):
        runs = [replace(run, source=str(path)) for run, (path, _) in zip(runs, read, strict=True)]
    for run, other in combinations(runs, 2):
        alike = run.floors == other.floors
        if alike and np.array_equal(run.log_frf, other.log_frf, equal_nan=True):
            said = f"{other.source} holds the same measurement as {run.source}"
            said = f"{run.source} is given twice" if run.source == other.source else said
            raise MeasurementError(f"{said}; give every run once, or it counts as if it were two")
    if source.sensors:
        # Bottom to top and each once, however they were named.
        paths = [path for path, _ in read]
        measured = dict.fromkeys(name for run in runs for name in run.floors)
        missing = [name for name in source.sensors if name not in measured]
        if missing:
            have = "the file has" if len(runs) == 1 else "the files have"
            raise MeasurementError(
                f"{', '.join(map(str, paths))}: there is no {', '.join(missing)} to use; {have}"
                f" {', '.join(measured)}"
            )
        wanted = [[name for name in run.floors if name in source.sensors] for run in runs]
        for run, path, floors in zip(runs, paths, wanted, strict=True):
            if not floors:
                raise MeasurementError(
                    f"{path}: it has none of the floors asked for, only {', '.join(run.floors)};"
                    " leave the file out or widen --sensors"
                )
        runs = [select_floors(run, floors) for run, floors in zip(runs, wanted, strict=True)]
    if source.band_hz is not None:
        runs = [_within(run, source.band_hz) for run in runs]
        for run in runs:
            if run.valid.any(axis=0).sum() < 10:
                raise MeasurementError(
                    f"{run.source}: fewer than ten frequencies lie between {source.band_hz[0]:g} "
                    f"and {source.band_hz[1]:g} Hz and can be used; widen --band"
                )
    return tuple(runs)


def _within(observation: Observation, band_hz: tuple[float, float]) -> Observation:
    """The same observation, valid only within a band."""
    low, high = band_hz
    slack = 1e-9  # grids are sums of rounded steps
    frequency = observation.frequency_hz
    inside = (frequency >= low * (1.0 - slack)) & (frequency <= high * (1.0 + slack))
    return replace(
        observation,
        valid=observation.valid & inside,
        log_frf=np.where(inside, observation.log_frf, np.nan),
        noise_sd=np.where(inside, observation.noise_sd, np.nan),
        halves=tuple(_within(half, band_hz) for half in observation.halves),
    )


def check_readable(source: ObservationSource) -> None:
    """Make sure that the files can be used, before anything is built or written.

    Raises:
        MeasurementError: a file cannot be used.
    """
    read = [source.read(path, "x") for path in source.paths]
    if source.force and not any(
        isinstance(each, tuple) and each[0].excitation.force for each in read
    ):
        raise MeasurementError(f"{source.path}: no FRF to a force is in it; leave --force out")


def readable(
    study: Study, reading: Mapping[str, Any], path: Path, *further: Path
) -> ObservationSource:
    """Observation files as a source, read once; a bad one is told before anything is built.

    Args:
        study: which keeps unit and columns of files that it has read before.
        reading: fields of `ObservationSource` that say how to read the files.

    Raises:
        MeasurementError: a file cannot be used.
    """
    asked = {name: value for name, value in reading.items() if value is not None}
    source = ObservationSource(path, further=further, **study.reading_of(path) | asked).opened()
    check_readable(source)
    return source


def direction_of(building: Building) -> str:
    """Direction of a building's measured motion; lumped buildings have one only."""
    sensors = getattr(building, "sensors", None)
    return sensors.direction if sensors is not None else "x"
