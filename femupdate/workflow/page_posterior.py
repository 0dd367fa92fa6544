"""Sections of the page on the data, the fit and the posterior."""

import numpy as np
from numpy.random import default_rng

from femupdate.arrays import Floats
from femupdate.inference.next_event import drawn_error
from femupdate.inference.posterior import Posterior
from femupdate.measurement.observation import Observation, on_all_floors
from femupdate.report.page import Block, Chart, Remarks, Section, Table, Text
from femupdate.report.page_charts import (
    Axis,
    Band,
    Curve,
    Interval,
    correlation_figure,
    curve_figure,
    interval_figure,
    pairs_figure,
)
from femupdate.seeds import spawn
from femupdate.workflow.calibrate_draws import predictive_log_frf
from femupdate.workflow.calibrate_notes import error_notes
from femupdate.workflow.page_parts import PageStudy, figures
from femupdate.workflow.summary import identified, kept_summary

_ALONE, _NEXT = "parameters alone, 5 to 95 %", "with the error of the model, 5 to 95 %"
_PAIR_DRAWS = 300
_MOST_PAIRS = 7  # parameters of which every pair is drawn


def data_section(page: PageStudy) -> Section:
    """What was measured, and how good it is."""
    posterior = page.posterior
    if posterior is None:
        return Section("data", "Data", ())
    seen = posterior.observation
    if not seen.valid.any():
        return Section("data", "Data", (Text((f"Identified modes from {seen.source}.",)),))
    lead = (
        f"Frequency responses of {', '.join(seen.floors)} from {seen.source}, over "
        f"{seen.frequency_hz.min():.3g} to {seen.frequency_hz.max():.3g} Hz."
    )
    rows = tuple(_floor_row(seen, row) for row in range(len(seen.floors)))
    blocks: list[Block] = [
        Text((lead,)),
        Table(
            name="data_quality",
            caption="Quality of the data by floor",
            head=("floor", "points used", "of", "median noise of ln|H|", "median coherence"),
            rows=rows,
            note="Points are left out for low coherence or little power in the base motion.",
        ),
    ]
    if seen.coherence is not None:
        blocks.append(_coherence(seen))
    if seen.notes:
        blocks.append(Remarks(seen.notes))
    return Section("data", "Data", tuple(blocks))


def _floor_row(seen: Observation, row: int) -> tuple[str, ...]:
    used = seen.valid[row]
    noise = np.median(seen.noise_sd[row][used]) if used.any() else np.nan
    coherence = "not measured"
    if seen.coherence is not None and used.any():
        coherence = f"{np.nanmedian(seen.coherence[row][used]):.3f}"
    return (seen.floors[row], str(int(used.sum())), str(used.size), f"{noise:.3f}", coherence)


def _coherence(seen: Observation) -> Chart:
    assert seen.coherence is not None
    up, across = Axis(title="coherence with the base", limits=(0.0, 1.02)), _frequency(seen)
    curves = [Curve(x=seen.frequency_hz, mean=own, name="coherence") for own in seen.coherence]
    panels = tuple(
        (floor, curve_figure(curve, across, up))
        for floor, curve in zip(seen.floors[::-1], curves[::-1], strict=True)
    )
    return Chart(name="coherence", caption="Coherence", panels=panels, height=240)


def _frequency(seen: Observation) -> Axis:
    """Over the frequencies that are used at some floor."""
    used = seen.frequency_hz[seen.valid.any(axis=0)]
    used = used if used.size else seen.frequency_hz
    return Axis(title="frequency, Hz", log=True, limits=(float(used.min()), float(used.max())))


def fit_section(page: PageStudy) -> Section:
    """Measured responses over those of the posterior."""
    posterior = page.posterior
    if posterior is None:
        return Section("fit", "Fit", ())
    predicted = predictive_log_frf(page.system, page.model, posterior)
    low, high = np.quantile(predicted, [0.05, 0.95], axis=0)
    erring = _with_errors(page, posterior, predicted)
    floors = page.model.building.floors
    seen = on_all_floors(posterior.observation, floors)
    up = Axis(title="|H|, floor over base", log=True)
    panels = []
    for row, floor in reversed(list(enumerate(floors))):
        bands = [Band(name=_ALONE, low=np.exp(low[row]), high=np.exp(high[row]))]
        if erring is not None:
            wide = (np.exp(edge[row]) for edge in erring)
            bands.insert(0, Band(name=_NEXT, low=next(wide), high=next(wide), outer=True))
        measured = np.exp(seen.log_frf[row])
        used = np.where(seen.valid[row], measured, np.nan)
        curve = Curve(
            x=seen.frequency_hz,
            mean=np.exp(predicted[:, row].mean(axis=0)),
            bands=tuple(bands),
            measured=used,
            measured_sd=measured * seen.noise_sd[row],
            ignored=np.where(seen.valid[row], np.nan, measured),
        )
        panels.append((floor, curve_figure(curve, _frequency(seen), up)))
    chart = Chart(
        name="frequency_responses",
        caption="Frequency responses, measured and predicted",
        panels=tuple(panels),
        note=_band_note(low, high, erring),
        height=420,
    )
    blocks: list[Block] = []
    if posterior.warnings:
        blocks.append(Remarks(posterior.warnings, warning=True))
    told = (*error_notes(posterior), *_kept_check(page))
    if told:
        blocks.append(Remarks(told))
    return Section("fit", "Fit", (*blocks, chart))


