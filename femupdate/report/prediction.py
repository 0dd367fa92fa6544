"""What was predicted: told, drawn, and kept as netCDF."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.document import Building
from femupdate.dynamics.history import ResponseHistories
from femupdate.dynamics.members import MemberForces
from femupdate.dynamics.spectra import FloorSpectra
from femupdate.dynamics.summary import (
    HistorySummary,
    Statistics,
    compare,
    score_table,
    statistics,
)
from femupdate.errors import StudyError
from femupdate.measurement.record import GroundMotion
from femupdate.report.curves import Curve, history_curves, spectrum_curves
from femupdate.report.page import items_of, kept_items
from femupdate.report.quantities import (
    ALONE,
    PEAKS,
    DrawnQuantity,
    floor_table,
    force_scales,
    in_unit,
    member_tables,
    quantities,
    quantity_tables,
    tidy_table,
)
from femupdate.report.scale import Scale, range_text
from femupdate.result import Item, Note, Notes, Picture, Result, first_lines, took
from femupdate.storage import read_tree, write_tree
from femupdate.study import as_written, typed
from femupdate.units import percent


@dataclass(frozen=True, kw_only=True)
class Prediction(Result):
    """What was predicted.

        >>> import femupdate
        >>> how = {"exact": True, "particles": 400}
        >>> found = femupdate.calibrate("house", "run.csv", building="shear_3dof", **how)
        >>> predicted = femupdate.predict("house", "quake.csv", unit="m/s2", samples=20)
        >>> isinstance(predicted, femupdate.Prediction), predicted.summary.floors
        (True, ('2F', '3F', 'RF'))

    Attributes:
        summary: bands and peaks of the next measurement: parameters, scatter between events,
            errors of the model and what does not follow the base.
        best: (f, n) floor acceleration by the mean of these and by what stays of the model's
            error, m/s2.
        path: the netCDF file.
        damping: what damping was used, in words.
        notes: what the user should know, the warnings among them.
        quantities: peaks, drift ratios, base shear and stiffness of the stories, by key.
        measured: (f, n) floors measured in the same motion, m/s2, if any.
        floor_spectra: where they were asked for, over the first hundred samples.
        forces: the same as told and kept.
    """

    summary: HistorySummary
    alone: HistorySummary
    best: Floats
    path: Path
    damping: str
    notes: tuple[str, ...]
    seconds: float
    quantities: Mapping[str, DrawnQuantity]
    motion: GroundMotion
    measured: Floats | None = None
    floor_spectra: FloorSpectra | None = None
    members: tuple[MemberForces, ...] = ()
    forces: tuple[Item, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def peak_acceleration(self) -> Statistics:
        """(f,) statistics over the samples, m/s2."""
        return statistics(self.summary.peak_acceleration)

    @property
    def story_stiffness(self) -> Statistics:
        """(s,) statistics over the samples, N/m."""
        return statistics(self.alone.story_stiffness)

    @property
    def comparison(self) -> dict[str, dict[str, float]] | None:
        """With measured floors, where there are any."""
        return None if self.measured is None else compare(self.summary, self.best, self.measured)

    @property
    def largest(self) -> str:
        """The largest acceleration, drift and base shear with their 5 to 95 %, and where."""
        known = self.quantities
        shown = [known[key] for key in ("acceleration", "drift", "ratio", "base") if key in known]
        return ", ".join(
            f"{quantity.name} {range_text(quantity.values[:, at])} {quantity.unit}"
            + ("" if len(quantity.places) == 1 else f" ({quantity.places[at]})")
            for quantity in shown
            for at in [int(quantity.statistics.mean.argmax())]
        )

    def items(self) -> Iterator[Item]:
        """Peaks, stiffnesses and what else was asked for, notes and tables."""
        summary, alone, spectra = self.summary, self.alone, self.floor_spectra
        floors, found = summary.floors, self.quantities.values()
        peaks = {
            "peak_acceleration_m_s2": self.peak_acceleration,
            "peak_acceleration_of_parameters_m_s2": statistics(alone.peak_acceleration),
        }
        stories = [str(k) for k in range(1, len(self.story_stiffness.mean) + 1)]
        state = "to be used with care" if self.warnings else "predicted"
        verdict = f"Verdict: {state} ({self.motion.title}, peak {self.motion.peak:.2f} m/s²"
        if (figures := self.comparison) is not None:
            error = max(figures.values(), key=lambda scores: scores["relative_error"])
            held = sum(scores["peak_within"] for scores in figures.values())
            verdict += f"; {held:.0f} of {len(figures)} measured peaks lie in their intervals, the "
            verdict += f"error is up to {percent(error['relative_error'])}"
        yield from first_lines(
            f"{verdict}).",
            f"Largest (90 %): {self.largest}.",
            f"`{typed('report', self.path)}` writes the page",
        )
        yield Notes(self.warnings, warning=True)
        yield Note(
            f"Prediction from {len(summary)} posterior draws{took(self.seconds)}",
            {
                "floors": floors,
                **{key: values.by_name(floors) for key, values in peaks.items()},
                "story_stiffness_n_per_m": self.story_stiffness.by_name(stories),
                "seconds": self.seconds,
            },
            detail=True,
        )
        yield Note(f"  damping ratio: {self.damping}", {"damping": self.damping}, detail=True)
        yield from (replace(table, detail=True) for table in quantity_tables(found))
        yield Note("  mean, and 5 to 95 % in brackets", detail=True, page=False)
        yield from self.forces or member_tables(self.members)
        if self.members:
            yield Note(content={"member_forces": [member.as_dict() for member in self.members]})
        if spectra is not None:
            yield Note(content={"floor_spectra": spectra.as_dict(floors)})
            yield spectra.table(floors)
        if figures is not None:
            yield Note(content={"comparison": figures})
            yield replace(score_table(figures), detail=True)
        yield Note(content={"notes": self.notes})
        yield Notes(tuple(note for note in self.notes if note not in self.warnings), detail=True)
        yield Note(f"  {self.path}", {"prediction": self.path}, detail=True, page=False)
        yield tidy_table("peaks", found, key="peaks")
        yield tidy_table("predicted_peaks", found, self.members)
        if spectra is not None:
            base, values = spectra.base, spectra.acceleration
            columns = {
                "damping_ratio": lambda: np.full((len(floors) + 1, len(base)), spectra.damping),
                "acceleration_mean_m_s2": lambda: np.vstack([base, values.mean]),
                "acceleration_sd_m_s2": lambda: np.vstack([0.0 * base, values.sd]),
                "acceleration_q05_m_s2": lambda: np.vstack([base, values.q05]),
                "acceleration_q95_m_s2": lambda: np.vstack([base, values.q95]),
            }
            every = ("base", *floors)
            yield floor_table("floor_spectra", every, "frequency_hz", spectra.frequency_hz, columns)
        histories = {
            "acceleration_mean_m_s2": lambda: _short(summary.acceleration_mean),
            "acceleration_sd_m_s2": lambda: _short(summary.acceleration_sd),
            "parameters_mean_m_s2": lambda: _short(alone.acceleration_mean),
            "parameters_sd_m_s2": lambda: _short(alone.acceleration_sd),
        }
        yield floor_table("floor_histories", floors, "time_s", _short(summary.time), histories)

    def figures(self) -> Iterator[Picture]:
        """Histories and stories; floor spectra and members where they were asked for."""
        from femupdate.report.plot_curves import (
            floor_history_bands,
            floor_spectra_bands,
            member_force_bands,
            story_shear_drift,
        )

        summary, motion, spectra = self.summary, self.motion, self.floor_spectra
        title = f"Floor acceleration, mean ± 2 sd: {motion.title} (peak {motion.peak:.2f} m/s²)"
        curves = history_curves(
            summary.time,
            summary.floors,
            summary.acceleration_mean,
            summary.acceleration_sd,
            alone=(self.alone.acceleration_mean, self.alone.acceleration_sd),
            measured=self.measured,
        )
        yield Picture("floor_histories", lambda: floor_history_bands(curves, title=title))
        examples = summary.examples
        if len(examples):  # not kept in a study
            yield Picture(
                "story_shear_drift",
                lambda: story_shear_drift(
                    examples.story_shear,
                    examples.story_drift,
                    summary.story_stiffness,
                    self.quantities["drift"].places,
                ),
            )
        if spectra is not None:
            values, damping = spectra.acceleration, f"{100.0 * spectra.damping:.3g} % damping"
            lines = spectrum_curves(
                spectra.frequency_hz, summary.floors, values.mean, values.sd, spectra.base
            )
            over = f"Floor spectra at {damping}, mean ± 2 sd: {motion.title}"
            yield Picture("floor_spectra", lambda: floor_spectra_bands(lines, title=over))
        if self.members:
            scales = force_scales(self.members)
            rows = [
                (
                    f"{forces.member.kind} {forces.member.name}",
                    force_curves(summary.time, forces, scales),
                )
                for forces in self.members
            ]
            above = f"Forces of members, mean ± 2 sd: {motion.title}"
            yield Picture(
                "member_forces", lambda: member_force_bands(rows, title=above, note=ALONE)
            )


def force_curves(
    time: Floats, forces: MemberForces, scales: tuple[Scale, Scale]
) -> tuple[Curve, ...]:
    """Histories (n,) of a member's largest normal force, shear and moment, in units of tables."""
    curves = []
    for first in "NVM":
        kind = [k for k, name in enumerate(forces.member.forces) if name[0] == first]
        k = max(kind, key=lambda k: float(forces.peak.mean[k]))
        name, unit, factor = in_unit(forces.member.forces[k], scales)
        drawn = history_curves(time, [name], forces.mean[[k]] / factor, forces.sd[[k]] / factor)
        curves += [replace(curve, up=f"{name}, {unit}") for curve in drawn]
    return tuple(curves)


