"""femupdate benchmark hidden-effects."""

from pathlib import Path

import click
from femupdate.cli.answer import print_json, print_pictures
from femupdate.cli.bars import Bars
from femupdate.cli.common import benchmark_options


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
    building: str,
    clean: int,
    one: int,
    two: int,
    outside: int,
    mesh_size: float | None,
    no_phase: bool,
    minutes: float | None,
    quick: bool,
    output_folder: Path,
    seed: int,
    as_json: bool,
) -> None:
    """Hide effects in simulated measurements and count what the finder makes of them.

    Outcomes are written one by one: called again, the command goes on where it stopped.
    """
    from .cases import TrialSettings
    from .run import QUICK, Plan, run_hidden_effects

    plan = QUICK if quick else Plan(clean, one, two, outside)
    settings = TrialSettings(mesh_size=mesh_size, use_phase=not no_phase)
    with Bars() as bars:
        report = run_hidden_effects(
            output_folder,
            building,
            plan,
            settings,
            seed,
            bars,
            minutes=float("inf") if minutes is None else minutes,
        )
    if as_json:
        rows = [{"what": r.what, "found": r.found, "cases": r.of} for r in report.rows]
        print_json({"rows": rows, "results": [report.files.json, report.files.markdown]})
        return
    click.echo(report.text)
    print_pictures((report.files.json, report.files.markdown))
