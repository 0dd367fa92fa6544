"""What was measured of a building, of any kind, as the effect finder judges it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from femupdate.building.document import Building
from femupdate.discrepancy.mesh_error import MeshError
from femupdate.discrepancy.records import SecondRecord, base_data, force_data, model_error
from femupdate.discrepancy.thresholds import LEVEL
from femupdate.inference.data import Data
from femupdate.inference.frf_data import FloorForce, FrfData
from femupdate.inference.mode_data import mode_data
from femupdate.measurement.observation import Observation
from femupdate.progress import Progress
from femupdate.study import Study
from femupdate.workflow.kinds import Measured, measured_of, with_rest
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import ObservationSource
from femupdate.workflow.second_record import level_between


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
        error = model_error(building, mesh)
        for given, level in ((self, 0.0), (second, self.level)):
            for one in () if given is None else given.measured.forced:
                force = FloorForce(one.excitation.force, measured.rest)
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
    measured = measured_of(building, source, halves=True)
    return Given(measured, measured.base.halves)
