"""render: the posterior's mode shapes, off screen."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from femupdate.dynamics.tracking import (
    ReducedModes,
    TrackedMode,
    driven_modes,
    reduced_modes,
    track_mode,
)
from femupdate.inference.posterior import Posterior, load_posterior
from femupdate.progress import Progress
from femupdate.study import Study
from femupdate.tables import table
from femupdate.workflow.model import StudyModel
from femupdate.workflow.pictures_modes import draw_modes


@dataclass(frozen=True)
class RenderReport:
    """Modes of the posterior that the base motion drives, lowest first.

    Attributes:
        modes: frequencies and shapes.
        pictures: where each is drawn.
    """

    modes: tuple[TrackedMode, ...]
    pictures: tuple[Path, ...]

    def as_dict(self) -> dict[str, Any]:
        """What `--json` holds."""
        return {
            "modes": [
                {
                    "mode": number,
                    "frequency_hz": mode.frequency_mean,
                    "frequency_sd": mode.frequency_sd,
                    "found": mode.found,
                    "picture": picture,
                }
                for number, (mode, picture) in enumerate(
                    zip(self.modes, self.pictures, strict=True), start=1
                )
            ]
        }

    def lines(self) -> tuple[str, ...]:
        """A table and the pictures, for people."""
        rows = [
            (str(k), f"{m.frequency_mean:.3f}", f"{m.frequency_sd:.3f}", f"{m.found:.0%}")
            for k, m in enumerate(self.modes, start=1)
        ]
        pictures = (f"  {picture}" for picture in dict.fromkeys(self.pictures))
        return (table(("mode", "Hz", "sd", "recognised in draws"), rows), *pictures)


def render_study(
    study: Study,
    model: StudyModel,
    modes: int = 3,
    samples: int = 60,
    *,
    seed: int = 0,
    progress: Progress | None = None,
) -> RenderReport:
    """Draw the mean shape and its spread for the lowest modes that the base motion drives.

    Raises:
        StudyError: there is no posterior, or it is of another building.
    """
    posterior = load_posterior(study.require("posterior", "calibrate"))
    study.check_fresh("posterior", model.made_from(), "calibrate")
    tracked = posterior_modes(model, posterior, modes, samples, seed)
    return RenderReport(tracked, draw_modes(study, model, tracked, progress=progress))


def posterior_modes(
    model: StudyModel, posterior: Posterior, modes: int, samples: int = 60, seed: int = 0
) -> tuple[TrackedMode, ...]:
    """The lowest modes that the base motion drives, followed through draws of the posterior."""
    # Behind the factors stand parameters of effects, which these shapes do not show.
    theta = posterior.thinned(samples, seed)[0][:, : model.reduced.parameters]
    # The reference is the draw nearest to the mean: the mean itself can lie between modes.
    centre = ((theta - theta.mean(axis=0)) / theta.std(axis=0)) ** 2
    nearest = int(centre.sum(axis=1).argmin())
    found = reduced_modes(model.reduced, theta)
    reference = ReducedModes(found.frequency_hz[[nearest]], found.vectors[[nearest]])
    chosen = driven_modes(model.reduced, reference, modes)
    return tuple(track_mode(found, reference.vectors[0][:, mode]) for mode in chosen)
