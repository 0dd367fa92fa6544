"""femupdate benchmark hidden-effects."""

import click
from femupdate.cli.common import shared_out

from ..command import benchmark_options
from ..result import Job, Report


@click.command("hidden-effects")
@click.option("--building", default="shear_4dof", show_default=True, help="Shipped name or file.")
@click.option(
    "--clean",
    type=click.IntRange(min=0),
    default=100,
    show_default=True,
    help="Cases without an effect.",
)
@click.option(
    "--one",
    type=click.IntRange(min=0),
    default=150,
    show_default=True,
    help="Cases with one effect.",
)
@click.option(
    "--two",
    type=click.IntRange(min=0),
    default=30,
    show_default=True,
    help="Cases with two effects.",
)
@click.option(
    "--outside",
    type=click.IntRange(min=0),
    default=30,
    show_default=True,
    help="Cases with an effect outside the catalogue.",
)
@click.option("--mesh-size", type=float, help="Mesh size of the truth, m; default: .4 of its own.")
@click.option(
    "--data",
    type=click.Choice(["base", "modes", "force"]),
    default="base",
    show_default=True,
    help="Records of base motion, identified modes, or a hammer test.",
)
@click.option("--opensees", is_flag=True, help="OpenSees makes the truths, not our finer mesh.")
@click.option("--no-phase", is_flag=True, help="Use the amplitude alone.")
@click.option(
    "--minutes", type=click.FloatRange(min=0), help="Minutes after which no trial is started."
)
@click.option("--quick", is_flag=True, help="A dozen trials, to try it out.")
@click.option(
    "--dask",
    metavar="ADDRESS",
    help="Share the trials out by Dask: address of a scheduler, or local for processes.",
)
@benchmark_options
def command(
    job: Job,
    building: str,
    data: str,
    mesh_size: float | None,
    opensees: bool,
    no_phase: bool,
    minutes: float | None,
    quick: bool,
    dask: str | None,
    **counts: int,
) -> Report:
    """Put effects into simulated measurements and count what the finder makes of them.

    Outcomes are written one by one, so an interrupted run resumes.
    """
    from .measurement import OPENSEES, OURS, TrialSettings
    from .run import QUICK, TrialPlan, run_hidden_effects

    plan = QUICK if quick else TrialPlan(**counts)
    truth = OPENSEES if opensees else OURS
    settings = TrialSettings(mesh_size=mesh_size, use_phase=not no_phase, truth=truth)
    limit = float("inf") if minutes is None else minutes
    with shared_out(dask):
        return run_hidden_effects(job, building, plan, settings, limit, data)
