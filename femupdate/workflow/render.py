"""render: the posterior's mode shapes, off screen."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femupdate.inference.posterior import load_posterior
from femupdate.progress import Progress, Silent
from femupdate.study import Study
from femupdate.workflow.model import StudyModel
from femupdate.workflow.modes import (
    ReducedModes,
    TrackedMode,
    driven_modes,
    levels_with_base,
    node_displacements,
    reduced_modes,
    track_mode,
    with_base,
)


@dataclass(frozen=True)
class RenderedMode:
    """One mode of the posterior.

    Attributes:
        number: from 1, among the modes that the base motion drives.
        frequency_mean, frequency_sd: Hz.
        found: share of the posterior draws in which the mode was recognised.
        picture: where it is drawn.
    """

    number: int
    frequency_mean: float
    frequency_sd: float
    found: float
    picture: Path


def render_study(
    study: Study,
    model: StudyModel,
    modes: int = 3,
    samples: int = 60,
    *,
    seed: int = 0,
    progress: Progress | None = None,
) -> tuple[RenderedMode, ...]:
    """Draw the mean shape and its spread for the lowest modes that the base motion drives.

    Raises:
        StudyError: there is no posterior, or it is of another building.
    """
    show = progress or Silent()
    posterior = load_posterior(study.require("posterior", "calibrate"))
    study.check_fresh("posterior", model.made_from(), "calibrate")
    # Behind the factors stand parameters of effects, which these shapes do not show.
    theta = posterior.thinned(samples, seed)[0][:, : model.reduced.parameters]
    # The reference is the draw nearest to the mean: the mean itself can lie between modes.
    centre = ((theta - theta.mean(axis=0)) / theta.std(axis=0)) ** 2
    nearest = int(centre.sum(axis=1).argmin())
    found = reduced_modes(model.reduced, theta)
    reference = ReducedModes(found.frequency_hz[[nearest]], found.vectors[[nearest]])
    chosen = driven_modes(model.reduced, reference, modes)
    tracked = [track_mode(found, reference.vectors[0][:, mode]) for mode in chosen]
    if model.reduced.node_shapes is None:
        return _draw_sticks(study, model, tracked)
    return _draw_scenes(study, model, tracked, show)


def _draw_scenes(
    study: Study, model: StudyModel, tracked: list[TrackedMode], show: Progress
) -> tuple[RenderedMode, ...]:
    from femupdate.building.mesh import mesh_building
    from femupdate.report.geometry import Geometry
    from femupdate.report.scenes import mode_shape_scene

    geometry = Geometry.of_model(mesh_building(model.building).model)
    show.start("Rendering mode shapes", len(tracked))
    rendered = []
    for number, mode in enumerate(tracked, start=1):
        shapes = node_displacements(model.reduced, mode.vectors[np.isfinite(mode.frequency_hz)])
        mean = shapes.mean(axis=0)
        spread = np.sqrt(((shapes - mean) ** 2).sum(axis=-1).mean(axis=0))
        largest = np.linalg.norm(mean, axis=-1).max()
        path = study.path("pictures", f"mode_{number}.png")
        frequency, sd = _frequency(mode)
        title = f"Mode {number}: {frequency:.2f} ± {sd:.2f} Hz"
        mode_shape_scene(geometry, mean / largest, path, shape_sd=spread / largest, title=title)
        rendered.append(RenderedMode(number, frequency, sd, mode.found, path))
        show.advance()
    return tuple(rendered)


def _draw_sticks(
    study: Study, model: StudyModel, tracked: list[TrackedMode]
) -> tuple[RenderedMode, ...]:
    from femupdate.report.figure import save_figure
    from femupdate.report.plot_sticks import stick_mode_shapes

    mean, sd = [], []
    for mode in tracked:
        kept = mode.vectors[np.isfinite(mode.frequency_hz)]
        shapes = kept @ model.reduced.floor_shapes.T
        mean.append(shapes.mean(axis=0))
        sd.append(shapes.std(axis=0))
    frequencies = np.array([_frequency(mode) for mode in tracked])
    figure = stick_mode_shapes(
        levels_with_base(model.building),
        with_base(np.array(mean).T).T,
        frequencies[:, 0],
        shapes_sd=with_base(np.array(sd).T).T,
        frequency_sd=frequencies[:, 1],
        floors=("base", *model.reduced.floors),
        title="Mode shapes of the posterior",
    )
    path = save_figure(figure, study.path("pictures", "modes.png"))
    return tuple(
        RenderedMode(number, *_frequency(mode), mode.found, path)
        for number, mode in enumerate(tracked, start=1)
    )


def _frequency(mode: TrackedMode) -> tuple[float, float]:
    return float(np.nanmean(mode.frequency_hz)), float(np.nanstd(mode.frequency_hz))
