"""What was measured of a building, of any kind, as the effect finder judges it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from femupdate.building.document import Building
from femupdate.discrepancy.thresholds import LEVEL
from femupdate.dynamics.system import System
from femupdate.inference.data import Data
from femupdate.inference.frf_data import COMPARING
from femupdate.progress import Progress
from femupdate.study import Study
from femupdate.workflow.amplitude import level_between
from femupdate.workflow.kinds import Measured, measured_of, with_rest
from femupdate.workflow.likelihoods import base_data, data_of_forces, data_of_modes
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import ObservationSource


@dataclass(frozen=True, eq=False)
class Given:
    """What a model is to explain.

    Attributes:
        measured: as read.
        second: histories at another level, under base motion or a force.
        level: of those above the first ones, in doublings; zero where they are alike.
    """

    measured: Measured
    second: "Given | None" = None
    level: float = 0.0

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on how it was read."""
        if self.second is None:
            return self.measured.notes_of_others
        own, other = self.measured.notes_of_others, self.second.measured.notes_of_others
        return (*self._on_level(), *own, *other)

    def data(self, system: System, use_phase: bool = True) -> tuple[Data, ...]:
        """The same, one entry a kind: all records under base motion as one, forces, modes.

        Args:
            system: whose floors they are of.
            use_phase: compare phases where they were measured.

        Raises:
            InferenceError: more modes are identified than the model has.
        """
        given = [(self, 0.0), *([] if self.second is None else [(self.second, self.level)])]
        based = [
            replace(one.measured.base, level=level) for one, level in given if one.measured.has_base
        ]
        found: list[Data] = []
        if based:
            found.append(base_data(based, system, use_phase, COMPARING))
        for one, level in given:
            own = one.measured
            found += data_of_forces(
                own, system, use_phase=use_phase, level=level, believed=COMPARING
            )
        return (*found, *data_of_modes(self.measured, system))

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
    return Given(measured_of(building, source, halves=True))
