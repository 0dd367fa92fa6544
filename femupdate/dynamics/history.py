"""Floor accelerations, story shears and story drifts of many parameter samples under one record.

Where modes are real the motion is followed mode by mode, exactly for a record that is linear
between its points.

Dampers and appendages make modes complex, and instruments are known by their FRFs: there the
response is the inverse Fourier transform of the FRFs times the record's spectrum, with silence
behind the record until the motion has died down.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.dynamics.excitation import Excitation
from femupdate.dynamics.modes import Modes, response
from femupdate.dynamics.recurrence import ModalOutputs
from femupdate.dynamics.system import Rows, Sample, System
from femupdate.effects.effect import split_sizes
from femupdate.errors import StructureError
from femupdate.progress import SILENT, Progress

Numbers = ArrayLike | Tensor
# Points a step at which a record is interpolated, band-limited, before the exact integration along
# straight lines. With 1, straight lines between the samples themselves (Nigam and Jennings 1969),
# a share 1 - sinc^2(f dt) of the motion at frequency f is lost: 3 % at a tenth of the sampling
# rate, 19 % at a quarter. With 8 it is 0.05 % and 0.3 %.
_OVERSAMPLING = 8
# A mode is integrated when taking it as static could change an absolute acceleration by more than
# this share of the base acceleration (likewise a shear, a drift). In the six-story frame under an
# earthquake no output then errs by more than .03 % of its peak, on 90 modes instead of 163.
_TOLERANCE = 1e-3
BATCH = 50  # samples at a time
REST = 1e-4  # share to which motion has decayed behind the record
_SHORTEST_S, _LONGEST_S = 5.0, 600.0  # of that silence


@dataclass(frozen=True)
class ResponseHistories:
    """Response histories of S samples at the instants 0, time_step, 2 time_step, ..."""

    time_step: float  # s
    floors: tuple[str, ...]  # names of the f observed floors
    floor_acceleration: Floats  # (S, f, n) absolute, m/s2
    story_shear: Floats  # (S, s, n) N, positive with positive drift
    story_drift: Floats  # (S, s, n) m, floor above less floor below

    def __len__(self) -> int:
        return len(self.floor_acceleration)

    @property
    def time(self) -> Floats:
        """The n instants, s."""
        return self.time_step * np.arange(self.floor_acceleration.shape[-1], dtype=np.float64)


def floor_histories(
    system: System,
    parameters: Numbers,
    zeta: Numbers,
    acceleration: ArrayLike,
    time_step: float,
    *,
    oversampling: int = _OVERSAMPLING,
    tolerance: float = _TOLERANCE,
) -> ResponseHistories:
    """Return the response of every sample, from rest, to one record of base acceleration.

    A base that turns adds to the motion of all floors; drifts are those against it as it turns.

    All histories are held in memory, 8 S (f + 2 s) n bytes; for thousands of samples walk through
    `history_batches` and summarise those.

    Args:
        system: the structure with its effects, f floors and s stories.
        parameters: (S, p + q) stiffness factors, then sizes of the effects.
        zeta: damping ratio, (S,) or one for all.
        acceleration: (n,) base acceleration, m/s2, or (2, n) with its rotation, rad/s2, below, or
            (3, n) with its acceleration across, m/s2, below that.
        oversampling: points a step of the record.
        tolerance: share of the base acceleration up to which modes are static; 0 integrates all.

    Raises:
        StructureError: a stiffness is not positive definite.
    """
    sample = parameters, zeta, acceleration, time_step
    batches = history_batches(system, *sample, oversampling=oversampling, tolerance=tolerance)
    return join_histories(list(batches))


def join_histories(parts: list[ResponseHistories]) -> ResponseHistories:
    """Join histories of the same model and record into one."""
    return ResponseHistories(
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
    oversampling: int = _OVERSAMPLING,
    tolerance: float = _TOLERANCE,
    progress: Progress = SILENT,
) -> Iterator[ResponseHistories]:
    """Yield the histories of fifty samples at a time.

    Arguments and errors as for `floor_histories`; `progress` advances by one a sample.
    """
    samples = torch.as_tensor(parameters, dtype=torch.float64)
    ratios = torch.as_tensor(zeta, dtype=torch.float64).expand(len(samples))
    record = np.atleast_2d(np.asarray(acceleration, dtype=np.float64))
    task = _Task(system, record, float(time_step), oversampling, tolerance)
    return _walk(task, samples, ratios, progress)


@dataclass(frozen=True)
class _Task:
    """What all batches share: a system, and the motion (e, n) of its base."""

    system: System
    record: Floats
    time_step: float
    oversampling: int = _OVERSAMPLING
    tolerance: float = _TOLERANCE

    def modes(self, parameters: Tensor, zeta: Tensor, first: int) -> tuple[ModalOutputs, Tensor]:
        """Modes of samples, the first of them number `first`, and damping ratios (S, m)."""
        theta, sizes = self.system.split(parameters)
        found = self.system.modes(theta, sizes, story_rows(self.system, sizes))
        _check_stable(found.omega, first)
        shown = found.rows * found.omega[:, None]  # of unit modal mass
        floors, stories = len(self.system.floors), len(self.system.model.story_mass)
        ends, columns = [floors, stories, stories], len(self.record)
        of_floor, of_inertia, of_drift = shown.split(ends, dim=1)
        direct = found.direct[:, :, :columns].split(ends, dim=1)
        none, driven = torch.zeros_like(shown).split(ends, dim=1), found.participation[:, :columns]
        seen = ModalOutputs(
            found.omega,
            driven * found.omega[:, None],
            torch.cat([none[0], none[1], of_drift], dim=1),
            torch.cat([of_floor, -of_inertia, none[2]], dim=1),
            torch.cat([direct[0], -direct[1], torch.zeros_like(direct[2])], dim=1),
        )
        return self.dynamic(seen, zeta, sizes)

    def dynamic(
        self, modes: ModalOutputs, zeta: Tensor, sizes: Tensor
    ) -> tuple[ModalOutputs, Tensor]:
        """The modes that the record moves, and their damping ratios (S, m)."""
        kept = modes.dynamic(0.5 / self.time_step, self.tolerance)
        return kept, self.system.ratio(kept.omega, zeta, sizes)

    def outputs(self, modes: ModalOutputs, ratio: Tensor) -> Floats:
        """Outputs (S, o, n) of modes that stay as they are."""
        found = modes.outputs(ratio, self.record, self.time_step, self.oversampling)
        return np.asarray(found.numpy())

    def named(self, response: Floats) -> ResponseHistories:
        """Tell the rows of (S, o, n) apart; they come in the order of `story_rows`."""
        floors, stories = len(self.system.floors), len(self.system.model.story_mass)
        acceleration, shear, drift = np.split(response, [floors, floors + stories], axis=1)
        return ResponseHistories(self.time_step, self.system.floors, acceleration, shear, drift)


def _walk(
    task: _Task, parameters: Tensor, zeta: Tensor, progress: Progress
) -> Iterator[ResponseHistories]:
    """Histories batch by batch."""
    transform = task.system.complex_modes
    step = 1 if transform else BATCH
    for start in range(0, len(parameters), step):
        some, ratios = parameters[start : start + step], zeta[start : start + step]
        if transform:
            theta, sizes = task.system.split(some)
            sample, record = (theta, ratios, sizes), task.record
            outputs = transformed_outputs(task.system, sample, record, task.time_step, start)[None]
        else:
            outputs = task.outputs(*task.modes(some, ratios, start))
        yield task.named(outputs)
        progress.advance(len(some))


def displacement_histories(
    system: System,
    samples: tuple[Tensor, Tensor],
    rows: Rows,
    acceleration: Floats,
    time_step: float,
    oversampling: int = _OVERSAMPLING,
) -> Floats:
    """Displacements along rows (S, o, n) relative to the moving base, from rest.

    Args:
        system: the structure with its effects, whose modes are real.
        samples: parameters (S, p + q) and damping ratios (S,).
        acceleration: (n,) of the base along the motion.

    Raises:
        StructureError: a stiffness is not positive definite.
    """
    task = _Task(system, np.atleast_2d(acceleration), time_step, oversampling)
    theta, sizes = system.split(samples[0])
    found = system.modes(theta, sizes, rows)
    _check_stable(found.omega, 0)
    shown, columns = found.rows * found.omega[:, None], len(task.record)
    nothing = found.direct.new_zeros(*shown.shape[:2], columns)
    driven = found.participation[:, :columns] * found.omega[:, None]
    modes = ModalOutputs(found.omega, driven, shown, torch.zeros_like(shown), nothing)
    return task.outputs(*task.dynamic(modes, samples[1], sizes))


def story_rows(system: System, sizes: Tensor) -> Rows:
    """Rows (N, f + 2 s, r) of the floors, the inertia above each story, and the story drifts.

    The story carries the inertia of all that lies above it, Q_i = -(inertia_i . q'' + mass_i a_g),
    positive when the floor above is pushed back from a positive drift, so that Q / d = +k in a
    shear building. What damping carries is part of Q. The drift d is the displacement of the floor
    above less that of the floor below.

    Args:
        system: with its effects, whose masses count.
        sizes: (N, q) of the effects.
    """
    model, count = system.model, len(sizes)
    rotation, stories = model.rotation, len(model.story_mass)
    levels = np.zeros(len(model.floors)) if rotation is None else rotation.levels
    moment = np.zeros(stories) if rotation is None else rotation.story_moment
    turned = np.zeros(stories) if rotation is None else rotation.story_height
    shapes = np.concatenate([model.floor_shapes, model.story_inertia, model.story_drift])
    rigid = np.concatenate(
        [
            np.column_stack([np.ones(len(levels)), levels]),
            np.column_stack([model.story_mass, moment]),
            np.column_stack([np.zeros(stories), turned]),
        ]
    )
    rigid = np.column_stack([rigid, np.zeros(len(rigid))])  # what moves across is not seen along
    wide = [torch.from_numpy(part).expand(count, -1, -1).clone() for part in (shapes, rigid)]
    columns = slice(len(levels), len(levels) + stories)
    for terms, values in zip(system.terms, split_sizes(system.placed, sizes), strict=True):
        if terms.mass is not None:
            weight = values[:, 0, None, None]
            wide[0][:, columns] += weight * torch.as_tensor(terms.mass.above)
            wide[1][:, columns] += weight * torch.as_tensor(terms.mass.above_rigid)
    return Rows(*wide)


def transformed_outputs(
    system: System,
    sample: Sample,
    record: Floats,
    time_step: float,
    number: int = 0,
) -> Floats:
    """Floor accelerations, story shears and story drifts (f + 2 s, n) as they happen.

    Args:
        system: the structure with effects; what only its instruments do is left out.
        sample: theta (1, p), zeta (1,) and sizes (1, q).
        record: (n,), (2, n) or (3, n), see `floor_histories`.
        number: of the sample, for messages.

    Drifts are those against the base as it turns: its tilt strains no story.
    """
    theta, zeta, sizes = sample
    motion = np.atleast_2d(record)
    floors, stories = len(system.floors), len(system.model.story_mass)
    modes = system.modes(theta, sizes, story_rows(system, sizes))
    _check_stable(modes.omega, number)
    direct = modes.direct.clone()
    direct[:, floors + stories : floors + 2 * stories] = 0.0
    modes = Modes(modes.inverse, modes.rows, modes.participation, direct)
    ratio = system.ratio(modes.omega, zeta, sizes)

    def outputs(omega: Tensor) -> Tensor:
        ports = system.port_stiffness(omega, sizes)
        frf = response(modes, ratio, omega, ports, columns=len(motion))[0]
        of_floor, of_inertia, of_drift = frf.split([floors, stories, stories])
        return torch.cat([of_floor, -of_inertia, -of_drift / omega**2])

    return _transformed(outputs, motion, time_step, _rest(modes.omega, ratio, REST))


def transformed_sensors(
    system: System,
    sample: Sample,
    record: Floats,
    time_step: float,
    share: float = REST,
) -> Floats:
    """Accelerations (f, n), m/s2, as the sensors give them.

    Args:
        system, sample, record, time_step: see `transformed_outputs`.
        share: to which motion decays behind the record.
    """
    theta, zeta, sizes = sample
    motion = np.atleast_2d(record)
    omega = system.modes(theta, sizes).omega

    def sensors(omega: Tensor) -> Tensor:
        base, frequency_hz = Excitation(columns=len(motion)), omega / (2.0 * torch.pi)
        return system.respond(base, theta, zeta, sizes, frequency_hz)[0]

    rest = _rest(omega, system.ratio(omega, zeta, sizes), share)
    return _transformed(sensors, motion, time_step, rest)


def _transformed(
    frf: Callable[[Tensor], Tensor], record: Floats, time_step: float, rest: float
) -> Floats:
    """Outputs (o, n) under a motion (e, n), from what gives FRFs (o, e, k) at rad/s (k,)."""
    samples = record.shape[1]
    padded = samples + round(rest / time_step)
    spectrum = np.fft.rfft(record, padded)
    frequency = np.asarray(np.fft.rfftfreq(padded, time_step), dtype=np.float64)
    frequency[0] = 1e-3 * frequency[1]  # the rigid limit, without a division by zero
    # As many frequencies at a time as fit the cache.
    blocks = np.array_split(2.0 * np.pi * frequency, max(1, len(frequency) // 2048))
    values = torch.cat([frf(torch.from_numpy(block)) for block in blocks], dim=2).numpy()
    moved = np.fft.irfft((values * spectrum).sum(axis=1), padded, axis=1)
    return np.asarray(moved[:, :samples])


def _rest(omega: Tensor, ratio: Tensor, share: float) -> float:
    """How long motion lasts behind the record, s."""
    rate = float((omega * ratio).min())  # of decay, 1/s
    return float(np.clip(-np.log(share) / rate, _SHORTEST_S, _LONGEST_S))


def _check_stable(omega: Tensor, first: int) -> None:
    """A building at rest has no negative stiffness, which gives NaN, and no mode at rest."""
    # What has no mass at all (a base on springs) is faster than 1e9 rad/s.
    fastest = torch.where(omega < 1e9, omega, 0.0).amax(dim=1)
    slow = omega.amin(dim=1) <= 1e-7 * fastest
    unstable = (slow | omega.isnan().any(dim=1)).nonzero()
    if len(unstable):
        raise StructureError(
            f"the stiffness of sample {first + int(unstable[0])} is not positive definite: "
            "its theta or the model leaves the building unstable"
        )
