"""The error of a model at posterior draws: how large, and on average where."""

from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from femupdate.inference.error_draws import COLUMNS, ErrorDraws, SizeDraws
from femupdate.inference.frf_data import LEARNING, frf_data
from femupdate.inference.likelihood import Likelihood
from femupdate.inference.model_error import ErrorLevel, LearnedError
from femupdate.inference.thresholds import LEARNED_ERROR
from femupdate.measurement.observation import Observation
from femupdate.seeds import Seed, spawn, torch_generator


def draw_errors(
    likelihood: Likelihood, parameters: Tensor, observation: Observation, seed: Seed
) -> ErrorDraws:
    """Errors of FRFs under base motion at posterior draws (chains, draws, p).

    Args:
        likelihood: of them first, and of all else.
        parameters: the draws.
        observation: whose floors and frequencies are wanted.
        seed: of everything random.
    """
    amplitude, turned = spawn(seed, 2)
    flat = parameters.flatten(0, 1)
    flat = flat[:: max(1, len(flat) // LEARNED_ERROR.tried)]
    error, shape, base = likelihood.error.parts[0], tuple(parameters.shape[:2]), likelihood.base
    assert base is not None
    residuals = likelihood.error.apart(likelihood.raw(flat))[0]
    found = _drawn(error, residuals, observation, amplitude, shape)
    rows = [base.names.index(name) for name in observation.floors]
    parts = np.split(found.mean, len(found.mean) // error.floors)
    size, *phases = (SizeDraws(found.levels, mean[rows]) for mean in parts)
    phase = phases[0] if phases else None
    if phase is None and observation.phase is not None:
        phase = _drawn(*_of_phase(likelihood, flat, observation), observation, turned, shape)
    return ErrorDraws(size, phase, error.harmonics.first_hz, error.harmonics.width_hz)


def _of_phase(
    likelihood: Likelihood, parameters: Tensor, observation: Observation
) -> tuple[LearnedError, Tensor]:
    """The error of phases that are not judged, and their residuals (n, f k)."""
    both = frf_data(observation, likelihood.system.floors, believed=LEARNING)
    alone = replace(likelihood, data=(both,)).raw(parameters)
    turns = alone[:, both.sd.numel() :]
    return _that_counts(replace(both, phase=None).error(None), turns), turns


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
    mean = torch.stack(found).sum(0) @ values.T / len(residuals)
    return SizeDraws(levels.reshape(*shape, -1).numpy(), mean.numpy())


def _numbers(level: ErrorLevel) -> list[float]:
    return [getattr(level, name) for name in COLUMNS]
