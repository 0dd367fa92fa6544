"""Pictures of mode shapes, of the model as built and of the posterior."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.document import Building
from femupdate.building.mesh import mesh_building
from femupdate.dynamics.tracking import FullModes, mean_shape, node_displacements
from femupdate.progress import SILENT, Progress
from femupdate.report.animation import mode_animation, stick_animation
from femupdate.report.figure import save_figure
from femupdate.report.geometry import Geometry
from femupdate.report.plot_sticks import stick_mode_shapes
from femupdate.report.scale import plus_minus
from femupdate.report.scenes import mode_shape_figure
from femupdate.study import Study
from femupdate.units import capital, ordinal
from femupdate.workflow.model import StudyModel
from femupdate.workflow.modes import StudyMode, modes_of_model

_MODES = 3
_INFLUENCE = (
    "Last line: place in influence; by how much the fit would miss the data without the mode"
)


def draw_model(
    study: Study, model: StudyModel, modes: FullModes, progress: Progress = SILENT
) -> tuple[Path, ...]:
    """Draw the first modes that the base motion drives, at theta = 1."""
    chosen = modes_of_model(model, modes, _MODES)
    return tuple(dict.fromkeys(draw_modes(study, model, chosen, "model_mode", progress)))


def draw_modes(
    study: Study,
    model: StudyModel,
    modes: Sequence[StudyMode],
    name: str = "mode",
    progress: Progress = SILENT,
) -> tuple[Path, ...]:
    """Draw the mean shape of every mode and, of several samples, its spread.

    Args:
        name: of the pictures, before the number of the mode.

    Returns:
        the picture of every mode; the modes of a stick share one.
    """
    if model.reduced.node_shapes is None:
        return (_draw_sticks(study, model, modes, name),) * len(modes)
    return _draw_scenes(study, model, modes, name, progress)


def _draw_scenes(
    study: Study, model: StudyModel, modes: Sequence[StudyMode], name: str, show: Progress
) -> tuple[Path, ...]:
    geometry = _geometry(model)
    show.start("Drawing mode shapes", len(modes))
    paths = []
    for one in modes:
        mean, spread = mean_shape(node_displacements(model.reduced, one.tracked.recognised))
        sd = spread if len(one.tracked.frequency_hz) > 1 else None
        figure = mode_shape_figure(geometry, mean, shape_sd=sd, title=_title(one), note=one.matters)
        path = _folder(study, name) / f"{name}_{_file_label(one)}.png"
        paths.append(save_figure(figure, path))
        show.advance()
    return tuple(paths)


def animate_modes(
    study: Study, model: StudyModel, modes: Sequence[StudyMode], progress: Progress = SILENT
) -> tuple[Path, ...]:
    """Write the mean shapes of modes as GIF files; the modes of a stick share one."""
    paths = []
    progress.start("Animating mode shapes", len(modes))
    if model.reduced.node_shapes is None:
        means = [
            one.tracked.recognised.mean(axis=0) @ model.reduced.floor_shapes.T for one in modes
        ]
        path = study.result("pictures", "modes.gif")
        levels, floors = levels_with_base(model.building), ("base", *model.reduced.floors)
        headings = [_stick_heading(one) for one in modes]
        return (stick_animation(levels, _with_base(means), headings, floors, path),)
    geometry = _geometry(model)
    for one in modes:
        mean = node_displacements(model.reduced, one.tracked.recognised.mean(axis=0))
        path = study.result("pictures", f"mode_{_file_label(one)}.gif")
        paths.append(mode_animation(geometry, mean, path, title=_title(one), note=one.matters))
        progress.advance()
    return tuple(paths)


def draw_at_one(
    study: Study, model: StudyModel, modes: FullModes, numbers: Sequence[int]
) -> tuple[Path, ...]:
    """Draw modes of the full model at theta = 1 that the reduced model does not have."""
    geometry = _geometry(model)
    paths = []
    for number in numbers:
        shape = modes.shapes[number - 1].reshape(-1, 3)
        frequency, direction = modes.frequency_hz[number - 1], modes.direction[number - 1]
        title = f"Mode {number} ({direction}), {frequency:.2f} Hz, all factors 1"
        path = study.path("pictures", f"model_mode_{number}.png")
        paths.append(save_figure(mode_shape_figure(geometry, shape, title=title), path))
    return tuple(paths)


def _geometry(model: StudyModel) -> Geometry:
    """The mesh of a frame."""
    return Geometry.of_model(mesh_building(model.building).model)


def _folder(study: Study, name: str) -> Path:
    """Pictures of the model lie in the study, those of a posterior beside its other results."""
    return study.result("pictures") if name == "mode" else study.path("pictures")


def _title(one: StudyMode) -> str:
    """Over a picture of one mode."""
    name, frequency, share = _heading(one).split("\n")
    at_one = ", all factors 1" if len(one.tracked.frequency_hz) == 1 else ""
    return f"{name}: {frequency}, {share}{at_one}"


def _heading(one: StudyMode) -> str:
    """Name, frequency and share of the mass of a mode, each on a line."""
    mode = one.tracked
    frequency = f"{mode.frequency_mean:.2f}"
    if len(mode.frequency_hz) > 1:
        frequency = plus_minus(mode.frequency_mean, mode.frequency_sd)
    return f"{capital(one.name)}\n{frequency} Hz\n{100.0 * one.effective_mass:.1f} % of the mass"


def _stick_heading(one: StudyMode) -> str:
    """The same with its influence, where one note under the title explains that of all modes."""
    if one.influence is None or one.rank is None:
        return _heading(one)
    return f"{_heading(one)}\n{ordinal(one.rank)}, {one.influence:.3g} × noise"


def _file_label(one: StudyMode) -> str:
    """Number of a mode in the name of its picture, or its frequency in tenths of 1 Hz."""
    return str(one.number or f"{one.tracked.frequency_mean:.1f}_Hz")


def _draw_sticks(study: Study, model: StudyModel, modes: Sequence[StudyMode], name: str) -> Path:
    tracked = [one.tracked for one in modes]
    shapes = [mode.recognised @ model.reduced.floor_shapes.T for mode in tracked]
    several = len(tracked[0].frequency_hz) > 1
    figure = stick_mode_shapes(
        levels_with_base(model.building),
        _with_base([own.mean(axis=0) for own in shapes]),
        [_stick_heading(one) for one in modes],
        shapes_sd=_with_base([own.std(axis=0) for own in shapes]) if several else None,
        floors=("base", *model.reduced.floors),
        title="Mode shapes of the posterior" if several else "Mode shapes, all factors 1",
        note="" if modes[0].influence is None else _INFLUENCE,
    )
    return save_figure(figure, _folder(study, name) / f"{name}s.png")


def levels_with_base(building: Building) -> Floats:
    """Heights of base and floors, m; one a story where the file gives no heights."""
    heights = [getattr(story, "height", None) or 1.0 for story in building.stories]
    return np.concatenate([[0.0], np.cumsum(heights)])


def _with_base(shapes: Sequence[Floats]) -> Floats:
    """Shapes (m, f) with the base, which stands still, before the floors."""
    return np.array([[0.0, *shape] for shape in shapes])
