"""The section of the page on a predicted earthquake."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.dynamics.comparison import SCORES, score_rows
from femupdate.report.page import Block, Chart, Section, Table, Text
from femupdate.report.page_charts import (
    POINTS,
    Axis,
    Band,
    Curve,
    Figure,
    Interval,
    curve_figure,
    interval_figure,
    thinned,
)
from femupdate.workflow.page_parts import PageStudy
from femupdate.workflow.prediction_quantities import PEAKS, Quantity, quantities, side_by_side


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
    found = _quantities(page, predictions)
    blocks: list[Block] = [
        Text((lead,) if known else (lead, relative)),
        *_scores(settings.get("against_measured")),
        _histories(predictions, tree["constant_data"].to_dataset()),
        *_spectra(predictions),
        _profiles(found),
        *(_table(one) for one in side_by_side(found.values())),
        *_others(predictions),
    ]
    return Section("prediction", title, tuple(blocks))


def predicted_quantities(page: PageStudy) -> dict[str, Quantity]:
    """What was predicted; empty where nothing was."""
    if page.prediction is None:
        return {}
    return _quantities(page, page.prediction["predictions"].to_dataset())


def _quantities(page: PageStudy, predictions: Any) -> dict[str, Quantity]:
    peaks = [predictions[name].values for name in PEAKS]
    floors = [str(name) for name in predictions["floor"].values]
    mass = float(page.model.reduced.story_mass[0])
    return dict(quantities(page.model.building, floors, peaks, mass))


def _scores(kept: Mapping[str, Mapping[str, float]] | None) -> tuple[Table, ...]:
    """How well measured floors were met, where the prediction was compared with any."""
    if not kept:
        return ()
    note = (
        "Error rms: of the best estimate, over the rms of the measurement. CRPS/rms: score of the "
        "whole band, the lower the better. A good band holds some 95 % of the samples."
    )
    caption = "Against floors measured in the same motion"
    rows = tuple(score_rows(kept))
    return (Table(name="scores", caption=caption, head=("floor", *SCORES), rows=rows, note=note),)


def _histories(predictions: Any, known: Any) -> Chart:
    base = known["base_acceleration"].values
    time = predictions["time_s"].values
    panels, shown = [], 0
    for row, floor in reversed(list(enumerate(predictions["floor"].values))):
        mean = predictions["acceleration_mean"].values[row]
        kept = thinned(mean)
        shown = max(shown, len(kept))
        measured = None
        if "measured_acceleration" in known:
            measured = known["measured_acceleration"].values[row][kept]
        curve = Curve(
            x=time[kept],
            mean=mean[kept],
            name="mean",
            bands=_bands(predictions, row, kept),
            measured=measured,
        )
        up = Axis(title="acceleration, m/s²")
        panels.append((str(floor), curve_figure(curve, Axis(title="time, s"), up)))
    note = f"All {len(time)} samples are shown."
    if shown < len(time):
        note = (
            f"Thinned for the screen to about {POINTS} of {len(time)} samples, all peaks of the "
            "mean kept; prediction.nc has them all."
        )
    panels.append(("base", _base(base, time)))
    return Chart(
        name="floor_histories",
        caption="Acceleration of the floors and the base",
        panels=tuple(panels),
        note=f"{note} Drag to zoom, double-click to go back.",
    )


def _base(base: Floats, time: Floats) -> Figure:
    kept = thinned(base)
    curve = Curve(x=time[kept], mean=base[kept], name="record")
    return curve_figure(curve, Axis(title="time, s"), Axis(title="acceleration, m/s²"))


_BANDS = (
    ("", "next measurement, mean ± 2 sd", True),
    ("parameters_", "parameters alone, mean ± 2 sd", False),
)


def _bands(predictions: Any, row: int, kept: Any) -> tuple[Band, ...]:
    """Of the next measurement and of the parameters alone, the wider first."""
    found = []
    for of, name, outer in _BANDS:
        mean, sd = (
            predictions[f"{of}acceleration_{part}"].values[row][kept] for part in ("mean", "sd")
        )
        found.append(Band(name=name, low=mean - 2.0 * sd, high=mean + 2.0 * sd, outer=outer))
    return tuple(found)


def _spectra(predictions: Any) -> tuple[Chart, ...]:
    if "floor_spectrum_mean" not in predictions:
        return ()
    frequency = predictions["oscillator_hz"].values
    means, sds = (predictions[f"floor_spectrum_{name}"].values for name in ("mean", "sd"))
    across = Axis(title="frequency of the oscillator, Hz", log=True)
    panels = []
    rows = list(zip(predictions["floor"].values, means, sds, strict=True))
    for floor, mean, sd in reversed(rows):
        band = Band(name="mean ± 2 sd", low=mean - 2.0 * sd, high=mean + 2.0 * sd)
        curve = Curve(x=frequency, mean=mean, bands=(band,))
        panels.append((str(floor), curve_figure(curve, across, Axis(title="acceleration, m/s²"))))
    return (Chart(name="floor_spectra", caption="Floor response spectra", panels=tuple(panels)),)


def _profiles(found: dict[str, Quantity]) -> Chart:
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


def _profile(one: Quantity) -> Figure:
    own = one.statistics
    interval = Interval(name="mean, 5 to 95 %", mean=own.mean, low=own.q05, high=own.q95)
    return interval_figure(one.places, [interval], one.heading)


def _table(group: list[Quantity]) -> Table:
    head = [one.heading for one in group]
    columns = [one.cells() for one in group]
    rows = tuple(zip(group[0].places, *columns, strict=True))
    names = ", ".join(one.name for one in group)
    return Table(
        name="_".join(group[0].name.split()),
        caption=f"{names[0].upper()}{names[1:]}",
        head=("", *head),
        rows=rows,
        note="Mean, and 5 to 95 % in brackets.",
    )


def _others(predictions: Any) -> list[Table]:
    """Anything else that is kept for every draw."""
    tables = []
    for name, values in predictions.data_vars.items():
        if name in PEAKS or len(values.dims) != 2 or values.dims[0] != "sample":
            continue
        places = tuple(str(place) for place in values[values.dims[1]].values)
        words = str(name).replace("_", " ")
        one = Quantity(words, str(values.attrs.get("units", "")), places, values.values)
        tables.append(_table([one]))
    return tables
