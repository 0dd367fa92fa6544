"""The error of a model at posterior draws: how large, and on average where."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from femupdate.inference.error_draws import COLUMNS, ErrorDraws, SizeDraws
from femupdate.inference.learned import LearnedLikelihood, learned_error
from femupdate.inference.model_error import ErrorLevel, LearnedError
from femupdate.inference.thresholds import LEARNED_ERROR
from femupdate.measurement.observation import Observation
from femupdate.seeds import Seed, spawn, torch_generator


def draw_errors(
    likelihood: LearnedLikelihood, parameters: Tensor, observation: Observation, seed: Seed
) -> ErrorDraws:
    """Errors at posterior draws (chains, draws, p)."""
    amplitude, turned = spawn(seed, 2)
    flat = parameters.flatten(0, 1)
    flat = flat[:: max(1, len(flat) // LEARNED_ERROR.tried)]
    residuals = likelihood.data.residuals(flat)
    harmonics = likelihood.error.harmonics
    shape = tuple(parameters.shape[:2])
    phase = None
    if observation.phase is not None:
        whole = learned_error(likelihood.data, observation)
        turns = likelihood.data.phase_residuals(flat, observation)
        short = _that_counts(whole, turns)
        phase = _drawn(short, turns, observation, turned, shape)
    return ErrorDraws(
        _drawn(likelihood.error, residuals, observation, amplitude, shape),
        phase,
        harmonics.first_hz,
        harmonics.width_hz,
    )


def errors_in_parts(
    error: LearnedError,
    residuals: Tensor,
    floors: Sequence[str],
    observation: Observation,
    draws: int,
    seed: Seed,
) -> ErrorDraws:
    """Errors at posterior draws, of amplitudes and of phases from one table of what they may be.

    Args:
        error: the table, of one part for ln|H| and one for phases where these were compared.
        residuals: (n, p f k) at some of the draws.
        floors: the f of them, the observation's among them.
        observation: for its floors and frequencies.
        draws: how many there are.
        seed: of everything random.
    """
    both = _drawn(error, residuals, observation, seed, (1, draws))
    parts = np.split(both.mean, len(both.mean) // error.floors)
    rows = [floors.index(name) for name in observation.floors]
    amplitude, *phase = (SizeDraws(both.levels, mean[rows]) for mean in parts)
    harmonics = error.harmonics
    return ErrorDraws(
        amplitude, phase[0] if phase else None, harmonics.first_hz, harmonics.width_hz
    )


def _that_counts(whole: LearnedError, residuals: Tensor) -> LearnedError:
    """The rows that count at residuals (n, f k), of a finer table where there is an error."""
    densities = whole.log_densities(residuals)
    row = int(densities.logsumexp(0).argmax())
    if row == 0:
        return whole.kept(whole.counting(densities))
    finer = whole.finer(row)
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
    found = [error.likeliest(residuals[rows == row], row).sum(0) for row in rows.unique().tolist()]
    mean = -torch.stack(found).sum(0) @ values.T / len(residuals)
    return SizeDraws(levels.reshape(*shape, -1).numpy(), mean.numpy())


def _numbers(level: ErrorLevel) -> list[float]:
    return [getattr(level, name) for name in COLUMNS]