def _short(values: Floats) -> Floats:
    """Six significant figures: histories are long."""
    return np.array([float(f"{value:.6g}") for value in np.ravel(values)])


_BASE = ("base_acceleration", "base_rotation", "base_across")  # m/s2, rad/s2, m/s2
_SPECTRA = ("mean", "sd", "q05", "q95")


def save_prediction(found: Prediction) -> None:
    """Write netCDF groups `predictions` (bands, peaks of the draws) and `constant_data`.

    Bands and peaks are those of the next measurement; variables that begin with `parameters_`, and
    stiffnesses, are of the parameters alone. Floors that were measured in the same motion, (f, n)
    m/s2 with NaN where there is no sensor, are kept beside the base motion.
    """
    import xarray as xr

    summary, alone, motion, spectra = found.summary, found.alone, found.motion, found.floor_spectra
    stories = np.arange(1, summary.peak_shear.shape[1] + 1)
    coordinates = {"floor": list(summary.floors), "time_s": summary.time, "story": stories}
    predictions = xr.Dataset(
        {
            "acceleration_mean": (("floor", "time_s"), summary.acceleration_mean),
            "acceleration_sd": (("floor", "time_s"), summary.acceleration_sd),
            "best_acceleration": (("floor", "time_s"), found.best),
            "parameters_acceleration_mean": (("floor", "time_s"), alone.acceleration_mean),
            "parameters_acceleration_sd": (("floor", "time_s"), alone.acceleration_sd),
            "parameters_peak_acceleration": (("sample", "floor"), alone.peak_acceleration),
            "peak_acceleration": (("sample", "floor"), summary.peak_acceleration),
            "peak_shear": (("sample", "story"), summary.peak_shear),
            "peak_drift": (("sample", "story"), summary.peak_drift),
            "story_stiffness": (("sample", "story"), alone.story_stiffness),
        },
        coords=coordinates,
        attrs={"units": json.dumps({"acceleration": "m/s2", "shear": "N", "drift": "m"})},
    )
    if spectra is not None:
        axes = ("floor", "oscillator_hz")
        values: dict[str, Any] = {
            f"floor_spectrum_{name}": (axes, getattr(spectra.acceleration, name))
            for name in _SPECTRA
        }
        values["base_spectrum"] = ("oscillator_hz", spectra.base)
        predictions = predictions.assign_coords(oscillator_hz=spectra.frequency_hz).assign(values)
        predictions.attrs["oscillator_damping"] = spectra.damping
    constant = xr.Dataset(
        dict(zip(_BASE, [("time_s", row) for row in motion.inputs], strict=False)),
        {"time_s": summary.time},
    )
    if found.measured is not None:
        constant = constant.assign_coords(floor=list(summary.floors)).assign(
            measured_acceleration=(("floor", "time_s"), found.measured)
        )
    tree = xr.DataTree.from_dict({"/predictions": predictions, "/constant_data": constant})
    tree.attrs = {
        "record": motion.name,
        "channel": motion.channel,
        "scale": motion.scale,
        "time_step_s": motion.time_step,
        "damping": found.damping,
        "notes": json.dumps(found.notes),
        "warnings": json.dumps(found.warnings),
        "member_forces": json.dumps(kept_items(member_tables(found.members))),
    }
    write_tree(tree, found.path)


