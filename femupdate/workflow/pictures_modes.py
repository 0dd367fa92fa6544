"""Pictures of mode shapes, of the model as built and of the posterior."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.schema import Building
from femupdate.dynamics.tracking import (
    TrackedMode,
    driven_modes,
    node_displacements,
    reduced_modes,
    track_mode,
)
from femupdate.progress import Progress, Silent
from femupdate.study import Study
from femupdate.workflow.model import StudyModel

_MODES = 3


def draw_model(
    study: Study, model: StudyModel, progress: Progress | None = None
) -> tuple[Path, ...]:
    """Draw the first modes that the base motion drives, at theta = 1."""
    modes = reduced_modes(model.reduced, np.ones((1, model.reduced.parameters)))
    chosen = driven_modes(model.reduced, modes, _MODES)
    tracked = [track_mode(modes, modes.vectors[0][:, mode]) for mode in chosen]
    return tuple(dict.fromkeys(draw_modes(study, model, tracked, "model_mode", progress)))


def draw_modes(
    study: Study,
    model: StudyModel,
    modes: Sequence[TrackedMode],
    name: str = "mode",
    progress: Progress | None = None,
) -> tuple[Path, ...]:
    """Draw the mean shape of every mode and, of several samples, its spread.

    Args:
        study: where the pictures go.
        model: whose modes they are.
        modes: lowest first.
        name: of the pictures, before the number of the mode.
        progress: told about modes drawn.

    Returns:
        the picture of every mode; the modes of a stick share one.
    """
    if model.reduced.node_shapes is None:
        return (_draw_sticks(study, model, modes, name),) * len(modes)
    return _draw_scenes(study, model, modes, name, progress or Silent())


def _draw_scenes(
    study: Study, model: StudyModel, modes: Sequence[TrackedMode], name: str, show: Progress
) -> tuple[Path, ...]:
    from femupdate.building.mesh import mesh_building
    from femupdate.report.figure import save_figure
    from femupdate.report.geometry import Geometry
    from femupdate.report.scenes import mode_shape_figure

    geometry = Geometry.of_model(mesh_building(model.building).model)
    show.start("Drawing mode shapes", len(modes))
    paths = []
    for number, mode in enumerate(modes, start=1):
        shapes = node_displacements(model.reduced, mode.recognised)
        mean = shapes.mean(axis=0)
        largest = np.linalg.norm(mean, axis=-1).max()
        spread = np.sqrt(((shapes - mean) ** 2).sum(axis=-1).mean(axis=0)) / largest
        path = study.path("pictures", f"{name}_{number}.png")
        several = len(mode.frequency_hz) > 1
        title = f"Mode {number}, {mode.frequency_mean:.2f} Hz, all factors 1"
        if several:
            title = f"Mode {number}: {mode.frequency_mean:.2f} ± {mode.frequency_sd:.2f} Hz"
        sd = spread if several else None
        save_figure(mode_shape_figure(geometry, mean / largest, shape_sd=sd, title=title), path)
        paths.append(path)
        show.advance()
    return tuple(paths)


def _draw_sticks(study: Study, model: StudyModel, modes: Sequence[TrackedMode], name: str) -> Path:
    from femupdate.report.figure import save_figure
    from femupdate.report.plot_sticks import stick_mode_shapes

    shapes = [mode.recognised @ model.reduced.floor_shapes.T for mode in modes]
    several = len(modes[0].frequency_hz) > 1
    figure = stick_mode_shapes(
        levels_with_base(model.building),
        _with_base([own.mean(axis=0) for own in shapes]),
        np.array([mode.frequency_mean for mode in modes]),
        shapes_sd=_with_base([own.std(axis=0) for own in shapes]) if several else None,
        frequency_sd=np.array([mode.frequency_sd for mode in modes]) if several else None,
        floors=("base", *model.reduced.floors),
        title="Mode shapes of the posterior" if several else "Mode shapes, all factors 1",
    )
    return save_figure(figure, study.path("pictures", f"{name}s.png"))


def levels_with_base(building: Building) -> Floats:
    """Heights of base and floors, m; one a story where the file gives no heights."""
    heights = [getattr(story, "height", None) or 1.0 for story in building.stories]
    return np.concatenate([[0.0], np.cumsum(heights)])


def _with_base(shapes: Sequence[Floats]) -> Floats:
    """Shapes (m, f) with the base, which stands still, before the floors."""
    return np.array([[0.0, *shape] for shape in shapes])
