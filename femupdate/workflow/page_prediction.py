"""The section of the page on a predicted earthquake."""

from dataclasses import replace
from typing import Any

import numpy as np

from femupdate.dynamics.summary import score_table
from femupdate.report.curves import Interval, history_curves, spectrum_curves
from femupdate.report.page import Block, Chart, Section, Text
from femupdate.report.page_charts import (
    POINTS,
    Figure,
    curve_figure,
    interval_figure,
    thinned,
)
from femupdate.tables import Table
from femupdate.workflow.page_parts import PageStudy
from femupdate.workflow.prediction_quantities import (
    PEAKS,
    DrawnQuantity,
    quantities,
    quantity_tables,
)


def prediction_section(page: PageStudy) -> Section:
    """Histories with bands, peaks over the height, and tables."""
    title = "Prediction"
    tree = page.prediction
    if tree is None:
        text = "Nothing was predicted; femupdate predict --record FILE does."
        return Section("prediction", title, (Text((text,)),))
    predictions = tree["predictions"].to_dataset()
    settings = page.recorded("prediction").settings
    base = tree["constant_data"].to_dataset()["base_acceleration"].values
    scale = float(settings.get("scale", 1.0))
    scaled = "" if scale == 1.0 else f", scaled by {scale:g}"
    lead = (
        f"Record {tree.attrs.get('record', '')} {tree.attrs.get('channel', '')}{scaled}: "
        f"peak {np.abs(base).max():.3g} m/s². "
        f"Damping: {tree.attrs.get('damping', 'not said')}. "
        f"{predictions.sizes['sample']} draws of the posterior were followed."
    )
    relative = "Masses are nominal: shears and stiffnesses are relative."
    known = not page.model.building.forces_are_relative
    found, measured = _quantities(page, predictions), settings.get("against_measured")
    blocks: list[Block] = [
        Text((lead,) if known else (lead, relative)),
        *([score_table(measured)] if measured else []),
        _histories(predictions, tree["constant_data"].to_dataset()),
        *_spectra(predictions),
        _profiles(found),
        *quantity_tables(found.values()),
        *_others(predictions),
    ]
    return Section("prediction", title, tuple(blocks))


def predicted_quantities(page: PageStudy) -> dict[str, DrawnQuantity]:
    """What was predicted; empty where nothing was."""
    if page.prediction is None:
        return {}
    return _quantities(page, page.prediction["predictions"].to_dataset())


def _quantities(page: PageStudy, predictions: Any) -> dict[str, DrawnQuantity]:
    peaks = [predictions[name].values for name in PEAKS]
    floors = [str(name) for name in predictions["floor"].values]
    mass = float(page.model.reduced.story_mass[0])
    return dict(quantities(page.model.building, floors, peaks, mass))


def _histories(predictions: Any, known: Any) -> Chart:
    time = predictions["time_s"].values
    bands, alone = (
        [predictions[f"{of}acceleration_{part}"].values for part in ("mean", "sd")]
        for of in ("", "parameters_")
    )
    measured = known.get("measured_acceleration")
    curves = history_curves(
        time,
        predictions["floor"].values,
        *bands,
        alone=(alone[0], alone[1]),
        measured=None if measured is None else measured.values,
    )
    kept = [thinned(one.mean) for one in curves]
    shown = max(map(len, kept))
    base = known["base_acceleration"].values
    ground = replace(curves[0], title="base", mean=base, name="record", bands=(), measured=None)
    note = f"All {len(time)} samples are shown."
    if shown < len(time):
        note = (
            f"Thinned for the screen to about {POINTS} of {len(time)} samples, all peaks of the "
            "mean kept; prediction.nc has them all."
        )
    return Chart(
        name="floor_histories",
        caption="Acceleration of the floors and the base",
        panels=tuple(
            (one.title, curve_figure(one.at(points)))
            for one, points in zip((*curves, ground), (*kept, thinned(base)), strict=True)
        ),
        note=f"{note} The wide band is that of the next measurement. Drag to zoom, double-click to "
        "go back.",
    )


def _spectra(predictions: Any) -> tuple[Chart, ...]:
    if "floor_spectrum_mean" not in predictions:
        return ()
    mean, sd = (predictions[f"floor_spectrum_{name}"].values for name in ("mean", "sd"))
    frequency, floors = (predictions[name].values for name in ("oscillator_hz", "floor"))
    panels = tuple(
        (one.title, curve_figure(one, log="x"))
        for one in spectrum_curves(frequency, floors, mean, sd)
    )
    return (Chart(name="floor_spectra", caption="Floor response spectra", panels=panels),)


def _profiles(found: dict[str, DrawnQuantity]) -> Chart:
    keys = [key for key in ("acceleration", "ratio", "drift", "shear") if key in found]
    panels = tuple((found[key].name, _profile(found[key])) for key in keys)
    most = max(len(found[key].places) for key in keys)
    return Chart(
        name="peaks",
        caption="Peaks over the height",
        panels=panels,
        note="Mean and 5 to 95 % of the next measurement.",
        height=120 + 42 * most,
    )


def _profile(one: DrawnQuantity) -> Figure:
    return interval_figure(one.places, [Interval.of(one.values)], one.heading)


def _others(predictions: Any) -> list[Table]:
    """Anything else that is kept for every draw."""
    tables: list[Table] = []
    for name, values in predictions.data_vars.items():
        if name in PEAKS or len(values.dims) != 2 or values.dims[0] != "sample":
            continue
        places = tuple(str(place) for place in values[values.dims[1]].values)
        words = str(name).replace("_", " ")
        one = DrawnQuantity(words, str(values.attrs.get("units", "")), places, values.values)
        tables += quantity_tables([one])
    return tables