def _with_errors(
    page: PageStudy, posterior: Posterior, predicted: Floats
) -> tuple[Floats, Floats] | None:
    """(f, k) 5 and 95 % of ln|H| with errors of the model as large as learned, and elsewhere."""
    errors = posterior.model_error
    if errors is None:
        return None
    rows, frequency = posterior.rows(len(predicted), 0), page.model.frequency_hz.numpy()
    floors = predicted.shape[1]
    streams = spawn(0, len(rows))
    moved = [
        own + drawn_error(errors.amplitude, row, errors, floors, frequency, default_rng(stream))
        for own, row, stream in zip(predicted, rows, streams, strict=True)
    ]
    low, high = np.quantile(moved, [0.05, 0.95], axis=0)
    return low, high


def _kept_check(page: PageStudy) -> tuple[str, ...]:
    """Posterior predictive p-value, where the calibration kept one."""
    kept = kept_summary(page.study).get("posterior_predictive_p") or {}
    if "whole" not in kept:
        return ()
    return (
        f"Posterior predictive p-value {kept['whole']:.2g}: the share of data made by the model, "
        "with the errors that are allowed for, that agree less well with it than the measured.",
    )


def _band_note(low: Floats, high: Floats, erring: tuple[Floats, Floats] | None) -> str:
    """The widths of the bands in words, which may be too thin to see."""
    width = 50.0 * float(np.median(high - low))
    note = f"The band of the parameters is ±{width:.2g} % of the amplitude wide in its median"
    thin = "; it is thinner than the line that is drawn." if width < 2.0 else "."
    if erring is not None:
        wide = 50.0 * float(np.median(erring[1] - erring[0]))
        thin += f" With the error of the model, as of another measurement, it is ±{wide:.2g} %."
    return f"{note}{thin} Bars at the points are one standard deviation of their noise."


def posterior_section(page: PageStudy) -> Section:
    """Factors by story, what the data leave open, and pairs."""
    posterior = page.posterior
    if posterior is None:
        text = "There is no posterior yet; run femupdate calibrate."
        return Section("posterior", "Posterior", (Text((text,)),))
    lead = (
        f"{posterior.drawn.likelihood.capitalize()} posterior, "
        f"{'; '.join(posterior.drawn.sentences())}. A factor of 1 is the stiffness in the "
        "building file."
    )
    found = identified(posterior)
    sentences = found.sentences() or ("The data determine every parameter.",)
    blocks: list[Block] = [
        Text((lead,)),
        _table(page, posterior),
        _intervals(page, posterior),
        Remarks(tuple(sentences)),
        *_relations(page, posterior),
    ]
    return Section("posterior", "Posterior", tuple(blocks))


def _table(page: PageStudy, posterior: Posterior) -> Table:
    rows = [
        (page.titles[name], name, *figures(draws), f"{low:.3g} to {high:.3g}")
        for name, draws, low, high in zip(
            posterior.names, posterior.samples.T, posterior.lower, posterior.upper, strict=True
        )
    ]
    zeta = posterior.zeta_samples
    if zeta is not None:
        rows.append(("damping ratio", "zeta", *figures(zeta), ""))
    return Table(
        name="posterior",
        caption="Parameters",
        head=("of", "parameter", "mean", "sd", "5 %", "95 %", "prior"),
        rows=tuple(rows),
    )


def _intervals(page: PageStudy, posterior: Posterior) -> Chart:
    """Factors alone, and over their prior ranges, on which intervals may be too short to see."""
    factors = [k for k, name in enumerate(posterior.names) if "@" not in name]
    draws = posterior.samples[:, factors]
    low, high = np.quantile(draws, [0.05, 0.95], axis=0)
    rows = [page.titles[posterior.names[k]] for k in factors]
    own = Interval(name="mean, 5 to 95 %", mean=draws.mean(axis=0), low=low, high=high)
    across, ranges = "stiffness over that in the building file", (posterior.lower, posterior.upper)
    prior = (ranges[0][factors], ranges[1][factors])
    return Chart(
        name="stiffness_factors",
        caption="Stiffness factors",
        panels=(
            ("posterior", interval_figure(rows, [own], across)),
            ("with the prior range", interval_figure(rows, [own], across, prior)),
        ),
        height=120 + 42 * len(factors),
    )


def _relations(page: PageStudy, posterior: Posterior) -> tuple[Chart, ...]:
    """Correlations, and draws by pairs where there are not too many."""
    # Without the meaning of an effect's parameter.
    names = [page.titles[name].partition(": ")[0] for name in posterior.names]
    if len(names) < 2:
        return ()
    matrix = np.atleast_2d(np.corrcoef(posterior.samples.T))
    panels = [("correlation", correlation_figure(names, matrix))]
    note = ""
    if len(names) <= _MOST_PAIRS:
        draws = posterior.thinned(_PAIR_DRAWS, 0)[0]
        panels.append(("draws", pairs_figure(names, draws)))
        note = f"{len(draws)} of {len(posterior.samples)} draws are shown."
    return (
        Chart(
            name="pairs",
            caption="How the parameters hang together",
            panels=tuple(panels),
            note=note,
            height=200 + 60 * min(len(names), 8),
        ),
    )
