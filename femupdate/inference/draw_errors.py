"""The error of a model at posterior draws: how large, and on average where."""

from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from femupdate.inference.error_draws import COLUMNS, ErrorDraws, SizeDraws
from femupdate.inference.learned import learned_error
from femupdate.inference.likelihood import DataLikelihood
from femupdate.inference.model_error import ErrorLevel, LearnedError
from femupdate.inference.thresholds import LEARNED_ERROR
from femupdate.measurement.observation import Observation
from femupdate.seeds import Seed, spawn, torch_generator


class Erring(Protocol):
    """A likelihood that learns what its model errs by in FRFs under base motion."""

    @property
    def data(self) -> DataLikelihood:
        """Of the observation, as if the model were right."""
        ...

    @property
    def error(self) -> LearnedError:
        """What the model may err by, of one part for ln|H| and one for phases that it judges."""
        ...

    @property
    def floors(self) -> tuple[str, ...] | None:
        """Those of the error, the observation's among them; None for just these."""
        ...

    def missed(self, parameters: Tensor) -> Tensor:
        """Residuals (n, p f k) of parameters (n, p), predicted less observed, for that error."""
        ...


def draw_errors(
    likelihood: Erring, parameters: Tensor, observation: Observation, seed: Seed
) -> ErrorDraws:
    """Errors at posterior draws (chains, draws, p)."""
    amplitude, turned = spawn(seed, 2)
    flat = parameters.flatten(0, 1)
    flat = flat[:: max(1, len(flat) // LEARNED_ERROR.tried)]
    error, shape = likelihood.error, tuple(parameters.shape[:2])
    found = _drawn(error, likelihood.missed(flat), observation, amplitude, shape)
    known = likelihood.floors or observation.floors
    rows = [known.index(name) for name in observation.floors]
    parts = np.split(found.mean, len(found.mean) // error.floors)
    size, *phases = (SizeDraws(found.levels, mean[rows]) for mean in parts)
    phase = phases[0] if phases else None
    if phase is None and observation.phase is not None:
        whole = learned_error(likelihood.data, observation)
        turns = likelihood.data.phase_residuals(flat, observation)
        phase = _drawn(_that_counts(whole, turns), turns, observation, turned, shape)
    return ErrorDraws(size, phase, error.harmonics.first_hz, error.harmonics.width_hz)


def _that_counts(whole: LearnedError, residuals: Tensor) -> LearnedError:
    """The rows that count at residuals (n, f k), of a finer table where there is an error."""
    finer = whole.finer(int(whole.log_densities(residuals).logsumexp(0).argmax()))
    return finer.kept(finer.counting(finer.log_densities(residuals)))


def _drawn(
    error: LearnedError,
    residuals: Tensor,
    observation: Observation,
    seed: Seed,
    shape: tuple[int, ...],
) -> SizeDraws:
    shares = torch.softmax(error.log_densities(residuals), dim=1)
    generator, count = torch_generator(seed), shape[0] * shape[1]
    drawn = torch.multinomial(shares.mean(0), count, replacement=True, generator=generator)
    levels = torch.tensor([_numbers(level) for level in error.levels], dtype=torch.float64)[drawn]
    rows = torch.multinomial(shares, 1, generator=generator)[:, 0]
    values = error.harmonics.at(torch.from_numpy(observation.frequency_hz))
    found = [
        error.likeliest(error.tame(residuals[rows == row], row), row).sum(0)
        for row in rows.unique().tolist()
    ]
    mean = -torch.stack(found).sum(0) @ values.T / len(residuals)
    return SizeDraws(levels.reshape(*shape, -1).numpy(), mean.numpy())


def _numbers(level: ErrorLevel) -> list[float]:
    return [getattr(level, name) for name in COLUMNS]
