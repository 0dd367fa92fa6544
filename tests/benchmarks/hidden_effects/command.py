"""femupdate benchmark hidden-effects."""

import click

from ..command import benchmark_options
from ..result import Job, Report


@click.command("hidden-effects")
@click.option("--building", default="shear_4dof", show_default=True, help="Shipped name or file.")
@click.option("--clean", type=click.IntRange(min=0), default=100, show_default=True)
@click.option("--one", type=click.IntRange(min=0), default=150, show_default=True)
@click.option("--two", type=click.IntRange(min=0), default=30, show_default=True)
@click.option("--outside", type=click.IntRange(min=0), default=30, show_default=True)
@click.option("--mesh-size", type=float, help="Of the truth of a frame, m; default .4 of its own.")
@click.option("--no-phase", is_flag=True, help="Use |H| alone.")
@click.option("--minutes", type=click.FloatRange(min=0), help="Start no trial after so many.")
@click.option("--quick", is_flag=True, help="A dozen trials, to see it work.")
@benchmark_options
def command(
    job: Job,
    building: str,
    mesh_size: float | None,
    no_phase: bool,
    minutes: float | None,
    quick: bool,
    **counts: int,
) -> Report:
    """Put effects into simulated measurements and count what the finder makes of them.

    Outcomes are written one by one: called again, the command goes on where it stopped.
    """
    from .measurement import TrialSettings
    from .run import QUICK, TrialPlan, run_hidden_effects

    plan = QUICK if quick else TrialPlan(**counts)
    settings = TrialSettings(mesh_size=mesh_size, use_phase=not no_phase)
    limit = float("inf") if minutes is None else minutes
    return run_hidden_effects(job, building, plan, settings, limit)
