"""What was measured of a building, of any kind, as the effect finder judges it."""

from dataclasses import dataclass, replace

from femupdate.dynamics.system import System
from femupdate.inference.data import Data
from femupdate.inference.frf_data import COMPARING
from femupdate.measurement.observation import Observation
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
        level = ["Both records have the same level: they are explained by one stiffness."]
        if self.level != 0.0:
            times = f"{2.0**self.level:.2g}"
            level = [f"The second record has {times} times the level of the first."]
            if self.measured.modes:
                level.append(
                    "The identified modes are taken to be those at the level of the first record."
                )
        others = self.second.measured.notes_of_others
        return (*level, *self.measured.notes_of_others, *others)

    def data(self, system: System, use_phase: bool = True) -> tuple[Data, ...]:
        """The same, one entry a kind: all records under base motion as one, forces, modes.

        Raises:
            InferenceError: more modes are identified than the model has.
        """
        given = [(self.measured, 0.0)]
        if self.second is not None:
            given.append((self.second.measured, self.level))
        based = [replace(seen.base, level=level) for seen, level in given if seen.has_base]
        kinds: list[Data] = []
        if based:
            kinds.append(base_data(based, system, use_phase, COMPARING))
        for seen, level in given:
            kinds += data_of_forces(
                seen, system, use_phase=use_phase, level=level, believed=COMPARING
            )
        return (*kinds, *data_of_modes(self.measured, system))

    @property
    def run(self) -> Observation | None:
        """The run under base motion, where there is but one."""
        alone = self.second is None and len(self.measured.runs) == 1
        return self.measured.runs[0] if alone else None


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
    # Halves of the FRFs under base motion test names.
    first = Given(measured_of(model.building, source, halves=True))
    if second is None:
        return replace(first, measured=with_rest(study, model, first.measured, progress))
    other = Given(measured_of(model.building, second, halves=True))
    level = level_between(model, source, second)
    measured, further = (
        with_rest(study, model, given.measured, progress) for given in (first, other)
    )
    rest = measured.rest or further.rest
    return replace(
        first,
        measured=replace(measured, rest=rest),
        second=replace(other, measured=further),
        level=0.0 if abs(level) < 0.25 else level,
    )


def read_held(
    study: Study, model: StudyModel, source: ObservationSource, progress: Progress
) -> Given:
    """Read data that are only predicted, of any kind.

    Raises:
        MeasurementError: a file cannot be used.
    """
    return Given(with_rest(study, model, measured_of(model.building, source), progress))
