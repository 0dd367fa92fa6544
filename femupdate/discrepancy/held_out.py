"""Data kept out of a repair: how well they are predicted before and after."""

from dataclasses import dataclass, replace

import numpy as np

from femupdate.arrays import Floats
from femupdate.discrepancy.certify import as_event, gain_elsewhere, mean_square
from femupdate.discrepancy.finder_model import FinderModel, problem_of, with_rest_about
from femupdate.discrepancy.fit import Fit, about, settle
from femupdate.discrepancy.repair import Repair
from femupdate.dynamics.history import transformed_sensors
from femupdate.errors import MeasurementError
from femupdate.inference.data import Data
from femupdate.inference.frf_data import FrfData
from femupdate.inference.likelihood import Likelihood
from femupdate.measurement.histories import Histories, rotation_of
from femupdate.measurement.names import BASE


@dataclass(frozen=True, eq=False)
class Held:
    """How well two models predict data that neither was fitted to.

    Attributes:
        name: of the file.
        compared: what of it, beside histories.
        error_before, error_after: rms of the predicted less the measured floor accelerations over
            the rms of the measured; NaN without histories of base motion.
        own_before, own_after: the same with stiffness and damping of the event itself, as no two
            have the same.
        chi2_before, chi2_after: mean squared whitened residual of what is compared.
        floors: names; time, measured, before, after: histories for the picture, or None.
    """

    name: str
    compared: str
    error_before: float
    error_after: float
    own_before: float
    own_after: float
    chi2_before: float
    chi2_after: float
    floors: tuple[str, ...]
    time: Floats | None = None
    measured: Floats | None = None
    before: Floats | None = None
    after: Floats | None = None

    def lines(self) -> tuple[str, ...]:
        """How both models predict the data, and how with the event's own factors."""
        agreement = (
            f"{self.compared} (chi2 a point) {self.chi2_before:.1f} -> {self.chi2_after:.1f}"
        )
        if self.time is None:
            return (f"{self.name}, kept out: error of {agreement}",)
        return (
            f"{self.name}, kept out: error of the histories {self.error_before:.3f} -> "
            f"{self.error_after:.3f}, of {agreement}",
            "with that event's own stiffness and damping: error of the histories "
            f"{self.own_before:.3f} -> {self.own_after:.3f}",
        )


@dataclass(frozen=True, eq=False)
class KeptOut:
    """Data that no model is fitted to.

    Attributes:
        name: of the file.
        model: of the building.
        data: as the finder judges them.
        floors: that they show.
        level: of the data, in doublings above those that are fitted.
        histories: under base motion, where there are any.
        direction: of the motion.
    """

    name: str
    model: FinderModel
    data: tuple[Data, ...]
    floors: tuple[str, ...]
    level: float
    histories: Histories | None
    direction: str

    def gain(self, problem: Likelihood, before: Fit, after: Fit) -> float:
        """Their log density by the second of two fits over that by the first, as another event.

        No more than zero where they are not predicted better as the fits stand, too: what any event
        may make up for is no proof.
        """
        found = gain_elsewhere(self._seen_by(problem, before), before, after)
        better = self.chi2(problem, after) < self.chi2(problem, before)
        return found if better else min(found, 0.0)

    def chi2(self, problem: Likelihood, fitted: Fit) -> float:
        """Mean squared whitened residual at the parameters of a fit."""
        return mean_square(self._seen_by(problem, fitted), fitted)

    def fitted(self, problem: Likelihood, fitted: Fit) -> Fit:
        """The model as of the event that the data show."""
        own = about(self._seen_by(problem, fitted), fitted)
        return settle(own, as_event(own.at_row(own.error.start), fitted))

    def _seen_by(self, problem: Likelihood, fitted: Fit) -> Likelihood:
        """The data as a problem of the structure of a fit, at their level of motion."""
        data = tuple(
            one.at_level(self.level) if isinstance(one, FrfData) else one for one in self.data
        )
        near, theta = fitted.system.model, fitted.theta()[0]
        data = with_rest_about(data, self.model.structure, near, theta)
        return problem_of(problem.reduced, self.model.building, data)


def hold(kept: KeptOut, problem: Likelihood, done: Repair) -> Held:
    """Both models against data that neither has seen, at their level of motion.

    Args:
        kept: the data.
        problem: as the models were fitted to it.
        done: the models before and after.

    Raises:
        MeasurementError: a channel that the observation has is missing in the file.
    """
    modes = any(one.name == "modes" for one in kept.data)
    held = Held(
        name=kept.name,
        compared="frequencies, damping ratios and shapes" if modes else "ln|H|",
        error_before=np.nan,
        error_after=np.nan,
        own_before=np.nan,
        own_after=np.nan,
        chi2_before=kept.chi2(problem, done.before),
        chi2_after=kept.chi2(problem, done.after),
        floors=kept.floors,
    )
    data = kept.histories
    if data is None:
        return held
    base, seen = _channels(data, kept.floors, kept.direction)
    rows = [problem.reduced.model.floors.index(floor) for floor in kept.floors]
    fits = [done.before, done.after]
    fits += [kept.fitted(problem, one) for one in fits]
    told = [_predicted(one, base, data.time_step, kept.level)[rows] for one in fits]
    size = np.sqrt((seen**2).mean())
    errors = [float(np.sqrt(((one - seen) ** 2).mean()) / size) for one in told]
    return replace(
        held,
        error_before=errors[0],
        error_after=errors[1],
        own_before=errors[2],
        own_after=errors[3],
        time=data.time_step * np.arange(seen.shape[1], dtype=np.float64),
        measured=seen,
        before=told[0],
        after=told[1],
    )


def _predicted(fitted: Fit, base: Floats, time_step: float, level: float) -> Floats:
    """Accelerations (f, n) of all floors of a model under a motion of the base of a level.

    The motion is a row of translation (1, n), m/s2, or that and one of rotation (2, n), rad/s2.
    """
    theta, zeta, sizes = fitted.split
    theta, zeta = fitted.system.at_level(theta, zeta, sizes, level)
    return transformed_sensors(fitted.system, (theta, zeta, sizes), base, time_step)


def _channels(data: Histories, floors: tuple[str, ...], direction: str) -> tuple[Floats, Floats]:
    """Motion of the base (1, n), or (2, n) where it turns, and floors (f, n), sensors averaged."""

    def mean(floor: str) -> Floats:
        own = data.rows(floor, direction)
        if not own:
            raise MeasurementError(f"{data.source}: there is no channel {floor} along {direction}")
        return np.asarray(data.acceleration[own].mean(axis=0))

    rotation = rotation_of(data.channels, data.acceleration)
    base = [mean(BASE), *(() if rotation is None else (rotation,))]
    return np.stack(base), np.stack([mean(floor) for floor in floors])
