"""What a posterior knows of the error of its model: its size at every draw, and where it is."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.inference.frf_data import frf_data
from femupdate.inference.likelihood import Likelihood
from femupdate.inference.model_error import MODEL_ERROR, Harmonics, LearnedError
from femupdate.measurement.observation import Observation
from femupdate.seeds import Seed, spawn, torch_generator
from femupdate.units import percent

COLUMNS = ("common", "own", "length_hz", "noise")


@dataclass(frozen=True, eq=False)
class SizeDraws:
    """The error of amplitudes or of phases.

    Attributes:
        levels: (chains, draws, 4) standard deviations common to the floors and of each alone in
            ln|H| (or rad), length in Hz, and noise over the stated one: `COLUMNS`.
        mean: (f, k) its mean over the posterior on the observation's floors and frequencies.
    """

    levels: Floats
    mean: Floats

    @property
    def size(self) -> float:
        """Standard deviation at one floor, rms over the draws."""
        return float(np.sqrt(np.square(self.levels[..., :2]).sum(-1).mean()))

    @property
    def present(self) -> float:
        """Share of the draws in which there is an error."""
        return float((self.levels[..., :2] > 0.0).any(-1).mean())


@dataclass(frozen=True, eq=False)
class ErrorDraws:
    """What a posterior knows of the error of its model.

    Attributes:
        amplitude: of ln|H|.
        phase: in rad; None where only |H| was measured.
        first_hz, width_hz: of the band in which it was learned.
    """

    amplitude: SizeDraws
    phase: SizeDraws | None
    first_hz: float
    width_hz: float

    @property
    def harmonics(self) -> Harmonics:
        """Functions of frequency of which the errors are sums."""
        width = self.width_hz
        period, count = MODEL_ERROR.period * width, MODEL_ERROR.harmonics
        return Harmonics(self.first_hz, width, period, count)

    def sentence(self, observation: Observation) -> str:
        """For the user."""
        size = self.amplitude.size
        noise = float(np.median(self.amplitude.levels[..., 3]))
        wide = f" The noise is taken as {noise:.1f} times the stated one." if noise > 1.0 else ""
        if self.amplitude.present < 0.5 or size < 0.01:
            return f"No error of the model shows beside the noise.{wide}"
        turn = ""
        if self.phase is not None and self.phase.present >= 0.5:
            turn = f" and {np.degrees(self.phase.size):.0f} degrees in phase"
        length = float(np.median(self.amplitude.levels[..., 2]))
        return (
            f"The model is off by about {percent(np.expm1(size))} in amplitude{turn}, alike over "
            f"{length:.2g} Hz{_most(self.amplitude.mean, observation)}; the intervals allow for "
            f"it.{wide}"
        )


def errors_as_groups(
    errors: ErrorDraws | None, draws: Mapping[str, Any], grid: Mapping[str, Any]
) -> dict[str, Any]:
    """The netCDF group of a posterior's errors, none where there are none."""
    import xarray as xr

    if errors is None:
        return {}
    content: dict[str, Any] = {}
    for name, error in (("amplitude", errors.amplitude), ("phase", errors.phase)):
        if error is not None:
            content[f"{name}_levels"] = (("chain", "draw", "level"), error.levels)
            content[f"{name}_mean"] = (("floor", "frequency_hz"), error.mean)
    return {
        "/model_error": xr.Dataset(
            content,
            coords={**draws, **grid, "level": list(COLUMNS)},
            attrs={"first_hz": errors.first_hz, "width_hz": errors.width_hz},
        )
    }


def errors_from_groups(tree: Any) -> ErrorDraws | None:
    """What `errors_as_groups` wrote, from the tree of a posterior."""
    if "model_error" not in tree.children:
        return None
    group = tree["model_error"].to_dataset()
    amplitude, phase = (
        SizeDraws(group[f"{name}_levels"].values, group[f"{name}_mean"].values)
        if f"{name}_levels" in group
        else None
        for name in ("amplitude", "phase")
    )
    assert amplitude is not None
    first, width = (float(group.attrs[name]) for name in ("first_hz", "width_hz"))
    return ErrorDraws(amplitude, phase, first, width)


def _most(mean: Floats, observation: Observation) -> str:
    """Where the error is largest: floor and a third of the band."""
    power = np.where(observation.valid, mean, 0.0) ** 2
    seen = np.flatnonzero(observation.valid.any(axis=0))
    thirds = np.array_split(seen, 3)
    worst = max(thirds, key=lambda part: power[:, part].sum())
    floor = observation.floors[int(power[:, worst].sum(axis=1).argmax())]
    low, high = observation.frequency_hz[worst[[0, -1]]]
    return f", most at {floor} between {low:.2g} and {high:.2g} Hz"


def draw_errors(
    likelihood: Likelihood, parameters: Tensor, observation: Observation, seed: Seed
) -> ErrorDraws:
    """Errors of FRFs under base motion at posterior draws (chains, draws, p).

    Args:
        likelihood: of them first, and of all else.
        observation: whose floors and frequencies are wanted.
    """
    amplitude, turned = spawn(seed, 2)
    flat = parameters.flatten(0, 1)
    flat = flat[:: max(1, len(flat) // 200)]
    error, shape, base = likelihood.error.parts[0], tuple(parameters.shape[:2]), likelihood.base
    assert base is not None
    residuals = likelihood.error.apart(likelihood.raw(flat))[0]
    found = _drawn(error, residuals, observation, amplitude, shape)
    rows = [base.names.index(name) for name in observation.floors]
    parts = np.split(found.mean, len(found.mean) // error.floors)
    size, *phases = (SizeDraws(found.levels, mean[rows]) for mean in parts)
    phase = phases[0] if phases else None
    if phase is None and observation.phase is not None:
        # Phases that are not judged: rows that count, of a finer table where there is an error.
        both = frf_data(observation, likelihood.system.floors)
        turns = replace(likelihood, data=(both,), changes=None).raw(flat)[:, both.sd.numel() :]
        whole = replace(both, phase=None).error(None)
        finer = whole.finer(int(whole.log_densities(turns).logsumexp(0).argmax()))
        finer = finer.kept(finer.counting(finer.log_densities(turns)))
        phase = _drawn(finer, turns, observation, turned, shape)
    return ErrorDraws(size, phase, error.harmonics.first_hz, error.harmonics.width_hz)


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
    table = [[getattr(level, name) for name in COLUMNS] for level in error.levels]
    levels = torch.tensor(table, dtype=torch.float64)[drawn]
    rows = torch.multinomial(shares, 1, generator=generator)[:, 0]
    values = error.harmonics.at(torch.from_numpy(observation.frequency_hz))
    found = [
        error.likeliest(error.tame(residuals[rows == row], row), row).sum(0)
        for row in rows.unique().tolist()
    ]
    mean = torch.stack(found).sum(0) @ values.T / len(residuals)
    return SizeDraws(levels.reshape(*shape, -1).numpy(), mean.numpy())
