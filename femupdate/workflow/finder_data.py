"""What was measured of a building, of any kind, as the effect finder judges it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from femupdate.arrays import Flags, Floats
from femupdate.building.schema import Building
from femupdate.discrepancy.data import Data
from femupdate.discrepancy.frf_data import (
    FloorForce,
    FrfData,
    frf_data,
    in_alternate_points,
    together,
)
from femupdate.discrepancy.mesh_error import MeshError
from femupdate.discrepancy.mode_data import mode_data
from femupdate.discrepancy.thresholds import LEVEL, MODEL_ERROR
from femupdate.dynamics.force_response import rest_about
from femupdate.dynamics.reduced import ReducedModel
from femupdate.effects.structure import Structure
from femupdate.measurement.force_frf import ForcedObservation
from femupdate.measurement.observation import Observation
from femupdate.progress import Progress
from femupdate.study import Study
from femupdate.workflow.kinds import Measured, measured_of, with_rest
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import ObservationSource, halves_of
from femupdate.workflow.second_record import SecondRecord, level_between

_PARTED = 20  # points of a table, from which every other one is a half of its own


@dataclass(frozen=True, eq=False)
class Given:
    """What a model is to explain.

    Attributes:
        measured: as read.
        halves: of the FRFs under base motion, where they can be parted.
        second: histories at another level, under base motion or a force.
        level: of those above the first ones, in doublings; zero where they are alike.
    """

    measured: Measured
    halves: tuple[Observation, ...] = ()
    second: "Given | None" = None
    level: float = 0.0

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on how it was read."""
        if self.second is None:
            return self.measured.notes_of_others
        own, other = self.measured.notes_of_others, self.second.measured.notes_of_others
        return (*self._on_level(), *own, *other)

    def data(
        self, model: StudyModel, mesh: MeshError | None, use_phase: bool = True
    ) -> tuple[Data, ...]:
        """The same as the finder judges it, one entry a kind.

        Args:
            model: of the study.
            mesh: error of the mesh, where it is known.
            use_phase: compare phases where they were measured.

        Raises:
            InferenceError: more modes are identified than the model has.
        """
        modes = [mode_data(one, model.system, self.measured.errors) for one in self.measured.modes]
        return (*self._frfs(model, mesh, use_phase), *modes)

    def _frfs(
        self, model: StudyModel, mesh: MeshError | None, use_phase: bool
    ) -> Iterator[FrfData]:
        """Under base motion, all records as one; then under forces."""
        measured, building, second = self.measured, model.building, self.second
        others = []
        if second is not None and second.measured.has_base:
            others = [SecondRecord(second.measured.base, self.level, second.halves)]
        if measured.has_base:
            yield base_data(building, mesh, measured.base, use_phase, self.halves, others)
        elif second is not None and others:
            alone = base_data(building, mesh, second.measured.base, use_phase, second.halves)
            yield alone.at_level(self.level)
        error = _model_error(building, mesh)
        for given, level in ((self, 0.0), (second, self.level)):
            for one in () if given is None else given.measured.forced:
                force = FloorForce(one.force, measured.rest)
                own = force_data(one, force, building.floors, error, use_phase)
                yield own.at_level(level)

    def _on_level(self) -> Iterator[str]:
        """How strong the second record is, and what is taken to be as strong as the first."""
        if self.level == 0.0:
            yield "Both records have the same level: they are explained by one stiffness."
            return
        yield f"The second record has {2.0**self.level:.2g} times the level of the first."
        if self.measured.modes:
            yield "The identified modes are taken to be those at the level of the first record."


def read_given(
    study: Study,
    model: StudyModel,
    source: ObservationSource,
    second: ObservationSource | None,
    progress: Progress,
) -> Given:
    """Read what is to be explained, of any kind.

    Raises:
        MeasurementError: a file cannot be used, or that at another level says no level.
    """
    first = _given(model.building, source)
    if second is None:
        return replace(first, measured=with_rest(study, model, first.measured, progress))
    other = _given(model.building, second)
    level = level_between(model, source, second)
    measured, further = (with_rest(study, model, one.measured, progress) for one in (first, other))
    rest = measured.rest or further.rest
    return replace(
        first,
        measured=replace(measured, rest=rest),
        second=replace(other, measured=further),
        level=0.0 if abs(level) < LEVEL.alike else level,
    )


def read_held(
    study: Study, model: StudyModel, source: ObservationSource, progress: Progress
) -> Given:
    """Read data that are only predicted, of any kind.

    Raises:
        MeasurementError: a file cannot be used.
    """
    return Given(with_rest(study, model, measured_of(model.building, source), progress))


