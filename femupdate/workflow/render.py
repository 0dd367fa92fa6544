"""render: mode shapes off screen, of the model as built and of the posterior."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.document import Building
from femupdate.building.mesh import mesh_building
from femupdate.dynamics.tracking import FullModes, mean_shape, node_displacements
from femupdate.errors import StudyError
from femupdate.measurement.recording import RecordedMode
from femupdate.measurement.write import write_modes_uff
from femupdate.progress import SILENT, Progress
from femupdate.report.animation import mode_animation, stick_animation
from femupdate.report.figure import save_figure
from femupdate.report.geometry import Geometry
from femupdate.report.plot_sticks import stick_mode_shapes
from femupdate.report.scale import plus_minus
from femupdate.report.scenes import mode_shape_figure
from femupdate.result import Item, Note, Notes, Result
from femupdate.study import Study
from femupdate.tables import Table
from femupdate.units import capital
from femupdate.workflow.model import StudyModel, on_kept_finer
from femupdate.workflow.modes import (
    StudyMode,
    find_modes,
    mode_table,
    modes_of_model,
    posterior_modes,
    shape_table,
)
from femupdate.workflow.observed import direction_of
from femupdate.workflow.summary import kept_posterior

_MODES = 3


@dataclass(frozen=True)
class RenderReport(Result):
    """Modes of the posterior and where they are drawn.

    Attributes:
        pictures: of every mode.
        animations: of the modes, as GIF files, where they were asked for.
        at_one: pictures of modes at factors 1, which the posterior's model does not have.
        shapes: their shapes at the floors, which `uff` has as well.
    """

    modes: tuple[StudyMode, ...]
    pictures: tuple[Path, ...]
    animations: tuple[Path, ...] = ()
    at_one: tuple[Path, ...] = ()
    shapes: Table | None = None
    uff: Path | None = None

    def items(self) -> Iterator[Item]:
        """A table and the pictures."""
        modes = mode_table(self.modes, self.pictures)
        if self.modes:
            yield modes
            if self.shapes is not None:
                yield self.shapes
            yield Notes((modes.note,))
            yield Note(f"  {self.uff}", {"uff": self.uff})
        else:
            yield Note(content={"modes": []})
        for path in dict.fromkeys(self.pictures):
            yield Note(f"  {path}")
        yield Note(
            "\n".join(f"  {path}" for path in self.animations), {"animations": self.animations}
        )
        if self.at_one:
            yield Note("  - The base motion does not excite these modes, so no data changed them:")
        told = "\n".join(f"  {path}" for path in self.at_one)
        yield Note(told, {"at_factors_1": self.at_one})


def render_study(
    study: Study,
    model: StudyModel,
    modes: int = _MODES,
    samples: int = 60,
    *,
    wanted: Sequence[int] = (),
    animated: bool = False,
    seed: int = 0,
    progress: Progress = SILENT,
) -> RenderReport:
    """Draw the mean shape and its spread of modes.

    Args:
        study: with a posterior.
        modes: how many, of those that move most of the mass.
        wanted: numbers of modes, as `build-model` lists them, to draw instead.
        animated: write GIF files of the modes as well.

    Raises:
        StudyError: there is no posterior, it is of another building, or no mode has the number.
    """
    study.check_fresh("posterior", model.made_from(), "calibrate")
    posterior = kept_posterior(study, model.building)
    model = on_kept_finer(study, model)
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
    have = {mode.number for mode in tracked}
    drawn = draw_modes(study, model, tracked, progress=progress) if tracked else ()
    at_one = []
    for number in wanted:
        if number not in have:
            shape = full.shapes[number - 1].reshape(-1, 3)
            frequency, direction = full.frequency_hz[number - 1], full.direction[number - 1]
            title = f"Mode {number} ({direction}), {frequency:.2f} Hz, all factors 1"
            figure = mode_shape_figure(_geometry(model), shape, title=title)
            path = study.path("pictures", f"model_mode_{number}.png")
            at_one.append(save_figure(figure, path))
    moving = _animate(study, model, tracked, progress) if animated and tracked else ()
    shapes = shape_table(model, posterior, tracked) if tracked else None
    file = None
    if tracked:
        zeta = posterior.zeta_samples
        written = [
            RecordedMode(
                name=mode.label,
                frequency_hz=mode.tracked.frequency_mean,
                damping=None if zeta is None else float(zeta.mean()),
                sensors=model.reduced.floors,
                shape=(mode.tracked.recognised @ model.reduced.floor_shapes.T).mean(axis=0),
            )
            for mode in tracked
        ]
        levels, along = levels_with_base(model.building)[1:], direction_of(model.building)
        path = study.result("tables", "shapes.uff")
        file = write_modes_uff(path, written, levels.tolist(), along)
    return RenderReport(tracked, drawn, moving, tuple(at_one), shapes, file)


def draw_model(
    study: Study, model: StudyModel, modes: FullModes, progress: Progress = SILENT
) -> tuple[Path, ...]:
    """Draw the modes that move most of the mass, at theta = 1."""
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
    # Pictures of the model lie in the study, those of a posterior beside its other results.
    folder = study.result("pictures") if name == "mode" else study.path("pictures")
    several = len(modes[0].tracked.frequency_hz) > 1
    if model.reduced.node_shapes is None:
        shapes = [mode.tracked.recognised @ model.reduced.floor_shapes.T for mode in modes]
        figure = stick_mode_shapes(
            levels_with_base(model.building),
            _with_base([shape.mean(axis=0) for shape in shapes]),
            [_heading(mode) for mode in modes],
            shapes_sd=_with_base([shape.std(axis=0) for shape in shapes]) if several else None,
            floors=("base", *model.reduced.floors),
            title="Mode shapes of the posterior" if several else "Mode shapes, all factors 1",
        )
        return (save_figure(figure, folder / f"{name}s.png"),) * len(modes)
    geometry, building = _geometry(model), model.building
    floors = list(zip(("base", *building.floors), levels_with_base(building), strict=True))
    progress.start("Drawing mode shapes", len(modes))
    paths = []
    for mode in modes:
        mean, spread = mean_shape(node_displacements(model.reduced, mode.tracked.recognised))
        sd = spread if several else None
        figure = mode_shape_figure(geometry, mean, shape_sd=sd, floors=floors, title=_title(mode))
        paths.append(save_figure(figure, folder / f"{name}_{_file_label(mode)}.png"))
        progress.advance()
    return tuple(paths)


def _animate(
    study: Study, model: StudyModel, modes: Sequence[StudyMode], progress: Progress
) -> tuple[Path, ...]:
    """Write the mean shapes of modes as GIF files; the modes of a stick share one."""
    progress.start("Animating mode shapes", len(modes))
    means = [mode.tracked.recognised.mean(axis=0) for mode in modes]
    if model.reduced.node_shapes is None:
        path = study.result("pictures", "modes.gif")
        levels, floors = levels_with_base(model.building), ("base", *model.reduced.floors)
        shapes = _with_base([mean @ model.reduced.floor_shapes.T for mean in means])
        return (stick_animation(levels, shapes, [_heading(mode) for mode in modes], floors, path),)
    geometry, paths = _geometry(model), []
    for mode, mean in zip(modes, means, strict=True):
        shape = node_displacements(model.reduced, mean)
        path = study.result("pictures", f"mode_{_file_label(mode)}.gif")
        paths.append(mode_animation(geometry, shape, path, title=_title(mode)))
        progress.advance()
    return tuple(paths)


def _geometry(model: StudyModel) -> Geometry:
    return Geometry.of_model(mesh_building(model.building).model)


def _title(mode: StudyMode) -> str:
    """Over a picture of one mode."""
    name, frequency, share = _heading(mode).split("\n")
    at_one = ", all factors 1" if len(mode.tracked.frequency_hz) == 1 else ""
    return f"{name}: {frequency}, {share}{at_one}"


def _heading(mode: StudyMode) -> str:
    """Name, frequency and share of the mass of a mode, each on a line."""
    tracked = mode.tracked
    frequency = f"{tracked.frequency_mean:.2f}"
    if len(tracked.frequency_hz) > 1:
        frequency = plus_minus(tracked.frequency_mean, tracked.frequency_sd)
    return f"{capital(mode.name)}\n{frequency} Hz\n{100.0 * mode.effective_mass:.1f} % of the mass"


def _file_label(mode: StudyMode) -> str:
    """Number of a mode in the name of its picture, or its frequency in tenths of 1 Hz."""
    return str(mode.number or f"{mode.tracked.frequency_mean:.1f}_Hz")


def levels_with_base(building: Building) -> Floats:
    """Heights of base and floors, m; one a story where the file gives no heights."""
    heights = [getattr(story, "height", None) or 1.0 for story in building.stories]
    return np.concatenate([[0.0], np.cumsum(heights)])


def _with_base(shapes: Sequence[Floats]) -> Floats:
    """Shapes (m, f) with the base, which stands still, before the floors."""
    return np.array([[0.0, *shape] for shape in shapes])
