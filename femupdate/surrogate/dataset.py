"""The training set: parameter samples with their modes, from which FRFs are computed.

Modes take a fortieth of the space of FRFs, and give FRFs for any damping and any grid.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.dynamics.modes import ModalData, joined
from femupdate.dynamics.system import System
from femupdate.progress import SILENT, Progress
from femupdate.seeds import Seed, torch_generator
from femupdate.surrogate.network import Box
from femupdate.workers import in_threads

_PIECE = 2500  # samples that are solved together


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
    *,
    samples: int,
    modes: int,
    top_hz: float,
    seed: Seed,
    progress: Progress = SILENT,
) -> ModalDataset:
    """Solve the modes of all samples, in pieces of one thread each.

    Small eigenproblems gain nothing from threads of their own.

    Args:
        box: of the parameters, filled evenly.
        samples: how many, a Sobol sequence over the box.
        modes: kept for each sample, at most.
        top_hz: top of the frequency grid.
        progress: of so many pieces.
    """
    scramble = torch_generator(seed).initial_seed()
    engine = torch.quasirandom.SobolEngine(len(box.lower), scramble=True, seed=scramble)
    unit = engine.draw(samples, dtype=torch.float64)
    theta = box.lower + (box.upper - box.lower) * unit
    kept = modes_kept(system, modes)

    def solved(rows: Tensor) -> ModalData:
        return system.modal_data(rows, modes=kept, top_frequency_hz=top_hz).to("cpu", torch.float32)

    pieces = theta.split(_PIECE)
    progress.start("Solving modes of parameter samples", len(pieces))
    return ModalDataset(theta, joined(in_threads(solved, pieces, progress)))


def modes_kept(system: System, most: int) -> int:
    """Modes kept a sample: `most`, or as many as the structure on a rigid base has."""
    return min(most, system.model.size)
