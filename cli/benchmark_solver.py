"""femupdate benchmark solver."""

from pathlib import Path

import click

from .common import benchmark_options, print_json


@click.command("solver")
@benchmark_options
def command(output_folder: Path, seed: int, as_json: bool) -> None:
    """Element tests against published values; speed against OpenSees."""
    from femupdate.benchmark.machine import this_machine

    machine = this_machine()
    if as_json:
        print_json({"machine": machine.sentence()})
        return
    click.echo(machine.sentence())
