"""Pictures of a prediction."""

from pathlib import Path

from femupdate.arrays import Floats
from femupdate.dynamics.member_histories import MemberForces
from femupdate.progress import SILENT, Progress
from femupdate.report.figure import save_figure
from femupdate.report.plot_drift import story_shear_drift
from femupdate.report.plot_history import (
    floor_history_bands,
    floor_spectra_bands,
    member_force_bands,
)
from femupdate.study import Study
from femupdate.workflow.predict import PredictionReport
from femupdate.workflow.prediction_quantities import ALONE


def draw_prediction(
    study: Study, report: PredictionReport, progress: Progress = SILENT
) -> tuple[Path, ...]:
    """Draw histories and stories; floor spectra and members where they were asked for."""

    summary, motion = report.summary, report.motion
    progress.start("Drawing", 2)
    title = f"Floor acceleration, mean ± 2 sd: {motion.title} (peak {motion.peak:.2f} m/s²)"
    bands = floor_history_bands(
        summary.time,
        summary.acceleration_mean,
        summary.acceleration_sd,
        summary.floors,
        alone=(report.alone.acceleration_mean, report.alone.acceleration_sd),
        measured=report.measured,
        title=title,
    )
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
        figure = floor_spectra_bands(
            spectra.frequency_hz,
            spectra.acceleration.mean,
            spectra.acceleration.sd,
            summary.floors,
            base=spectra.base,
            title=f"Floor spectra at {100.0 * spectra.damping:.3g} % damping, mean ± 2 sd: "
            f"{motion.title}",
        )
        paths.append(save_figure(figure, study.result("pictures", "floor_spectra.png")))
    if report.members:
        figure = member_force_bands(
            summary.time,
            [(f"{m.member.kind} {m.member.name}", *_main_forces(m)) for m in report.members],
            title=f"Forces of members, mean ± 2 sd: {motion.title}",
            note=ALONE,
        )
        paths.append(save_figure(figure, study.result("pictures", "member_forces.png")))
    return tuple(paths)


def _main_forces(member: MemberForces) -> tuple[tuple[str, ...], Floats, Floats]:
    """Name, mean and sd of the largest normal force, shear and moment of a member."""
    names = member.member.forces
    kinds = [[k for k, name in enumerate(names) if name[0] == first] for first in "NVM"]
    largest = [max(kind, key=lambda k: float(member.peak.mean[k])) for kind in kinds]
    return tuple(names[k] for k in largest), member.mean[largest], member.sd[largest]
