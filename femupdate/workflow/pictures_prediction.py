"""Pictures of a prediction."""

from dataclasses import replace
from pathlib import Path

from femupdate.arrays import Floats
from femupdate.dynamics.member_histories import MemberForces
from femupdate.progress import SILENT, Progress
from femupdate.report.curves import Curve, history_curves, spectrum_curves
from femupdate.report.figure import save_figure
from femupdate.report.plot_curves import (
    floor_history_bands,
    floor_spectra_bands,
    member_force_bands,
)
from femupdate.report.plot_drift import story_shear_drift
from femupdate.report.scale import Scale
from femupdate.study import Study
from femupdate.workflow.predict import PredictionReport
from femupdate.workflow.prediction_quantities import ALONE, force_scales, in_unit


def draw_prediction(
    study: Study, report: PredictionReport, progress: Progress = SILENT
) -> tuple[Path, ...]:
    """Draw histories and stories; floor spectra and members where they were asked for."""
    summary, motion = report.summary, report.motion
    progress.start("Drawing", 2)
    title = f"Floor acceleration, mean ± 2 sd: {motion.title} (peak {motion.peak:.2f} m/s²)"
    alone = report.alone.acceleration_mean, report.alone.acceleration_sd
    mean, sd = summary.acceleration_mean, summary.acceleration_sd
    curves = history_curves(
        summary.time, summary.floors, mean, sd, alone=alone, measured=report.measured
    )
    bands = floor_history_bands(curves, title=title)
    paths = [save_figure(bands, study.result("pictures", "floor_histories.png"))]
    progress.advance()
    lines = story_shear_drift(
        summary.examples.story_shear,
        summary.examples.story_drift,
        summary.story_stiffness,
        report.quantities["drift"].places,
    )
    paths.append(save_figure(lines, study.result("pictures", "story_shear_drift.png")))
    progress.advance()
    spectra = report.floor_spectra
    if spectra is not None:
        own, damping = spectra.acceleration, f"{100.0 * spectra.damping:.3g} % damping"
        figure = floor_spectra_bands(
            spectrum_curves(spectra.frequency_hz, summary.floors, own.mean, own.sd, spectra.base),
            title=f"Floor spectra at {damping}, mean ± 2 sd: {motion.title}",
        )
        paths.append(save_figure(figure, study.result("pictures", "floor_spectra.png")))
    if report.members:
        scales = force_scales(report.members)
        figure = member_force_bands(
            [
                (f"{one.member.kind} {one.member.name}", force_curves(summary.time, one, scales))
                for one in report.members
            ],
            title=f"Forces of members, mean ± 2 sd: {motion.title}",
            note=ALONE,
        )
        paths.append(save_figure(figure, study.result("pictures", "member_forces.png")))
    return tuple(paths)


def force_curves(time: Floats, one: MemberForces, scales: tuple[Scale, Scale]) -> tuple[Curve, ...]:
    """Histories (n,) of a member's largest normal force, shear and moment, in units of tables."""
    curves = []
    for first in "NVM":
        kind = [k for k, name in enumerate(one.member.forces) if name[0] == first]
        k = max(kind, key=lambda k: float(one.peak.mean[k]))
        name, unit, factor = in_unit(one.member.forces[k], scales)
        own = history_curves(time, [name], one.mean[[k]] / factor, one.sd[[k]] / factor)
        curves += [replace(curve, up=f"{name}, {unit}") for curve in own]
    return tuple(curves)
