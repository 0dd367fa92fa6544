"""render: the posterior's mode shapes, off screen."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from femupdate.errors import StudyError
from femupdate.progress import SILENT, Progress
from femupdate.result import Item, Note, Notes, Result
from femupdate.study import Study
from femupdate.workflow.model import StudyModel, on_kept_finer
from femupdate.workflow.modes import StudyMode, find_modes, mode_table, posterior_modes
from femupdate.workflow.summary import kept_posterior


@dataclass(frozen=True)
class RenderReport(Result):
    """Modes of the posterior, those that matter most to the data first.

    Attributes:
        modes: numbers, frequencies and shapes.
        pictures: where each is drawn.
        animations: of the modes, as GIF files, where they were asked for.
        at_one: pictures of modes at factors 1, which the posterior's model does not have.
    """

    modes: tuple[StudyMode, ...]
    pictures: tuple[Path, ...]
    animations: tuple[Path, ...] = ()
    at_one: tuple[Path, ...] = ()

    def items(self) -> Iterator[Item]:
        """A table and the pictures."""
        modes = mode_table(self.modes, self.pictures)
        if self.modes:
            yield modes
            yield Notes((modes.note,))
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
    modes: int = 3,
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
        modes: how many, of those that matter most to the data.
        wanted: numbers of modes, as `build-model` lists them, to draw instead.
        animated: write GIF files of the modes as well.

    Raises:
        StudyError: there is no posterior, it is of another building, or no mode has the number.
    """
    from femupdate.workflow.pictures_modes import animate_modes, draw_at_one, draw_modes

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
    have = {one.number for one in tracked}
    others = [number for number in wanted if number not in have]
    drawn = draw_modes(study, model, tracked, progress=progress) if tracked else ()
    at_one = draw_at_one(study, model, full, others) if others else ()
    moving = animate_modes(study, model, tracked, progress) if animated and tracked else ()
    return RenderReport(tracked, drawn, moving, at_one)
