"""Tables for spreadsheets: one observation a row, a heading for every column, units in it."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from femupdate.discrepancy.diagnose import Finding
from femupdate.measurement.observation import on_all_floors
from femupdate.sheets import Sheet
from femupdate.study import Study
from femupdate.workflow.calibrate_draws import predictive_log_frf
from femupdate.workflow.calibration_report import CalibrationReport
from femupdate.workflow.diagnose import DiagnosisReport
from femupdate.workflow.effect_surrogate import open_system
from femupdate.workflow.predict import PredictionReport
from femupdate.workflow.prediction_quantities import TIDY, Quantity, member_rows
from femupdate.workflow.render import RenderReport
from femupdate.workflow.summary import parameter_titles

TABLES = "tables"
"""Folder of them in a study."""


def posterior_tables(study: Study, report: CalibrationReport) -> tuple[Sheet, ...]:
    """The parameters, and the frequency responses measured and predicted."""
    posterior = report.posterior
    titles = parameter_titles(report.model.building, posterior.names)
    draws = [*posterior.samples.T]
    names = [*posterior.names]
    if posterior.zeta_samples is not None:
        draws, names = [*draws, posterior.zeta_samples], [*names, "zeta"]
    rows = [
        (
            name,
            titles.get(name, "damping ratio"),
            float(own.mean()),
            float(own.std()),
            *_quantiles(own),
        )
        for name, own in zip(names, draws, strict=True)
    ]
    head = ("parameter", "of", "mean", "sd", "q05", "median", "q95")
    return (
        Sheet.of("posterior", head, rows),
        *_stiffness(report),
        Sheet.of("frf_fit", _FRF, _responses(study, report)),
    )


def _stiffness(report: CalibrationReport) -> tuple[Sheet, ...]:
    """Stiffness of the stories, where the file gives it; of a frame, `predict` computes it."""
    building, posterior = report.model.building, report.posterior
    known = [getattr(story, "stiffness", None) for story in building.stories]
    if None in known:
        return ()
    places = tuple(building.story_names)
    factors = posterior.samples[:, : len(places)]
    one = Quantity("stiffness", "kN/mm", places, 1e-6 * factors * np.array(known, dtype=float))
    return (Sheet.of("story_stiffness", TIDY, one.tidy()),)


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


def prediction_tables(report: PredictionReport) -> tuple[Sheet, ...]:
    """Peaks, also of members, and histories of a prediction; floor spectra where asked for."""
    summary = report.summary
    rows = [row for one in report.quantities.values() for row in one.tidy()]
    rows += member_rows(report.members)
    return (
        Sheet.of("predicted_peaks", TIDY, rows),
        *_floor_spectra(report),
        Sheet.of(
            "floor_histories",
            ("floor", "time_s", "acceleration_mean_m_s2", "acceleration_sd_m_s2"),
            (
                (floor, *values)
                for floor, mean, sd in zip(
                    summary.floors, summary.acceleration_mean, summary.acceleration_sd, strict=True
                )
                for values in zip(_short(summary.time), _short(mean), _short(sd), strict=True)
            ),
        ),
    )


_SPECTRA = (
    "floor",
    "frequency_hz",
    "damping_ratio",
    "acceleration_mean_m_s2",
    "acceleration_sd_m_s2",
    "acceleration_q05_m_s2",
    "acceleration_q95_m_s2",
)


def _floor_spectra(report: PredictionReport) -> tuple[Sheet, ...]:
    """Response spectra of the ground and of every floor."""
    found = report.floor_spectra
    if found is None:
        return ()
    own, frequency = found.acceleration, found.frequency_hz.tolist()
    ground = [("base", f, found.damping, a) for f, a in zip(frequency, found.base, strict=True)]
    rows = [(*row[:3], float(row[3]), 0.0, float(row[3]), float(row[3])) for row in ground]
    for k, floor in enumerate(report.summary.floors):
        columns = (part[k].tolist() for part in (own.mean, own.sd, own.q05, own.q95))
        rows += [
            (floor, f, found.damping, *values)
            for f, *values in zip(frequency, *columns, strict=True)
        ]
    return (Sheet.of("floor_spectra", _SPECTRA, rows),)


_EFFECTS = (
    "effect",
    "place",
    "in_words",
    "log_evidence_over_none",
    "log_evidence_on_other_data",
    "certified",
    "change_of_frequency",
    "change_of_response",
    "size",
    "size_sd",
    "unit",
    "meaning_of_size",
    "added_mass_t",
    "hidden_by_stiffness_factors",
)


_CELLS = ("floor", "from_hz", "to_hz", "excess", "p_value", "data")


def diagnosis_tables(report: DiagnosisReport) -> tuple[Sheet, ...]:
    """The effects that were fitted, and the residuals by floor and band."""
    cells = [
        (cell.floor, *cell.band_hz, cell.excess, cell.p_value, cell.data)
        for cell in report.diagnosis.residuals
    ]
    return (
        Sheet.of("effects", _EFFECTS, (_effect(one) for one in report.diagnosis.findings)),
        Sheet.of("residual_map", _CELLS, cells),
    )


def _effect(one: Finding) -> tuple[Any, ...]:
    """Size with its unit and meaning; an added mass also in tonnes, where masses are known."""
    first = next(iter(one.placed.effect.parameters), None)
    return (
        one.placed.effect.title,
        one.placed.place,
        one.in_words,
        one.evidence.log_evidence,
        "" if one.tested is None else one.tested.log_e_value,
        "" if one.tested is None else one.tested.certified,
        one.changes.frequency,
        one.changes.response,
        "" if first is None else one.size,
        "" if first is None else one.size_sd,
        "" if first is None else first.unit,
        "" if first is None else first.text,
        "" if one.mass is None else 1e-3 * one.mass,
        one.score.absorbed,
    )


def mode_tables(report: RenderReport) -> tuple[Sheet, ...]:
    """The modes of the posterior."""
    columns = {
        "mode": "mode",
        "frequency_hz": "frequency_hz",
        "frequency_sd_hz": "frequency_sd",
        "direction": "direction",
        "effective_mass_share": "effective_mass",
        "share_of_draws_recognised": "found",
        "influence": "influence",
        "influence_rank": "influence_rank",
    }
    rows = [[one[key] for key in columns.values()] for one in report.as_dict()["modes"]]
    return (Sheet.of("modes", tuple(columns), rows),)


def _quantiles(values: np.ndarray) -> list[float]:
    return [float(value) for value in np.quantile(values, [0.05, 0.5, 0.95])]


def _short(values: np.ndarray) -> list[float]:
    """Six significant figures: histories are long."""
    return [float(f"{value:.6g}") for value in values]
