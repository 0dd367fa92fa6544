"""Tables for spreadsheets: one observation a row, a heading for every column, units in it."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.measurement.observation import on_all_floors
from femupdate.study import Study, write_text
from femupdate.tables import csv_text
from femupdate.workflow.calibrate_draws import predictive_log_frf
from femupdate.workflow.calibration_report import CalibrationReport
from femupdate.workflow.diagnose import DiagnosisReport
from femupdate.workflow.effect_surrogate import open_system
from femupdate.workflow.parameter_titles import parameter_titles
from femupdate.workflow.predict import PredictionReport
from femupdate.workflow.prediction_quantities import TIDY
from femupdate.workflow.render import RenderReport

FOLDER = "tables"


def write_posterior_tables(study: Study, report: CalibrationReport) -> tuple[Path, ...]:
    """Write the parameters, and the frequency responses measured and predicted."""
    posterior = report.posterior
    titles = parameter_titles(report.model.building, posterior.names)
    draws = [*posterior.samples.T]
    names = [*posterior.names]
    if posterior.zeta_samples is not None:
        draws, names = [*draws, posterior.zeta_samples], [*names, "zeta"]
    rows = [
        (name, titles.get(name, "damping ratio"), own.mean(), own.std(), *_quantiles(own))
        for name, own in zip(names, draws, strict=True)
    ]
    head = ("parameter", "of", "mean", "sd", "q05", "median", "q95")
    return (
        _write(study, "posterior", head, rows),
        _write(study, "frf_fit", _FRF, _responses(study, report)),
    )


_FRF = (
    "floor",
    "frequency_hz",
    "measured_abs_h",
    "noise_sd_of_log",
    "used",
    "predicted_abs_h",
    "predicted_q05",
    "predicted_q95",
)


def _responses(study: Study, report: CalibrationReport) -> Iterator[tuple[Any, ...]]:
    """Rows of every floor and frequency; nothing where nothing was measured."""
    posterior, floors = report.posterior, report.model.building.floors
    log = predictive_log_frf(open_system(study, report.model), report.model, posterior)
    low, high = np.quantile(log, [0.05, 0.95], axis=0)
    seen = on_all_floors(posterior.observation, floors)
    frequency = seen.frequency_hz.tolist()
    for row, floor in enumerate(floors):
        columns = (
            np.exp(seen.log_frf[row]),
            seen.noise_sd[row],
            seen.valid[row].astype(int),
            np.exp(log[:, row].mean(axis=0)),
            np.exp(low[row]),
            np.exp(high[row]),
        )
        for values in zip(frequency, *(column.tolist() for column in columns), strict=True):
            yield (floor, *("" if value != value else value for value in values))


def write_prediction_tables(study: Study, report: PredictionReport) -> tuple[Path, ...]:
    """Write peaks and histories of a prediction."""
    summary = report.summary
    rows = [row for one in report.quantities.values() for row in one.tidy()]
    return (
        _write(study, "predicted_peaks", TIDY, rows),
        _write(
            study,
            "floor_histories",
            ("floor", "time_s", "acceleration_mean_m_s2", "acceleration_sd_m_s2"),
            (
                (floor, *values)
                for floor, mean, sd in zip(
                    summary.floors,
                    summary.acceleration_mean,
                    summary.acceleration_sd,
                    strict=True,
                )
                for values in zip(_short(summary.time), _short(mean), _short(sd), strict=True)
            ),
        ),
    )


def write_diagnosis_tables(study: Study, report: DiagnosisReport) -> tuple[Path, ...]:
    """Write the effects that were fitted, and the residuals by floor and band."""
    effects = report.as_dict()["effects"]
    keys = ("name", "place", "probability", "log_evidence_over_none", "size", "size_sd", "unit")
    cells = [
        (cell.floor, *cell.band_hz, cell.excess, cell.p_value)
        for cell in report.diagnosis.residuals
    ]
    return (
        _write(study, "effects", keys, ([one[key] for key in keys] for one in effects)),
        _write(study, "residual_map", ("floor", "from_hz", "to_hz", "excess", "p_value"), cells),
    )


def write_mode_table(study: Study, report: RenderReport) -> Path:
    """Write the modes of the posterior."""
    keys = ("mode", "frequency_hz", "frequency_sd", "direction", "effective_mass", "found")
    rows = [[one[key] for key in keys] for one in report.as_dict()["modes"]]
    return _write(study, "modes", keys, rows)


def _quantiles(values: np.ndarray) -> list[float]:
    return [float(value) for value in np.quantile(values, [0.05, 0.5, 0.95])]


def _short(values: np.ndarray) -> list[str]:
    """Six significant figures: histories are long."""
    return [f"{value:.6g}" for value in values]


def _write(study: Study, name: str, head: Sequence[str], rows: Iterable[Sequence[Any]]) -> Path:
    path = study.path(FOLDER, f"{name}.csv")
    write_text(path, csv_text(head, rows))
    return path