def read_prediction(path: Path, building: Building, mass: float) -> Prediction:
    """Read what `save_prediction` has written, but for whole histories and forces of members.

    Args:
        mass: above the middle of the first story, kg.

    Raises:
        StudyError: the file is damaged, or an older version wrote it.
    """
    try:
        tree = read_tree(path)
    except Exception as error:
        raise StudyError(
            f"{path} cannot be read; run `femupdate predict --record FILE` again"
        ) from error
    with as_written(path):
        kept, known = tree["predictions"].to_dataset(), tree["constant_data"].to_dataset()
        floors = tuple(str(name) for name in kept["floor"].values)
        step, count = float(tree.attrs["time_step_s"]), kept.sizes["time_s"]
        motion = GroundMotion(
            known[_BASE[0]].values,
            step,
            str(tree.attrs["record"]),
            str(tree.attrs["channel"]),
            known[_BASE[1]].values if _BASE[1] in known else None,
            float(tree.attrs["scale"]),
            known[_BASE[2]].values if _BASE[2] in known else None,
        )
        none, stories = np.zeros((0, len(floors), count)), kept.sizes["story"]
        examples = ResponseHistories(
            step, floors, none, np.zeros((0, stories, 0)), np.zeros((0, stories, 0))
        )
        peaks = [kept[name].values for name in PEAKS]
        summary, alone = (
            HistorySummary(
                floors,
                kept[f"{of}acceleration_mean"].values,
                kept[f"{of}acceleration_sd"].values,
                kept[f"{of}peak_acceleration"].values,
                peaks[1],
                peaks[2],
                peaks[3],
                examples,
            )
            for of in ("", "parameters_")
        )
        spectra = None
        if "base_spectrum" in kept:
            parts = [kept[f"floor_spectrum_{name}"].values for name in _SPECTRA]
            spectra = FloorSpectra(
                kept["oscillator_hz"].values,
                float(kept.attrs["oscillator_damping"]),
                Statistics(*parts),
                kept["base_spectrum"].values,
            )
        measured = known.get("measured_acceleration")
        return Prediction(
            summary=summary,
            alone=alone,
            best=kept["best_acceleration"].values,
            path=path,
            damping=str(tree.attrs["damping"]),
            notes=tuple(map(str, json.loads(tree.attrs["notes"]))),
            warnings=tuple(map(str, json.loads(tree.attrs.get("warnings", "[]")))),
            seconds=np.nan,
            quantities=quantities(building, floors, peaks, mass),
            motion=motion,
            measured=None if measured is None else measured.values,
            floor_spectra=spectra,
            forces=tuple(items_of(json.loads(tree.attrs.get("member_forces", "[]")))),
        )
