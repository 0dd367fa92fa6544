"""Tables for spreadsheets: one observation a row, a heading for every column, units in it."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from femupdate.arrays import Floats
from femupdate.discrepancy.diagnose import Finding
from femupdate.effects.effect import Parameter
from femupdate.inference.data import Cell
from femupdate.sheets import Sheet
from femupdate.study import Study
from femupdate.workflow.calibration_report import CalibrationReport
from femupdate.workflow.diagnose import DiagnosisReport
from femupdate.workflow.fitted_curves import fitted_curves
from femupdate.workflow.mesh_error import open_system
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
    draws, names = posterior.samples.T, posterior.names
    if posterior.zeta_samples is not None:
        draws, names = np.vstack([draws, posterior.zeta_samples]), (*names, "zeta")
    q05, median, q95 = np.quantile(draws, [0.05, 0.5, 0.95], axis=1)
    parameters = {
        "parameter": names,
        "of": [titles.get(name, "damping ratio") for name in names],
        "mean": [own.mean() for own in draws],
        "sd": [own.std() for own in draws],
        "q05": q05,
        "median": median,
        "q95": q95,
    }
    return (
        _sheet("posterior", parameters),
        *_stiffness(report),
        _responses(study, report),
    )


def _sheet(name: str, columns: Mapping[str, Any]) -> Sheet:
    """A table by the values of its columns, of any shape; a cell without a number stays blank."""
    cells = [["" if v != v else v for v in np.ravel(own).tolist()] for own in columns.values()]
    return Sheet.of(name, tuple(columns), zip(*cells, strict=True))


def _by_floor(
    name: str, floors: Sequence[str], axis: str, points: ArrayLike, columns: Mapping[str, Any]
) -> Sheet:
    """A table with a row for every floor and point of an axis, from columns (f, n)."""
    count = np.size(points)
    places = {"floor": np.repeat(np.array(floors), count), axis: np.tile(points, len(floors))}
    return _sheet(name, {**places, **columns})


def _stiffness(report: CalibrationReport) -> tuple[Sheet, ...]:
    """Stiffness of the stories, where the file gives it; of a frame, `predict` computes it."""
    building, posterior = report.model.building, report.posterior
    known = [getattr(story, "stiffness", None) for story in building.stories]
    if None in known:
        return ()
    places = tuple(building.story_names)
    factors = posterior.of("stiffness").samples
    one = Quantity("stiffness", "kN/mm", places, 1e-6 * factors * np.array(known, dtype=float))
    return (Sheet.of("story_stiffness", TIDY, one.tidy()),)


def _responses(study: Study, report: CalibrationReport) -> Sheet:
    """Measured and predicted |H| of every floor and frequency, blank where nothing was measured."""
    system = open_system(study, report.model)
    curves = fitted_curves(system, report.model, report.posterior)[::-1]
    columns = {
        "measured_abs_h": [one.measured for one in curves],
        "noise_sd_of_log": [one.noise for one in curves],
        "used": [np.asarray(one.used, dtype=int) for one in curves],
        "predicted_abs_h": [one.mean for one in curves],
        "predicted_q05": [one.bands[-1].low for one in curves],
        "predicted_q95": [one.bands[-1].high for one in curves],
    }
    floors = [one.title for one in curves]
    return _by_floor("frf_fit", floors, "frequency_hz", curves[0].x, columns)


def prediction_tables(report: PredictionReport) -> tuple[Sheet, ...]:
    """Peaks, also of members, and histories of a prediction; floor spectra where asked for."""
    summary = report.summary
    rows = [row for one in report.quantities.values() for row in one.tidy()]
    histories = {
        "acceleration_mean_m_s2": _short(summary.acceleration_mean),
        "acceleration_sd_m_s2": _short(summary.acceleration_sd),
        "parameters_mean_m_s2": _short(report.alone.acceleration_mean),
        "parameters_sd_m_s2": _short(report.alone.acceleration_sd),
    }
    return (
        Sheet.of("predicted_peaks", TIDY, [*rows, *member_rows(report.members)]),
        *_floor_spectra(report),
        _by_floor("floor_histories", summary.floors, "time_s", _short(summary.time), histories),
    )


def _floor_spectra(report: PredictionReport) -> tuple[Sheet, ...]:
    """Response spectra of the ground and of every floor."""
    found = report.floor_spectra
    if found is None:
        return ()
    own, floors = found.acceleration, ("base", *report.summary.floors)
    columns = {
        "damping_ratio": np.full((len(floors), len(found.base)), found.damping),
        "acceleration_mean_m_s2": np.vstack([found.base, own.mean]),
        "acceleration_sd_m_s2": np.vstack([0.0 * found.base, own.sd]),
        "acceleration_q05_m_s2": np.vstack([found.base, own.q05]),
        "acceleration_q95_m_s2": np.vstack([found.base, own.q95]),
    }
    return (_by_floor("floor_spectra", floors, "frequency_hz", found.frequency_hz, columns),)


def diagnosis_tables(report: DiagnosisReport) -> tuple[Sheet, ...]:
    """The effects that were fitted, and the residuals by floor and band."""
    found = report.diagnosis
    return (
        _listed("effects", _EFFECTS, found.findings),
        _listed("residual_map", _RESIDUALS, found.residuals),
    )


def _listed(name: str, columns: Mapping[str, Callable[[Any], Any]], rows: Iterable[Any]) -> Sheet:
    """A table by what its columns hold of everything listed; None stays blank."""
    return Sheet.of(
        name, tuple(columns), ([cell(one) for cell in columns.values()] for one in rows)
    )


def _of_first(get: Callable[[Finding, Parameter], Any]) -> Callable[[Finding], Any]:
    """What is told of an effect's first parameter; None of one that is there or not."""

    def cell(one: Finding) -> Any:
        first = next(iter(one.placed.effect.parameters), None)
        return None if first is None else get(one, first)

    return cell


_EFFECTS: Mapping[str, Callable[[Finding], Any]] = {
    "effect": lambda one: one.placed.effect.title,
    "place": lambda one: one.placed.place,
    "in_words": lambda one: one.in_words,
    "log_evidence_over_none": lambda one: one.evidence.log_evidence,
    "log_evidence_on_other_data": lambda one: one.tested and one.tested.log_e_value,
    "certified": lambda one: one.tested and one.tested.certified,
    "change_of_frequency": lambda one: one.changes.frequency,
    "change_of_response": lambda one: one.changes.response,
    "size": _of_first(lambda one, first: one.size),
    "size_sd": _of_first(lambda one, first: one.size_sd),
    "unit": _of_first(lambda one, first: first.unit),
    "meaning_of_size": _of_first(lambda one, first: first.text),
    "added_mass_t": lambda one: None if one.mass is None else 1e-3 * one.mass,
    "hidden_by_stiffness_factors": lambda one: one.score.absorbed,
}
_RESIDUALS: Mapping[str, Callable[[Cell], Any]] = {
    "floor": lambda cell: cell.floor,
    "from_hz": lambda cell: cell.band_hz[0],
    "to_hz": lambda cell: cell.band_hz[1],
    "excess": lambda cell: cell.excess,
    "p_value": lambda cell: cell.p_value,
    "data": lambda cell: cell.data,
}


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


def _short(values: Floats) -> Floats:
    """Six significant figures: histories are long."""
    return np.array([float(f"{value:.6g}") for value in np.ravel(values)])
