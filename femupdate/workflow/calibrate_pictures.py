"""Pictures of a posterior."""

from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.inference.posterior import Posterior
from femupdate.measurement.observation import on_all_floors
from femupdate.progress import Progress
from femupdate.study import Study
from femupdate.workflow.calibrate_draws import PREDICTIVE, predictive_log_frf
from femupdate.workflow.model import StudyModel


def draw_posterior(
    study: Study, model: StudyModel, posterior: Posterior, show: Progress
) -> tuple[Path, ...]:
    """FRF fit, pair plot and intervals of a posterior."""
    from femupdate.report import plot_frf
    from femupdate.report.figure import save_figure
    from femupdate.report.plot_intervals import theta_intervals
    from femupdate.report.plot_posterior import SampleSet, posterior_pairs

    show.start("Drawing", 3)
    predicted = _predictive(study, model, posterior)
    low, high = np.quantile(predicted, [0.05, 0.95], axis=0)
    observation = on_all_floors(posterior.observation, model.building.floors)
    names = [_pretty(name) for name in posterior.names]
    bounds = np.column_stack([posterior.lower, posterior.upper])
    label = f"{', '.join(posterior.observation.floors)} ({posterior.likelihood} likelihood)"
    sets = [SampleSet(label, posterior.samples)]
    frf = plot_frf.frf_fit(
        observation.frequency_hz,
        model.building.floors,
        plot_frf.Prediction(predicted.mean(axis=0), low, high),
        plot_frf.Observation(observation.log_frf, observation.noise_sd, observation.valid),
    )
    paths = [save_figure(frf, study.path("pictures", "frf_fit.png"))]
    show.advance()
    pairs = posterior_pairs(sets, names, bounds)
    paths.append(save_figure(pairs, study.path("pictures", "posterior.png")))
    show.advance()
    intervals = theta_intervals(names, sets, bounds)
    paths.append(save_figure(intervals, study.path("pictures", "stiffness_factors.png")))
    show.advance()
    return tuple(paths)


def _predictive(study: Study, model: StudyModel, posterior: Posterior) -> Floats:
    if not model.building.effects:
        return predictive_log_frf(model, posterior)
    from femupdate.workflow.calibrate_effects import open_effects, predictive_with_effects

    ratio, grid = model.building.damping.ratio, model.frequency_hz.numpy()
    system = model.system or open_effects(study, model)
    return predictive_with_effects(system, posterior, ratio, grid, PREDICTIVE)


def _pretty(name: str) -> str:
    return name.replace("theta_", "θ")
