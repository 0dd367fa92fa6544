"""Sections of the page on the data, the fit and the posterior."""

from collections.abc import Sequence

import numpy as np

from femupdate.inference.posterior import Posterior
from femupdate.measurement.observation import Observation
from femupdate.report.curves import Curve, Interval
from femupdate.report.page import Block, Chart, Remarks, Section, Text
from femupdate.report.page_charts import (
    correlation_figure,
    curve_figure,
    interval_figure,
    pairs_figure,
)
from femupdate.tables import Table
from femupdate.workflow.calibrate_notes import error_notes
from femupdate.workflow.calibration_report import fitted_curves
from femupdate.workflow.page_parts import PageStudy
from femupdate.workflow.summary import identified, kept_summary, parameter_table

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
        Table.of(
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
    curves = [
        Curve(
            title=floor,
            across="frequency, Hz",
            up="coherence with the base",
            x=seen.frequency_hz,
            mean=own,
            name="coherence",
        )
        for floor, own in zip(seen.floors[::-1], seen.coherence[::-1], strict=True)
    ]
    limits = _used_range(seen)
    panels = tuple(
        (one.title, curve_figure(one, log="x", limits=limits, heights=(0.0, 1.02)))
        for one in curves
    )
    return Chart(name="coherence", caption="Coherence", panels=panels, height=240)


def _used_range(seen: Observation) -> tuple[float, float]:
    """Lowest and highest frequency that is used at some floor, Hz."""
    used = seen.frequency_hz[seen.valid.any(axis=0)]
    used = used if used.size else seen.frequency_hz
    return float(used.min()), float(used.max())


def fit_section(page: PageStudy) -> Section:
    """Measured responses over those of the posterior."""
    posterior = page.posterior
    if posterior is None:
        return Section("fit", "Fit", ())
    curves = fitted_curves(page.system, page.model, posterior)
    limits = _used_range(posterior.observation)
    panels = [(one.title, curve_figure(one, log="xy", limits=limits)) for one in curves]
    chart = Chart(
        name="frequency_responses",
        caption="Frequency responses, floor over base, measured and predicted",
        panels=tuple(panels),
        note=_band_note(curves),
        height=420,
    )
    blocks: list[Block] = []
    if posterior.warnings:
        blocks.append(Remarks(posterior.warnings, warning=True))
    told = (*error_notes(posterior), *_kept_check(page))
    if told:
        blocks.append(Remarks(told))
    return Section("fit", "Fit", (*blocks, chart))


def _kept_check(page: PageStudy) -> tuple[str, ...]:
    """Posterior predictive p-value, where the calibration kept one."""
    kept = kept_summary(page.study).get("posterior_predictive_p") or {}
    if "whole" not in kept:
        return ()
    return (
        f"Posterior predictive p-value {kept['whole']:.2g}: the share of data made by the model, "
        "with the errors that are allowed for, that agree less well with it than the measured.",
    )


def _band_note(curves: Sequence[Curve]) -> str:
    """The widths of the bands in words, which may be too thin to see."""
    *wide, width = (
        50.0 * float(np.median([np.log(band.high / band.low) for band in bands]))
        for bands in zip(*(one.bands for one in curves), strict=True)
    )
    note = f"The band of the parameters is ±{width:.2g} % of the amplitude wide in its median"
    thin = "; it is thinner than the line that is drawn." if width < 2.0 else "."
    for other in wide:
        thin += f" With the error of the model, as of another measurement, it is ±{other:.2g} %."
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
        parameter_table(page.model.building, posterior),
        _intervals(page, posterior),
        Remarks(tuple(sentences)),
        *_relations(page, posterior),
    ]
    return Section("posterior", "Posterior", tuple(blocks))


def _intervals(page: PageStudy, posterior: Posterior) -> Chart:
    """Factors alone, and over their prior ranges, on which intervals may be too short to see."""
    factors = posterior.of("stiffness")
    rows = [page.titles[name] for name in factors.names]
    own = Interval.of(factors.samples)
    across = "stiffness over that in the building file"
    prior = (factors.bounds[:, 0], factors.bounds[:, 1])
    return Chart(
        name="stiffness_factors",
        caption="Stiffness factors",
        panels=(
            ("posterior", interval_figure(rows, [own], across)),
            ("with the prior range", interval_figure(rows, [own], across, prior)),
        ),
        height=120 + 42 * len(rows),
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
        draws = posterior.samples[posterior.rows(_PAIR_DRAWS, 0)]
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