def _given(building: Building, source: ObservationSource) -> Given:
    """The files of one source, with halves of their FRFs under base motion."""
    measured = measured_of(building, source)
    return Given(measured, _halves(building, source, measured.base_paths))


def _halves(
    building: Building, source: ObservationSource, base: tuple[Path, ...]
) -> tuple[Observation, ...]:
    """Of the FRFs under base motion, where there are any and they can be parted."""
    if not base:
        return ()
    return halves_of(building, replace(source, path=base[0], further=base[1:]))


def force_data(
    forced: ForcedObservation,
    force: FloorForce,
    floors: tuple[str, ...],
    model_error: float,
    use_phase: bool = True,
) -> FrfData:
    """Responses to a force; the points of a table err independently, so every other is a half.

    Args:
        forced: as read.
        force: that acts.
        floors: of the model.
        model_error: of ln|H|, as noise of independent points.
        use_phase: compare phases where they were measured.
    """

    def read(one: Observation, parts: Sequence[Observation]) -> FrfData:
        return frf_data(
            one,
            floors,
            excitation=force,
            use_phase=use_phase,
            model_error=model_error,
            halves=tuple(read(part, ()) for part in parts),
        )

    own = read(forced.observation, forced.halves)
    table = forced.observation.coherence is None
    return in_alternate_points(own) if table and own.points >= _PARTED else own


def with_rest_about(
    data: Sequence[Data], structure: Structure, reduced: ReducedModel, theta: Floats
) -> tuple[Data, ...]:
    """The data with what a basis about theta (p,) lacks under forces; that of a stick nothing."""
    forced = any(isinstance(one, FrfData) and one.forced for one in data)
    if structure.operators is None or not forced:
        return tuple(data)
    rest = rest_about(structure, reduced, theta)
    return tuple(one.with_rest(rest) if isinstance(one, FrfData) else one for one in data)


def base_data(
    building: Building,
    mesh: MeshError | None,
    observation: Observation,
    use_phase: bool = True,
    halves: Sequence[Observation] = (),
    others: Sequence[SecondRecord] = (),
) -> FrfData:
    """FRFs under base motion, from the first to the last frequency at which any is valid.

    Args:
        building: as its file says.
        mesh: error of the mesh, where it is known.
        observation: on the building's grid.
        use_phase: compare phases where they were measured.
        halves: of the observation, where it can be parted.
        others: further records, at other levels.
    """

    def read(one: Observation, parts: Sequence[Observation]) -> FrfData:
        return frf_data(
            _at(one, _used(one)),
            building.floors,
            use_phase=use_phase,
            model_error=_model_error(building, mesh),
            halves=tuple(read(part, ()) for part in parts),
        )

    data = read(observation, halves)
    for other in others:
        data = together(data, read(other.observation, other.halves), other.level)
    return data


def _model_error(building: Building, mesh: MeshError | None) -> float:
    """What mesh and reduction leave in ln|H|, as noise of independent points."""
    return MODEL_ERROR.frame if building.kind != "shear" and mesh is None else MODEL_ERROR.stick


def _used(observation: Observation) -> Flags:
    """The frequencies that say something, and those between them."""
    seen = np.flatnonzero(observation.valid.any(axis=0))
    used = np.zeros(observation.frequency_hz.size, dtype=bool)
    used[seen[0] : seen[-1] + 1] = True
    return used & _measured(observation)


def _measured(observation: Observation) -> Flags:
    """Where a table coarser than the grid has its points: straight lines between are no data."""
    frequency = observation.frequency_hz
    spacing = float(np.median(np.diff(frequency)))
    coarse = observation.resolution_hz or spacing
    if observation.coherence is not None or coarse < 1.5 * spacing:
        return np.ones(frequency.size, dtype=bool)
    distance = np.abs(frequency / coarse - np.round(frequency / coarse)) * coarse
    return np.asarray(distance < 0.5 * spacing * (1.0 + 1e-9))


def _at(observation: Observation, used: Flags) -> Observation:
    """The observation at some of its frequencies; its resolution stays what it is."""
    spacing = float(np.median(np.diff(observation.frequency_hz)))
    own = observation.estimator
    return replace(
        observation,
        frequency_hz=observation.frequency_hz[used],
        log_frf=observation.log_frf[:, used],
        noise_sd=observation.noise_sd[:, used],
        valid=observation.valid[:, used],
        phase=None if observation.phase is None else observation.phase[:, used],
        coherence=None if observation.coherence is None else observation.coherence[:, used],
        scatter=None,
        resolution_hz=observation.resolution_hz or spacing,
        estimator=None if own is None else own.at(used),
    )


__all__ = ["Given", "base_data", "force_data", "read_given", "read_held"]
