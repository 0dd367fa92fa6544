"""Frequency responses as measured and as the posterior has them, for pictures, page and tables."""

import numpy as np
from numpy.random import default_rng

from femupdate.arrays import Floats
from femupdate.dynamics.system import System
from femupdate.inference.next_event import drawn_error
from femupdate.inference.posterior import Posterior
from femupdate.measurement.observation import on_all_floors
from femupdate.report.curves import Curve, response_curves
from femupdate.seeds import spawn
from femupdate.workflow.calibrate_draws import predictive_log_frf
from femupdate.workflow.model import StudyModel


def fitted_curves(system: System, model: StudyModel, posterior: Posterior) -> tuple[Curve, ...]:
    """|H| of every floor, the top floor first, measured and predicted."""
    predicted = predictive_log_frf(system, model, posterior)
    seen = on_all_floors(posterior.observation, model.building.floors)
    return response_curves(predicted, seen, _with_errors(model, posterior, predicted))


def _with_errors(
    model: StudyModel, posterior: Posterior, predicted: Floats
) -> tuple[Floats, Floats] | None:
    """(f, k) 5 and 95 % of ln|H| with errors of the model as large as learned, and elsewhere."""
    errors = posterior.model_error
    if errors is None:
        return None
    rows, frequency = posterior.rows(len(predicted), 0), model.frequency_hz.numpy()
    floors = predicted.shape[1]
    streams = spawn(0, len(rows))
    moved = [
        own + drawn_error(errors.amplitude, row, errors, floors, frequency, default_rng(stream))
        for own, row, stream in zip(predicted, rows, streams, strict=True)
    ]
    low, high = np.quantile(moved, [0.05, 0.95], axis=0)
    return low, high
