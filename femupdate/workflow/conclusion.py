"""What is concluded from posterior draws, however they were drawn, and what is told of it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.errors import InferenceError
from femupdate.inference.diagnostics import r_hat
from femupdate.inference.event_scatter import LearnedScatter, learned_scatter
from femupdate.inference.frf_data import base_logs
from femupdate.inference.likelihood import missed
from femupdate.inference.posterior import Posterior
from femupdate.measurement.observation import Observation
from femupdate.seeds import Seed, spawn
from femupdate.workflow.calibrate_draws import (
    against_data,
    against_modes,
    posterior_of,
    with_error_of_all,
    with_own_errors,
)
from femupdate.workflow.calibrate_notes import (
    error_notes,
    judgement,
    large_error,
    overstated_noise,
    tolerance_notes,
)
from femupdate.workflow.calibration_report import CalibrationReport
from femupdate.workflow.kinds import Measured
from femupdate.workflow.likelihoods import CalibrationSettings, Sampled, beyond_prior
from femupdate.workflow.model import StudyModel
from femupdate.workflow.summary import identified

_STIFFNESS, _DAMPING = 0.4, 1.5  # ln, to either side of the posterior's mean that is tried
_POINTS, _ROUNDS = 17, 4  # of a grid of each, each grid about what the one before found,


def concluded(
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    sampled: Sampled,
    seeds: Sequence[Seed],
    path: Path,
) -> CalibrationReport:
    """The posterior, beside the data, and what is to be said of it; nothing is written yet.

    Args:
        model: with the effects that the building lists.
        seeds: of damping ratios, checks, scatter between runs, and what all members err by.
        path: where the posterior goes.

    Raises:
        InferenceError: factors outside of the prior meet the data far better than all inside.
    """
    damping, checking, between, erring = seeds
    alike, second = erring, spawn(erring, 1)[0]
    latent = None if model.shared is None else sampled.latent
    posterior = posterior_of(model, measured, settings, sampled, latent, damping)
    fitting = against_data(model, measured, posterior, sampled, checking)
    warnings = (
        *measured.left_out,
        *measured.doubts,
        *sampled.warnings,
        *judgement(posterior, fitting),
    )
    if large_error(posterior, fitting):
        best = torch.from_numpy(posterior.values.reshape(-1, posterior.values.shape[-1]))
        best = best[[int(posterior.log_likelihood.argmax())]]
        outside = beyond_prior(model, measured, best, settings)
        if not settings.anyway and any("[prior.theta" in told for told in outside):
            raise InferenceError(f"{outside[0]} --anyway keeps draws that do not hold this answer.")
        warnings = (*outside, *warnings)
    scatter = scatter_of_runs(model, measured.runs, posterior, between, measured.levels)
    posterior = replace(posterior, warnings=warnings, scatter=scatter)
    posterior = with_own_errors(with_error_of_all(posterior, model, alike), model, second)
    found = identified(posterior)
    # The decisive come first.
    notes = (
        *warnings,
        *error_notes(posterior, fitting.errors),
        *tolerance_notes(posterior),
        *(() if sampled.least_noise else overstated_noise(fitting, measured.assumes_noise)),
        *(() if scatter is None else (scatter.sentence(),)),
        *found.sentences(),
        *against_modes(model, measured, posterior, checking),
        *measured.notes,
        *sampled.notes,
    )
    return CalibrationReport(
        model=model,
        posterior=posterior,
        path=path,
        r_hat=r_hat(posterior.theta),
        identified=found,
        misfit=fitting.misfit,
        check=fitting.check,
        notes=notes,
        seconds=0.0,
        invalid=sum(run.invalid for run in sampled.runs),
        files=(),
        details=sampled.notes,
    )


def scatter_of_runs(
    model: StudyModel,
    runs: Sequence[Observation],
    posterior: Posterior,
    seed: Seed,
    levels: Sequence[float] = (),
) -> LearnedScatter | None:
    """How much stiffness and damping differ between runs; None of a single one.

    Each run moves the stiffness factors of the posterior's mean together, and its damping, by a
    likelihood of its own, in which the model may err.

    Args:
        runs: FRFs under base motion, a run each.
        levels: of the runs, in doublings above the first; all alike by default.
    """
    if len(runs) < 2:
        return None
    both = zip(runs, levels or [0.0] * len(runs), strict=True)
    found = np.array([_moments(model, run, level, posterior) for run, level in both])
    return learned_scatter(found[:, 0], found[:, 1], posterior.values.shape[:2], seed)


def _moments(model: StudyModel, run: Observation, level: float, posterior: Posterior) -> Floats:
    """Mean and standard deviation (2, 2) of ln stiffness and ln damping over the posterior's."""
    data, parameters = base_logs(run, model.system), posterior.parameters
    # Errors of the model that all runs share, such as a mesh's, do not move one from another.
    error = data.error(None)
    mean = parameters.split(torch.from_numpy(posterior.values.mean(axis=(0, 1))[None]))
    theta, zeta = model.system.at_level(mean.theta, mean.zeta, mean.sizes, level)

    def judge(moved: Tensor) -> Tensor:
        factors = theta * moved[:, :1].exp()
        damped = (zeta * moved[:, 1:].exp()).clamp_max(0.99)
        known = factors, damped[:, 0], mean.sizes.expand(len(moved), -1)
        left = missed((data,), model.system, known)
        # A row that is unlikely where least is left is so everywhere.
        best = left.square().sum(1).argsort()[:9]
        rows = error.counting(error.log_densities(left[best]))
        return error.kept(rows).log_density(left)

    return moments_on_grid(judge, parameters.of("damping").size > 0)


def moments_on_grid(judge: Callable[[Tensor], Tensor], damping: bool) -> Floats:
    """Mean and standard deviation (2, 2) of a density over two coordinates.

    Args:
        judge: log density (n,) of ln stiffness and ln damping (n, 2).
        damping: whether the second is free; else it is zero, and its deviation infinite.
    """
    centre, half = np.zeros(2), np.array([_STIFFNESS, _DAMPING * damping])
    mean, sd = centre, half
    for _ in range(_ROUNDS):
        axes = [np.linspace(c - h, c + h, _POINTS) for c, h in zip(centre, half, strict=True)]
        points = np.stack(np.meshgrid(*(axes if damping else (axes[0], [0.0]))), axis=-1)
        points = points.reshape(-1, 2)
        weight = torch.softmax(judge(torch.from_numpy(points)), dim=0).numpy()
        mean = weight @ points
        sd = np.sqrt(weight @ (points - mean) ** 2)
        cell = 2.0 * half / (_POINTS - 1)
        centre, half = mean, np.minimum(half, np.maximum(4.0 * sd, 2.0 * cell))
    return np.array([mean, np.where([True, damping], sd, np.inf)])
