"""Data kept out of a repair: how well they are predicted before and after."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats
from femupdate.discrepancy.certify import gain_elsewhere
from femupdate.discrepancy.fit import Fit
from femupdate.discrepancy.mesh_error import MeshError
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.repair import Repair
from femupdate.discrepancy.thresholds import VERDICT
from femupdate.dynamics.transformed import transformed_sensors
from femupdate.errors import MeasurementError
from femupdate.measurement.columns import BASE
from femupdate.measurement.observation import Observation
from femupdate.measurement.observation_file import Histories, read_observation_file
from femupdate.workflow.effects import problem_of
from femupdate.workflow.finder_data import base_data
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import ObservationSource, observed_direction


@dataclass(frozen=True, eq=False)
class Held:
    """How well two models predict data that neither was fitted to.

    Attributes:
        name: of the file.
        error_before, error_after: rms of the predicted less the measured floor accelerations over
            the rms of the measured; NaN for FRF tables.
        chi2_before, chi2_after: mean squared whitened residual of ln|H|.
        floors: names; time, measured, before, after: histories for the picture, or None.
    """

    name: str
    error_before: float
    error_after: float
    chi2_before: float
    chi2_after: float
    floors: tuple[str, ...]
    time: Floats | None = None
    measured: Floats | None = None
    before: Floats | None = None
    after: Floats | None = None

    def sentence(self) -> str:
        """How both models predict the data."""
        histories = ""
        if self.time is not None:
            errors = f"{self.error_before:.3f} -> {self.error_after:.3f}"
            histories = f"error of the histories {errors}, "
        return (
            f"{self.name}, kept out: {histories}of ln|H| (chi2 a point) "
            f"{self.chi2_before:.1f} -> {self.chi2_after:.1f}"
        )


def predicts_better(
    model: StudyModel,
    mesh: MeshError | None,
    observation: Observation,
    use_phase: bool,
    level: float,
) -> Callable[[Problem, Fit, Fit], bool]:
    """Whether data kept out are clearly likelier by the second of two fits, by ln|H| and phase.

    Args:
        model: of the study.
        mesh: error of the mesh, where it is known.
        observation: the data kept out.
        use_phase: compare phases where they were measured.
        level: of the data, in doublings above those that were fitted.
    """

    def better(problem: Problem, before: Fit, after: Fit) -> bool:
        own = _at_level(model, mesh, problem, observation, use_phase, level)
        return gain_elsewhere(own, before, after) > VERDICT.clearly

    return better


def _at_level(
    model: StudyModel,
    mesh: MeshError | None,
    problem: Problem,
    observation: Observation,
    use_phase: bool,
    level: float,
) -> Problem:
    data = base_data(model.building, mesh, observation, use_phase).at_level(level)
    return problem_of(problem.reduced, model.building, (data,))


def hold(
    model: StudyModel,
    mesh: MeshError | None,
    problem: Problem,
    done: Repair,
    source: ObservationSource,
    observation: Observation,
    use_phase: bool,
    level: float,
) -> Held:
    """Both models against data that neither has seen, at their level of motion.

    Args:
        model: of the study.
        mesh: error of the mesh, where it is known.
        problem: as the models were fitted to it.
        done: the models before and after.
        source: the data kept out.
        observation: the same, read.
        use_phase: compare phases where they were measured.
        level: of the data, in doublings above those that were fitted.

    Raises:
        MeasurementError: a channel that the observation has is missing in the file.
    """
    reduced = problem.reduced
    own = _at_level(model, mesh, problem, observation, use_phase, level)
    chi2 = [_mean_square(own, fitted) for fitted in (done.before, done.after)]
    data = read_observation_file(source.path, source.unit, source.columns)
    floors = observation.floors
    if not isinstance(data, Histories):
        return Held(source.path.name, np.nan, np.nan, chi2[0], chi2[1], floors)
    base, measured = _channels(data, floors, observed_direction(model))
    rows = [reduced.model.floors.index(floor) for floor in floors]
    predicted = []
    for fitted in (done.before, done.after):
        theta, zeta, sizes = fitted.split
        theta, zeta = fitted.system.at_level(theta, zeta, sizes, level)
        sample = (theta, zeta, sizes)
        predicted.append(transformed_sensors(fitted.system, sample, base, data.time_step)[rows])
    size = np.sqrt((measured**2).mean())
    errors = [float(np.sqrt(((one - measured) ** 2).mean()) / size) for one in predicted]
    instants = data.time_step * np.arange(measured.shape[1], dtype=np.float64)
    return Held(
        source.path.name,
        errors[0],
        errors[1],
        chi2[0],
        chi2[1],
        floors,
        instants,
        measured,
        predicted[0],
        predicted[1],
    )


def _mean_square(problem: Problem, fitted: Fit) -> float:
    """Mean squared whitened residual of other data at the fitted parameters."""
    error = problem.error
    residual = error.tame(problem.missed(fitted.system, fitted.split), error.first)
    return float((residual**2).sum()) / max(problem.effective, 1.0)


def _channels(data: Histories, floors: tuple[str, ...], direction: str) -> tuple[Floats, Floats]:
    """Base (n,) and floors (f, n), sensors averaged."""

    def mean(floor: str) -> Floats:
        own = [
            row
            for row, channel in enumerate(data.channels)
            if channel.floor == floor and channel.direction == direction
        ]
        if not own:
            raise MeasurementError(f"{data.source}: there is no channel {floor} along {direction}")
        return np.asarray(data.acceleration[own].mean(axis=0))

    return mean(BASE), np.stack([mean(floor) for floor in floors])
