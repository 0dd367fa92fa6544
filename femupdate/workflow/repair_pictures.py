"""Pictures of a repair: the gap before and after."""

from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.discrepancy.fit import Fit
from femupdate.discrepancy.posterior import Draws
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.repair import Repair
from femupdate.discrepancy.where import residual_cells
from femupdate.dynamics.effect_response import ReducedStructure
from femupdate.study import Study
from femupdate.workflow.diagnose import cells_as_grid
from femupdate.workflow.held_out import Held


def draw_repair(
    study: Study,
    reduced: ReducedStructure,
    problem: Problem,
    done: Repair,
    before: Draws,
    after: Draws,
    held: Held | None,
) -> tuple[Path, ...]:
    """The maps of residuals before and after, and the picture that tells the whole story.

    Args:
        study: where the pictures go.
        reduced: the structure.
        problem: the data.
        done: the models before and after.
        before, after: draws of their posteriors.
        held: on data kept out, if any.
    """
    from femupdate.report.figure import save_figure
    from femupdate.report.glyphs import Glyphs
    from femupdate.report.plot_diagnosis import residual_map
    from femupdate.report.plot_repair import Curves, GapStory, Scene, gap_story
    from femupdate.workflow.effect_glyphs import effect_glyphs, geometry_of

    floors, edges, first = cells_as_grid(residual_cells(problem, done.before))
    maps = [("before", first)]
    names = [one.finding.placed for one in done.rounds]
    scene = None
    if done.rounds:
        last = cells_as_grid(residual_cells(problem, done.after))[2]
        maps.append(("after", last))
        structure = reduced.structure
        geometry = geometry_of(structure)
        glyphs = sum((effect_glyphs(structure, geometry, one) for one in names), Glyphs())
        levels = list(zip(structure.floors, structure.levels.tolist(), strict=True))
        caption = "\n".join(
            f"{one.finding.placed.effect.title}, {one.finding.placed.place}" for one in done.rounds
        )
        scene = Scene(edges, first, last, geometry, glyphs, levels, caption)
    title = " and ".join(f"{p.effect.title.lower()} at {p.place}" for p in names)
    headline = f"Added: {title}" if names else "Nothing was added"
    paths = [
        save_figure(
            residual_map(floors, edges, maps, title=headline),
            study.path("pictures", "gap_residuals.png"),
        )
    ]
    first_record = slice(problem.blocks[0].points)
    measured = np.where(np.isfinite(problem.sd.numpy()), problem.log_frf.numpy(), np.nan)
    curves = Curves(
        problem.frequency_hz.numpy()[first_record],
        floors,
        measured[:, first_record],
        _log_frf(problem, done.before),
        _log_frf(problem, done.after) if done.rounds else None,
    )
    story = GapStory(
        headline,
        scene,
        curves,
        [f"θ{k + 1}" for k in range(before.theta.shape[1])],
        before.theta,
        after.theta if done.rounds else None,
        None if held is None or held.time is None else held,
    )
    paths.append(save_figure(gap_story(story), study.path("pictures", "gap_before_after.png")))
    return tuple(paths)


def _log_frf(problem: Problem, fitted: Fit) -> Floats:
    theta, zeta, sizes = fitted.coordinates.split(fitted.weighed.z[None], problem.fixed_zeta)
    frequency = problem.frequency_hz[: problem.blocks[0].points]
    frf = fitted.system.frf(theta, zeta, sizes, frequency)[0, list(problem.rows)]
    return np.asarray(frf.abs().log().numpy())
