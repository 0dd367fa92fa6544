"""femupdate benchmark NAME: a group whose benchmarks are imported when they are called.

A new benchmark is a line in `_BENCHMARKS` and a module that holds its click command as `command`,
with `benchmark_options` of `common` for --output, --seed, --json and -v.
"""

import click

from .lazy import LazyGroup

_BENCHMARKS = {
    "solver": (
        "benchmark_solver",
        "Element tests against published values; speed against OpenSees.",
    ),
    "shear4dof": (
        "benchmark_shear4dof",
        "The posterior with four modes: published tables, and the exact posterior.",
    ),
    "calibration": (
        "benchmark_calibration",
        "Whether posteriors hold the truth as often as they say.",
    ),
    "hidden-effects": (
        "benchmark_hidden_effects",
        "What the effect finder makes of effects that were hidden.",
    ),
    "training": (
        "benchmark_training",
        "Our network and the published layout, trained side by side.",
    ),
    "latent-size": (
        "benchmark_latent_size",
        "How many latent coordinates a building's data can tell apart.",
    ),
}


@click.group("benchmark", cls=LazyGroup, commands=_BENCHMARKS)
def command() -> None:
    """Published tables and other programs, side by side with ours.

    Each benchmark prints its table and writes it, with machine and date, as JSON and Markdown
    into the folder --output.
    """
