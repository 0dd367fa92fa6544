"""Histories of a structure with effects under a ground motion.

Effects may make modes complex and the base flexible, so that no recurrence mode by mode is at
hand: the response is the inverse Fourier transform of the FRFs times the record's spectrum, with
silence behind the record until the motion has died down. For a linear structure that is exact.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import torch

from femupdate.arrays import Complexes, Floats
from femupdate.dynamics.effect_response import EffectSystem
from femupdate.dynamics.history import Histories
from femupdate.effects.structure import ROTATION, Structure
from femupdate.progress import SILENT, Progress

_REST = 1e-4  # share to which motion has decayed behind the record
_SHORTEST_S, _LONGEST_S = 5.0, 300.0
_BLOCK = 2048


def effect_histories(
    system: EffectSystem,
    theta: Floats,
    zeta: Floats,
    sizes: Floats,
    record: Floats,
    time_step: float,
    progress: Progress = SILENT,
    *,
    instruments: bool = False,
) -> Iterator[Histories]:
    """Histories of floors and stories, one sample at a time.

    Args:
        system: the structure with effects.
        theta: (S, p) stiffness factors; zeta: (S,); sizes: (S, q) of the effects.
        record: (n,) base acceleration, m/s2.
        time_step: s.
        progress: advances by one a sample.
        instruments: whether floors are as the sensors give them, or as they move.
    """
    for one in range(len(theta)):
        yield _history(
            system,
            theta[one : one + 1],
            float(zeta[one]),
            sizes[one : one + 1],
            record,
            time_step,
            instruments,
        )
        progress.advance()


def _history(
    system: EffectSystem,
    theta: Floats,
    zeta: float,
    sizes: Floats,
    record: Floats,
    time_step: float,
    instruments: bool,
) -> Histories:
    values = (
        torch.from_numpy(np.ascontiguousarray(theta, dtype=np.float64)),
        torch.tensor([zeta], dtype=torch.float64),
        torch.from_numpy(np.ascontiguousarray(sizes, dtype=np.float64)),
    )
    samples = len(record)
    padded = samples + round(_rest(system, *values) / time_step)
    spectrum = np.fft.rfft(record, padded)
    frequency = np.asarray(np.fft.rfftfreq(padded, time_step), dtype=np.float64)
    frequency[0] = 1e-3 * frequency[1]  # the rigid limit, without a division by zero
    structural = _structural(_with_stories(system, values[2]))
    frf = _frf(structural, values, frequency)
    stories, floors = system.reduced.model.parameters, len(system.reduced.model.floors)
    motion = np.fft.irfft(frf[: floors + stories] * spectrum, padded, axis=1)[:, :samples]
    omega = 2.0 * np.pi * frequency
    drift = np.fft.irfft(-frf[floors + stories :] / omega**2 * spectrum, padded, axis=1)
    acceleration = motion[:floors]
    if instruments and len(structural.placed) != len(system.placed):
        seen = np.fft.irfft(_frf(system, values, frequency) * spectrum, padded, axis=1)
        acceleration = seen[:, :samples]
    return Histories(
        time_step,
        system.reduced.model.floors,
        acceleration[None],
        -motion[None, floors:],
        drift[None, :, :samples],
    )


def _frf(system: EffectSystem, values: tuple[torch.Tensor, ...], frequency: Floats) -> Complexes:
    theta, zeta, sizes = values
    own = _own_sizes(system, sizes)
    blocks = np.array_split(frequency, max(1, len(frequency) // _BLOCK))
    parts = [system.frf(theta, zeta, own, torch.from_numpy(block))[0] for block in blocks]
    return torch.cat(parts, dim=1).numpy()


def _own_sizes(system: EffectSystem, sizes: torch.Tensor) -> torch.Tensor:
    """Sizes of a system without its instruments, which come last in `_structural`."""
    return sizes[:, list(system.kept)] if system.kept is not None else sizes


def _structural(system: EffectSystem) -> EffectSystem:
    """The system without what only the instruments do."""
    kept: list[int] = []
    chosen: list[int] = []
    first = 0
    for place, one in enumerate(system.placed):
        count = len(one.effect.parameters)
        if not one.effect.instrument:
            chosen.append(place)
            kept += range(first, first + count)
        first += count
    return replace(
        system,
        placed=tuple(system.placed[k] for k in chosen),
        terms=tuple(system.terms[k] for k in chosen),
        kept=tuple(kept),
    )


def _rest(
    system: EffectSystem, theta: torch.Tensor, zeta: torch.Tensor, sizes: torch.Tensor
) -> float:
    """How long motion lasts behind the record, s."""
    modes = system.modes(theta, zeta, sizes)
    rate = 2.0 * np.pi * modes.frequency_hz * modes.ratio  # of decay, 1/s
    return float(np.clip(-np.log(_REST) / float(rate.min()), _SHORTEST_S, _LONGEST_S))


def _with_stories(system: EffectSystem, sizes: torch.Tensor) -> EffectSystem:
    """The system with rows for floors, inertia above each story, and drift of each story."""
    reduced = system.reduced
    structure, model = reduced.structure, reduced.model
    above = _above(structure)
    inertia, moment = model.story_inertia, above @ (structure.rigid_force[:, ROTATION])
    mass = np.asarray(model.story_mass, dtype=np.float64)
    first = 0
    for one in system.placed:
        own = one.effect.terms(structure, one.place).mass
        if own is not None:
            size = float(sizes[0, first])
            inertia = inertia + size * (above @ (own.matrix @ reduced.basis))
            carried = size * (above @ own.force)
            mass, moment = mass + carried[:, 0], moment + carried[:, ROTATION]
        first += len(one.effect.parameters)
    rigid = reduced.rigid
    turned = np.diff(rigid[:, ROTATION], prepend=0.0)
    rows = np.concatenate([model.floor_shapes, inertia, model.story_drift])
    rigid_rows = np.concatenate(
        [
            rigid,
            np.column_stack([mass, moment]),
            np.column_stack([np.zeros_like(turned), turned]),
        ]
    )
    names = (*model.floors, *("",) * (len(rows) - len(model.floors)))
    wide = replace(model, floor_shapes=rows, floors=names)
    return replace(system, reduced=replace(reduced, model=wide, rigid_rows=rigid_rows))


def _above(structure: Structure) -> Floats:
    """(s, n) one for what moves along the motion above the middle of each story."""
    levels = np.concatenate([[0.0], structure.levels])
    middle = 0.5 * (levels[:-1] + levels[1:])
    along = structure.axis == structure.direction
    return np.where((structure.position[:, 2] > middle[:, None]) & along, 1.0, 0.0)
