"""Histories of a building that is softer, and damps more, where its own motion is strong.

The law is known by the level of the motion about the mean one of a run, in doublings. Stiffness
changes by one factor throughout, so that the modes keep their shapes: each is followed with the
frequency and the damping of the level that the motion has about then. The level follows from the
response and the response from the level, in a few rounds.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Floats, Integers
from femupdate.dynamics.history import Histories, HistorySettings, dynamic_modes, named_rows
from femupdate.dynamics.level import level_of_moment, motion_level
from femupdate.dynamics.modal_response import ModalOutputs, project
from femupdate.dynamics.recurrence import Steps, record_points
from femupdate.dynamics.system import System
from femupdate.dynamics.thresholds import CHANGING, LEVEL
from femupdate.progress import SILENT, Progress

_BATCH = 50
_MOST = round(LEVEL.span / CHANGING.step)  # levels to either side of the mean one


@dataclass(frozen=True)
class RunMotion:
    """A motion of the base, and the level at which a structure has its factors.

    Attributes:
        base: (n,) acceleration, m/s2, or (2, n) with its rotation, rad/s2, below.
        time_step: s.
        mean_level: (f,) of the run that the factors are of, m/s2 (see `motion_level`), NaN where a
            floor was not measured; None where it is not known: then it is that of this motion.
        keep_damping: whether damping ratios stay as they are.
    """

    base: Floats
    time_step: float
    mean_level: Floats | None = None
    keep_damping: bool = False


def changing_histories(
    system: System,
    parameters: Tensor,
    zeta: Tensor,
    motion: RunMotion,
    progress: Progress = SILENT,
) -> Iterator[Histories]:
    """Yield the histories of some samples at a time, from rest, as `history_batches` does.

    Args:
        system: with an effect that changes in the run, and real modes.
        parameters: (S, p + q) as they are at the mean level.
        zeta: (S,) damping ratios, likewise.
        progress: advances by one a sample.

    Raises:
        ModelError: a stiffness is not positive definite.
    """
    theta, sizes = system.split(parameters[:1])
    period = 2.0 * np.pi / float(system.modes(theta, sizes).omega.min())
    # All samples have much the same level: one finds it, and the others go on from there.
    level = _settled(system, (parameters[:1], zeta[:1]), motion, period, CHANGING.rounds)[1]
    for first in range(0, len(parameters), _BATCH):
        some = slice(first, first + _BATCH)
        own = parameters[some], zeta[some]
        begun = np.repeat(level, len(own[0]), axis=0)
        yield _settled(system, own, motion, period, CHANGING.last_rounds, begun, first)[0]
        progress.advance(len(own[0]))


def _settled(
    system: System,
    samples: tuple[Tensor, Tensor],
    motion: RunMotion,
    period: float,
    rounds: int,
    level: Integers | None = None,
    first: int = 0,
) -> tuple[Histories, Integers]:
    """Histories of samples, and the level (S, w) in windows, followed from one to the other."""
    steps = max(1, round(CHANGING.window * period / motion.time_step))
    across = max(1, round(LEVEL.periods * period / motion.time_step))
    parts = [
        _Followed.of(moved, samples, own, motion, first)
        for moved, own in zip((system, system.turned), np.atleast_2d(motion.base), strict=False)
    ]
    if level is None:
        windows = -(-(parts[0].record.numel() - 1) // steps)
        level = np.zeros((len(samples[0]), windows), dtype=np.int64)
    for _ in range(rounds):
        response = np.sum([part.outputs(level, steps) for part in parts], axis=0)
        found = named_rows(system, motion.time_step, response)
        before = level
        level = _levels(found.floor_acceleration, motion.mean_level, across, steps)
        if (level == before).all():
            break
    return found, level


def _levels(acceleration: Floats, mean_level: Floats | None, across: int, steps: int) -> Integers:
    """Number (S, w) of the level in windows of so many steps, of motions (S, f, n)."""
    mean = motion_level(acceleration) if mean_level is None else mean_level
    level = level_of_moment(acceleration, mean, across)
    last = acceleration.shape[-1] - 1
    middles = np.minimum(np.arange(-(-last // steps)) * steps + steps // 2, last)
    return np.asarray(np.rint(level[:, middles] / CHANGING.step), dtype=np.int64)


@dataclass(frozen=True, eq=False)
class _Followed:
    """Modes of a batch under one motion of the base.

    Attributes:
        modes: as the outputs see them.
        steps: of every level told apart, from the lowest.
        record: (n,) of the base.
        points: (n - 1, factor + 1) the record between its samples.
    """

    modes: ModalOutputs
    steps: Steps
    record: Tensor
    points: Tensor

    @staticmethod
    def of(
        system: System,
        samples: tuple[Tensor, Tensor],
        record: Floats,
        motion: RunMotion,
        first: int,
    ) -> "_Followed":
        """For parameters (S, p + q) and damping ratios (S,); `first` is the number of the first."""
        settings, sizes = HistorySettings(), system.split(samples[0])[1]
        modes, ratio = dynamic_modes(system, samples, motion.time_step, settings, first)
        omegas, ratios = [], []
        for k in range(-_MOST, _MOST + 1):
            change = system.run_change(sizes, k * CHANGING.step)
            omegas.append(modes.omega * change.stiffness.sqrt()[:, None])
            ratios.append(ratio if motion.keep_damping else ratio * change.damping[:, None])
        levels = torch.stack(omegas), torch.stack(ratios)
        return _Followed(
            modes,
            Steps.of(*levels, motion.time_step, settings.oversampling),
            torch.from_numpy(np.ascontiguousarray(record)),
            record_points(record, settings.oversampling),
        )

    def outputs(self, level: Integers, steps: int) -> Floats:
        """Outputs (S, o, n) where windows of so many steps have the levels (S, w)."""
        windows = self.steps.windows(self.points, level + _MOST, steps)
        return np.asarray(project(self.modes, windows, self.record).numpy())
