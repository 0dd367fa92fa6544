"""Floor accelerations, story shears and story drifts of many parameter samples under one record.

Where modes are real the motion is followed mode by mode, exactly for a record that is linear
between its points; where they are not, by the Fourier transform (`femupdate.dynamics.transformed`).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.dynamics.modal_response import ModalOutputs, keep_dynamic, project, see_modes
from femupdate.dynamics.recurrence import Steps, record_points
from femupdate.dynamics.story import story_rows
from femupdate.dynamics.system import Rows, System
from femupdate.dynamics.transformed import transformed_outputs
from femupdate.errors import MeasurementError, ModelError
from femupdate.progress import SILENT, Progress

Numbers = ArrayLike | Tensor
_MASSLESS = 1e9  # rad/s


@dataclass(frozen=True)
class Histories:
    """Response histories of S samples at the instants 0, time_step, 2 time_step, ...

    Attributes:
        time_step: s.
        floors: names of the f observed floors.
        floor_acceleration: (S, f, n) absolute, m/s2.
        story_shear: (S, s, n) N, positive with positive drift.
        story_drift: (S, s, n) m, floor above less floor below.
    """

    time_step: float
    floors: tuple[str, ...]
    floor_acceleration: Floats
    story_shear: Floats
    story_drift: Floats

    def __len__(self) -> int:
        return len(self.floor_acceleration)

    @property
    def time(self) -> Floats:
        """The n instants, s."""
        return self.time_step * np.arange(self.floor_acceleration.shape[-1], dtype=np.float64)


@dataclass(frozen=True)
class HistorySettings:
    """How histories are computed.

    Attributes:
        oversampling: points a step at which the record is interpolated, band-limited, before the
            exact integration along straight lines. 1 draws straight lines between the samples
            themselves, as Nigam and Jennings (1969) do, and so loses a share 1 - sinc^2(f dt) of
            the motion at frequency f: 3 % at a tenth of the sampling rate, 19 % at a quarter.
            With 8 it is 0.05 % and 0.3 %.
        tolerance: a mode is integrated when taking it as static could change an absolute
            acceleration by more than this share of the base acceleration (likewise a shear, a
            drift); 0 integrates all modes.
        batch: samples at a time.
    """

    oversampling: int = 8
    tolerance: float = 1e-4
    batch: int = 50


def floor_histories(
    system: System,
    parameters: Numbers,
    zeta: Numbers,
    acceleration: ArrayLike,
    time_step: float,
    *,
    settings: HistorySettings | None = None,
) -> Histories:
    """Return the response of every sample, from rest, to one record of base acceleration.

    A base that turns adds to the motion of all floors; drifts are those against it as it turns.

    All histories are held in memory, 8 S (f + 2 s) n bytes; for thousands of samples walk through
    `history_batches` and summarise those.

    Args:
        system: the structure with its effects, f floors and s stories.
        parameters: (S, p + q) stiffness factors, then sizes of the effects.
        zeta: damping ratio, (S,) or one for all.
        acceleration: (n,) base acceleration, m/s2, or (2, n) with its rotation, rad/s2, below.
        time_step: s.
        settings: accuracy and batch.

    Raises:
        MeasurementError: the record is too short, not finite or has no positive time step.
        ModelError: parameters or zeta do not fit, or a stiffness is not positive definite.
    """
    batches = history_batches(system, parameters, zeta, acceleration, time_step, settings=settings)
    return join_histories(list(batches))


def join_histories(parts: list[Histories]) -> Histories:
    """Join histories of the same model and record into one."""
    return Histories(
        parts[0].time_step,
        parts[0].floors,
        np.concatenate([p.floor_acceleration for p in parts]),
        np.concatenate([p.story_shear for p in parts]),
        np.concatenate([p.story_drift for p in parts]),
    )


def history_batches(
    system: System,
    parameters: Numbers,
    zeta: Numbers,
    acceleration: ArrayLike,
    time_step: float,
    *,
    settings: HistorySettings | None = None,
    progress: Progress = SILENT,
) -> Iterator[Histories]:
    """Check the input, then yield the histories of `settings.batch` samples at a time.

    Arguments and errors as for `floor_histories`; `progress` advances by one a sample.
    """
    chosen = settings or HistorySettings()
    samples = _check_parameters(parameters, system)
    ratios = _check_zeta(zeta, len(samples))
    tasks = [
        _Task(moved, record, float(time_step), chosen)
        for moved, record in zip(
            (system, system.turned), _check_record(acceleration, time_step, system), strict=False
        )
    ]
    return _walk(tasks, samples, ratios, progress)


@dataclass(frozen=True)
class _Task:
    """What all batches share, for one motion of the base."""

    system: System
    record: Floats
    time_step: float
    settings: HistorySettings

    @cached_property
    def points(self) -> Tensor:
        """The record with `settings.oversampling` points a step."""
        return record_points(self.record, self.settings.oversampling)

    @property
    def by_transform(self) -> bool:
        """Whether a recurrence mode by mode does not follow the motion."""
        return self.system.complex_modes


def _walk(
    tasks: list[_Task], parameters: Tensor, zeta: Tensor, progress: Progress
) -> Iterator[Histories]:
    """Histories batch by batch, added up over the motions of the base."""
    first = tasks[0]
    step = 1 if first.by_transform else first.settings.batch
    respond = _transform if first.by_transform else _recur
    for start in range(0, len(parameters), step):
        rows = slice(start, start + step)
        parts = [respond(task, parameters[rows], zeta[rows], start) for task in tasks]
        yield named_rows(first.system, first.time_step, np.sum(parts, axis=0))
        progress.advance(len(parameters[rows]))


def _transform(task: _Task, parameters: Tensor, zeta: Tensor, first: int) -> Floats:
    """Outputs (1, o, n) of one sample, number `first`."""
    theta, sizes = task.system.split(parameters)
    _check_stable(task.system.modes(theta, sizes).omega, first)
    return transformed_outputs(task.system, (theta, zeta, sizes), task.record, task.time_step)[None]


def _recur(task: _Task, parameters: Tensor, zeta: Tensor, first: int) -> Floats:
    """Outputs (S, o, n) of one batch, the first of whose samples is number `first`."""
    settings = task.settings
    modes, ratio = dynamic_modes(task.system, (parameters, zeta), task.time_step, settings, first)
    steps = Steps.of(modes.omega[None], ratio[None], task.time_step, settings.oversampling)
    return project(modes, steps.windows(task.points), torch.as_tensor(task.record)).numpy()


def displacement_histories(
    system: System,
    samples: tuple[Tensor, Tensor],
    rows: Rows,
    acceleration: Floats,
    time_step: float,
    settings: HistorySettings | None = None,
) -> Floats:
    """Displacements along rows (S, o, n) relative to the moving base, from rest.

    Args:
        system: the structure with its effects, whose modes are real.
        samples: parameters (S, p + q) and damping ratios (S,).
        rows: o of them.
        acceleration: (n,) of the base along what the system's responses are taken to.
        time_step: s.

    Raises:
        ModelError: a stiffness is not positive definite.
    """
    chosen = settings or HistorySettings()
    theta, sizes = system.split(samples[0])
    found = system.modes(theta, sizes, rows)
    _check_stable(found.omega, 0)
    nothing = torch.zeros_like(found.effect)
    modes = ModalOutputs(found.omega, found.effect, nothing, nothing[..., 0])
    modes = keep_dynamic(modes, 0.5 / time_step, chosen.tolerance)
    ratio = system.ratio(modes.omega, samples[1], sizes)
    steps = Steps.of(modes.omega[None], ratio[None], time_step, chosen.oversampling)
    points = record_points(acceleration, chosen.oversampling)
    return project(modes, steps.windows(points), torch.from_numpy(acceleration)).numpy()


def dynamic_modes(
    system: System,
    samples: tuple[Tensor, Tensor],
    time_step: float,
    settings: HistorySettings,
    first: int,
) -> tuple[ModalOutputs, Tensor]:
    """The modes that a record moves, as the outputs see them, and their damping ratios (S, m).

    Args:
        system: the structure with its effects.
        samples: parameters (S, p + q) and damping ratios (S,).
        time_step: of the record, s.
        first: number of the first sample, for messages.

    Raises:
        ModelError: a stiffness is not positive definite.
    """
    (theta, sizes), zeta = system.split(samples[0]), samples[1]
    rows = story_rows(system, sizes)
    found = system.modes(theta, sizes, rows)
    _check_stable(found.omega, first)
    modes = see_modes(found, len(system.floors), len(system.model.story_mass))
    modes = keep_dynamic(modes, 0.5 / time_step, settings.tolerance)
    return modes, system.ratio(modes.omega, zeta, sizes)


def named_rows(system: System, time_step: float, response: Floats) -> Histories:
    """Tell the rows of (S, o, n) apart; they come in the order of `story_rows`."""
    floors, stories = len(system.floors), len(system.model.story_mass)
    acceleration, shear, drift = np.split(response, [floors, floors + stories], axis=1)
    return Histories(time_step, system.floors, acceleration, shear, drift)


def _check_parameters(parameters: Numbers, system: System) -> Tensor:
    samples = torch.as_tensor(parameters, dtype=torch.float64)
    if samples.ndim != 2 or samples.shape[1] != system.parameters or len(samples) == 0:
        raise ModelError(
            f"theta has the shape {tuple(samples.shape)}; "
            f"the model needs (samples, {system.parameters})"
        )
    if not torch.isfinite(samples).all():
        row = int(torch.isfinite(samples).all(dim=1).logical_not().nonzero()[0])
        raise ModelError(f"theta of sample {row} is not finite; leave that sample out")
    return samples


def _check_zeta(zeta: Numbers, count: int) -> Tensor:
    ratios = torch.as_tensor(zeta, dtype=torch.float64)
    if ratios.ndim == 0:
        ratios = ratios.expand(count)
    if ratios.shape != (count,):
        raise ModelError(
            f"zeta has the shape {tuple(ratios.shape)}; give one number or one for each "
            f"of the {count} samples"
        )
    if not bool((ratios >= 0.0).all()):  # False for NaN as well
        raise ModelError("zeta must be zero or more in every sample; 0.02 means 2 % of critical")
    return ratios


def _check_record(acceleration: ArrayLike, time_step: float, system: System) -> Floats:
    """(1, n) translation, or (2, n) with rotation."""
    given = np.asarray(acceleration, dtype=np.float64)
    record = np.atleast_2d(given)
    if len(record) == 2 and system.model.rotation is None:
        raise ModelError(
            "the reduced model knows of no base that turns; give its translation alone"
        )
    if given.ndim not in (1, 2) or record.shape[0] > 2 or record.shape[1] < 2:
        raise MeasurementError(
            f"the base acceleration has the shape {given.shape}; give one row of two samples "
            "or more, or two rows, translation and rotation"
        )
    bad = np.argwhere(~np.isfinite(record))
    if len(bad):
        row, sample = bad[0]
        raise MeasurementError(
            f"sample {sample} of the base acceleration is {record[row, sample]}; mend the record"
            " first"
        )
    if not (np.isfinite(time_step) and time_step > 0.0):
        raise MeasurementError(f"the time step of the record is {time_step} s; it must be positive")
    return record


def _check_stable(omega: Tensor, first: int) -> None:
    """A building at rest has no negative stiffness, which gives NaN, and no mode at rest."""
    # What has no mass at all (a base on springs) is infinitely fast.
    fastest = torch.where(omega < _MASSLESS, omega, 0.0).amax(dim=1)
    slow = omega.amin(dim=1) <= 1e-7 * fastest
    unstable = (slow | omega.isnan().any(dim=1)).nonzero()
    if len(unstable):
        raise ModelError(
            f"the stiffness of sample {first + int(unstable[0])} is not positive definite: "
            "its theta or the model leaves the building unstable"
        )
