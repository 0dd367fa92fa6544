"""render: mode shapes off screen, of the model as built and of the posterior."""

from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from femupdate.arrays import Floats
from femupdate.building.document import Building
from femupdate.building.mesh import mesh_building
from femupdate.dynamics.tracking import mean_shape, node_displacements
from femupdate.errors import StudyError
from femupdate.measurement.recording import RecordedMode
from femupdate.measurement.write import write_modes_uff
from femupdate.progress import SILENT, Progress
from femupdate.report.figure import save_pictures
from femupdate.report.geometry import Geometry
from femupdate.report.plot_building import stick_mode_shapes
from femupdate.report.scale import plus_minus
from femupdate.report.scenes import mode_shape_figure
from femupdate.result import Note, Notes, Picture, Told
from femupdate.study import Study, study_of
from femupdate.units import capital
from femupdate.workflow.calibration_report import kept_posterior
from femupdate.workflow.model import StudyModel, on_kept_finer, open_calibrated
from femupdate.workflow.modes import (
    StudyMode,
    find_modes,
    mode_damping,
    mode_table,
    posterior_modes,
    shape_table,
)
from femupdate.workflow.observed import direction_of


def render_study(
    study: Study | Path | str,
    *,
    modes: int = 3,
    wanted: Sequence[int] = (),
    samples: int = 60,
    seed: int = 0,
    progress: Progress = SILENT,
    model: StudyModel | None = None,
) -> Told:
    """Draw mode shapes of the posterior into the study, and write them as CSV and UFF.

    Args:
        modes: how many, of those that move most of the mass.
        wanted: numbers of modes, as `build_model` lists them, to draw instead.
        samples: draws of the posterior over which shapes are averaged.
        model: of the study, where it is open.

    Raises:
        StudyError: there is no posterior, it is of another building, or no mode that the base
            motion excites has the number.
    """
    study = study_of(study)
    model = on_kept_finer(study, model or open_calibrated(study, progress))
    posterior = kept_posterior(study, model.building)
    full = find_modes(study, model)
    beyond = [number for number in wanted if not 1 <= number <= len(full.direction)]
    if beyond:
        raise StudyError(
            f"there is no mode {beyond[0]} to draw; {model.building.name} has numbers 1 to "
            f"{len(full.direction)}, which `femupdate build-model` lists"
        )
    tracked = posterior_modes(
        model, posterior, full, modes, wanted=wanted, samples=samples, seed=seed
    )
    if still := set(wanted) - {mode.number for mode in tracked}:
        raise StudyError(
            f"the base motion does not excite mode {min(still)}, so no data changed it; leave "
            f"--mode {min(still)} out"
        )
    folder, drawn = study.result("pictures"), mode_pictures(model, tracked)
    pictures = save_pictures(drawn, folder, progress, "Drawing mode shapes")
    # The modes of a stick share one picture.
    table = mode_table(tracked, pictures * (len(tracked) // len(pictures)))
    levels, along = levels_with_base(model.building)[1:], direction_of(model.building)
    recorded = [
        RecordedMode(
            name=mode.label,
            frequency_hz=mode.tracked.frequency_mean,
            damping=ratio,
            sensors=model.reduced.floors,
            shape=mode.at_floors(model).mean(axis=0),
        )
        for mode, ratio in zip(
            tracked, mode_damping(model, posterior, tracked).tolist(), strict=True
        )
    ]
    path = study.result("tables", "shapes.uff")
    file = write_modes_uff(path, recorded, levels.tolist(), along)
    shapes = shape_table(model, posterior, tracked)
    paths = (Note(f"  {path}") for path in pictures)
    return Told((table, shapes, Notes((table.note,)), Note(f"  {file}", {"uff": file}), *paths))


def mode_pictures(
    model: StudyModel, modes: Sequence[StudyMode], name: str = "mode"
) -> list[Picture]:
    """The mean shape of every mode and, of several samples, its spread; of a stick one picture.

    Args:
        name: of the pictures, before the number of the mode.
    """
    several = any(len(mode.tracked.frequency_hz) > 1 for mode in modes)
    if modes and model.reduced.node_shapes is None:
        shapes = [mode.at_floors(model) for mode in modes]
        # The base stands still.
        mean = np.array([[0.0, *shape.mean(axis=0)] for shape in shapes])
        sd = np.array([[0.0, *shape.std(axis=0)] for shape in shapes])
        draw = partial(
            stick_mode_shapes,
            levels_with_base(model.building),
            mean,
            [_heading(mode) for mode in modes],
            ("base", *model.reduced.floors),
            shapes_sd=sd if several else None,
            title="Mode shapes of the posterior" if several else "Mode shapes, all factors 1",
        )
        return [Picture(f"{name}s", draw)]
    # One mesh for all pictures.
    geometry = cache(lambda: Geometry.of_model(mesh_building(model.building).model))

    def drawn(mode: StudyMode) -> Figure:
        name, frequency, share = _heading(mode).split("\n")
        title = f"{name}: {frequency}, {share}{'' if several else ', all factors 1'}"
        levels = levels_with_base(model.building)
        floors = list(zip(("base", *model.building.floors), levels, strict=True))
        mean, spread = mean_shape(node_displacements(model.reduced, mode.tracked.recognised))
        sd = spread if several else None
        return mode_shape_figure(geometry(), mean, floors, shape_sd=sd, title=title)

    # A mode without a number of its own has its frequency in tenths of 1 Hz.
    labels = [mode.number or f"{mode.tracked.frequency_mean:.1f}_Hz" for mode in modes]
    return [
        Picture(f"{name}_{label}", partial(drawn, mode))
        for label, mode in zip(labels, modes, strict=True)
    ]


def _heading(mode: StudyMode) -> str:
    """Name, frequency and share of the mass of a mode, each on a line."""
    tracked = mode.tracked
    frequency = f"{tracked.frequency_mean:.2f}"
    if len(tracked.frequency_hz) > 1:
        frequency = plus_minus(tracked.frequency_mean, tracked.frequency_sd)
    return f"{capital(mode.name)}\n{frequency} Hz\n{100.0 * mode.effective_mass:.1f} % of the mass"


def levels_with_base(building: Building) -> Floats:
    """Heights of base and floors, m; one a story where the file gives no heights."""
    levels = [0.0]
    for story, foot in zip(building.stories, building.below, strict=True):
        levels.append(levels[foot + 1] + (getattr(story, "height", None) or 1.0))
    return np.array(levels)
