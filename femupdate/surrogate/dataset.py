"""The training set: parameter samples with their modes, from which FRFs are computed.

Modes take a fortieth of the space of FRFs, and give FRFs for any damping and any grid.
"""

import logging
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from femupdate.dynamics.modes import ModalData, joined
from femupdate.dynamics.system import System
from femupdate.progress import SILENT, Progress
from femupdate.seeds import Seed, torch_generator
from femupdate.storage import check_shapes, read_arrays, write_arrays
from femupdate.surrogate.network import Box
from femupdate.workers import completed

logger = logging.getLogger(__name__)

SHARD = 2500
_FIELDS = {"theta": "np", "omega": "nm", "effect": "nfm", "residual": "nft"}
_UNREADABLE = (KeyError, TypeError, ValueError)


@dataclass(frozen=True)
class ModalDataset:
    """Parameter samples and their modes.

    Attributes:
        theta: (N, p) float64.
        modal: float32 modal data of the N samples.
    """

    theta: Tensor
    modal: ModalData

    def __len__(self) -> int:
        return len(self.theta)


def compute_dataset(
    system: System,
    box: Box,
    folder: Path,
    *,
    samples: int,
    modes: int,
    top_hz: float,
    seed: Seed,
    progress: Progress = SILENT,
    shard: int = SHARD,
) -> ModalDataset:
    """Solve the modes of all samples in shards; valid shards in `folder` are kept.

    Shards are solved wherever work is done, one thread each: small eigenproblems gain nothing
    from threads of their own. Killed half-way, the next call goes on where this one stopped.
    The caller chooses a folder that belongs to this system, box and samples alone.

    Args:
        box: of the parameters, filled evenly.
        folder: of the shards; made where it is missing.
        samples: how many, a Sobol sequence over the box.
        modes: kept for each sample, at most.
        top_hz: top of the frequency grid.
        shard: samples of one.

    Raises:
        StudyError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    scramble = torch_generator(seed).initial_seed()
    engine = torch.quasirandom.SobolEngine(len(box.lower), scramble=True, seed=scramble)
    unit = engine.draw(samples, dtype=torch.float64)
    theta = box.lower + (box.upper - box.lower) * unit
    rows = theta.split(shard)
    paths = [folder / f"{k:04d}.npz" for k in range(len(rows))]
    kept = modes_kept(system, modes)
    shards: dict[int, ModalDataset] = {}
    for k, (path, factors) in enumerate(zip(paths, rows, strict=True)):
        if (there := kept_shard(path, factors, kept)) is not None:
            shards[k] = there
            progress.advance(len(factors))
    missing = [k for k in range(len(rows)) if k not in shards]
    solve = partial(system.modal_data, modes=kept, top_frequency_hz=top_hz)
    for number, modal in completed(solve, [rows[k] for k in missing]):
        k = missing[number]
        _write_shard(paths[k], rows[k], modal.to("cpu", torch.float32))
        shards[k] = _read_shard(paths[k])
        progress.advance(len(rows[k]))
    parts = [shards[k] for k in range(len(rows))]
    theta = torch.cat([part.theta for part in parts])
    return ModalDataset(theta, joined([part.modal for part in parts]))


def kept_shard(path: Path, theta: Tensor, modes: int) -> ModalDataset | None:
    """Return a valid shard of these samples, or None where it is to be computed."""
    if not path.exists():
        return None
    try:
        shard = _read_shard(path)
    except _UNREADABLE as error:
        logger.warning("%s is damaged (%s) and is computed again", path, error)
        return None
    fits = torch.equal(shard.theta, theta) and shard.modal.omega.shape == (len(theta), modes)
    return shard if fits else None


def modes_kept(system: System, most: int) -> int:
    """Modes kept a sample: `most`, or as many as the structure on a rigid base has."""
    return min(most, system.model.size)


def _write_shard(path: Path, theta: Tensor, modal: ModalData) -> None:
    write_arrays(
        path,
        theta=theta.numpy(),
        omega=modal.omega.numpy(),
        # Half precision rounds to 5e-4 of each mode: far below the noise, at half the size.
        effect=modal.effect.numpy().astype(np.float16),
        residual=modal.residual.numpy(),
    )


def _read_shard(path: Path) -> ModalDataset:
    data = read_arrays(path)
    check_shapes(data, _FIELDS)
    theta, omega, effect, residual = (torch.from_numpy(data[name]) for name in _FIELDS)
    return ModalDataset(theta, ModalData(omega, effect.float(), residual))
