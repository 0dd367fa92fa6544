"""femupdate benchmark NAME: the commands of all benchmarks, each of which runs a `Job`.

A new benchmark is a function here that hands the job to its module and returns its `Report`.
"""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
from femupdate.cli.common import Answer, Failure, running
from femupdate.cli.parameters import BUILDING_NAME, COLUMNS, INPUT_FILE, NAMES

from femupdate.bars import Bars

from .frame_coverage import BUILDING
from .result import Job, Report

Command = Callable[..., Report]


@click.group("benchmark")
def group() -> None:
    """Published tables and other programs, side by side with ours.

    Each benchmark prints its table and writes it, with machine and date, as JSON into the folder
    --output. Cases are kept there as they end, so that an interrupted run goes on.
    """


def benchmark(name: str) -> Callable[[Command], click.Command]:
    """A command of the group with --output, --seed, --json and -v, which prints its report.

    Errors of the library end the command with exit code 1.
    """

    def command(function: Command) -> click.Command:
        @group.command(name, short_help=(function.__doc__ or "").splitlines()[0])
        @click.option(
            "--output",
            "output_folder",
            type=click.Path(file_okay=False, path_type=Path),
            default=Path("benchmarks"),
            show_default=True,
            help="Folder for the results.",
        )
        @running
        @functools.wraps(function)
        def run(output_folder: Path, seed: int, as_json: bool, **options: Any) -> None:
            with Bars() as bars:
                report = function(Job(output_folder, seed, bars), **options)
            Answer(report, files=(report.json,)).show(as_json)

        return run

    return command


def count(name: str, default: int | None, least: int, text: str) -> Callable[[Command], Command]:
    """An option that is a whole number, at least so large."""
    kind = click.IntRange(min=least)
    return click.option(name, type=kind, default=default, show_default=True, help=text)


def building_option(default: str, text: str) -> Callable[[Command], Command]:
    """The building that is tried."""
    return click.option("--building", default=default, show_default=default != str(BUILDING),
                        help=text)  # fmt: skip


@benchmark("all")
@click.option("--quick", is_flag=True, help="The cheap half of the runs, some ten minutes.")
@click.option(
    "--reference",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Figures to compare with; default: docs/results/regression.json.",
)
@click.option("--only", default="*", show_default=True, help="Names of runs, such as 'finder*'.")
def regression(job: Job, quick: bool, reference: Path | None, only: str) -> Report:
    """Every command on fixed data, beside a reference: what has fallen is marked.

    To run before a release. A figure outside of its tolerance, a slower run and one with more than
    2 GB are marked, and the exit code is then 1. Runs in the output folder are not made again.
    """
    from .regression.run import REFERENCE, run_regression

    report, fallen = run_regression(job, reference or REFERENCE, quick, only)
    if fallen:
        click.echo(report.text, err=True)
        raise Failure(f"{fallen} lines of {report.json} are outside of their tolerance")
    return report


@benchmark("solver")
@click.option(
    "--sizes",
    type=NAMES,
    default="small",
    show_default=True,
    help="Buildings of the speed comparison: small, medium, large, with commas (1,680, 8,640 and "
    '31,110 shells; seconds, minutes and a quarter of an hour), or "" for none.',
)
def solver(job: Job, sizes: tuple[str, ...]) -> Report:
    """Element tests against published values; speed against OpenSees."""
    from .solver.run import run_solver

    return run_solver(job, sizes)


@benchmark("shear4dof")
@count("--observations", 20, 1, "Simulated buildings that judge latent posterior and bridge.")
@click.option("--quick", is_flag=True, help="A few runs with few particles, to try it out.")
def shear4dof(job: Job, observations: int, quick: bool) -> Report:
    """The posterior with four modes: the published table, and the exact posterior."""
    from .shear4dof.run import QUICK, Shear4dofPlan, run_shear4dof

    return run_shear4dof(job, QUICK if quick else Shear4dofPlan(observations=observations))


@benchmark("calibration")
@building_option("shear_4dof", "Shipped name.")
@click.option(
    "--sensors",
    "floors",
    type=NAMES,
    default=(),
    help="Observed floors, or `any` for random sets; default: the roof alone.",
)
@count("--cases", 200, 10, "Simulated buildings.")
@count("--particles", 1000, 200, "Posterior draws for each.")
@count("--beside", None, 0, "Number of cases with data-space posteriors; default: all.")
@click.option(
    "--noise",
    "noise_sd",
    type=click.FloatRange(min=1e-3),
    help="Noise on ln|H|; default: that of the training.",
)
def calibration(job: Job, **plan: Any) -> Report:
    """Whether posteriors hold the truth as often as they say.

    Coverage of latent and data-space posteriors. The binomial error of the coverage
    of the 90 % region is 2 % with 200 cases and 1 % with 1000.
    """
    from .calibration.run import CalibrationPlan, run_calibration

    return run_calibration(job, CalibrationPlan(**plan))


@benchmark("records")
@count("--records", 12, 2, "Records of every kind.")
def records(job: Job, records: int) -> Report:
    """Errors over stated standard deviations of a right model, by records of thirteen kinds."""
    from .records import run_records

    return run_records(job, records)


@benchmark("kinds")
@count("--cases", 60, 1, "Towers, each seen in every way.")
def kinds(job: Job, cases: int) -> Report:
    """Errors over stated standard deviations by kinds of data, of right and of wrong models."""
    from .kinds import run_kinds

    return run_kinds(job, cases)


@benchmark("missing-effects")
@click.option("--only", default="*", show_default=True, help="Numbers of tasks, such as 0*.")
@click.option(
    "--answers",
    "others",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    multiple=True,
    help="Folder with the answers of another program, to score beside ours.",
)
def missing_effects(job: Job, **plan: Any) -> Report:
    """Twenty-four frozen tasks of missing effects: ours, and rivals beside it.

    OpenSees and MYSTRAN made the data. The tasks lie in tests/benchmarks/missing_effects, with a
    README that says how another program enters. About an hour on two cores.
    """
    from .missing_effects.run import OpenPlan, run_open

    return run_open(job, OpenPlan(**plan))


@benchmark("changes")
@count("--pairs", 50, 1, "Buildings, each measured before, without a change, and with one.")
def changes(job: Job, pairs: int) -> Report:
    """Whether a changed story is named, and how often an unchanged one.

    Each building is shear_4dof with its own stiffness factors and a story softened by 10 %; once
    the model of it is right, and once it lacks a tenth of the mass of one floor.
    """
    from .changes.run import run_changes

    return run_changes(job, pairs)


@benchmark("frame-coverage")
@building_option(str(BUILDING), "Shipped name, file or `random`; default: three stories.")
@count("--cases", 40, 1, "Simulated buildings.")
@count("--particles", 1000, 200, "Posterior draws for each.")
def frame_coverage(job: Job, **plan: Any) -> Report:
    """Whether intervals of frames hold the truth of another mesh or program.

    Truths are of a mesh of .4 or .6 times the building's own, or of OpenSees with two kinds of
    shells; half of them are shaken by white noise, half by earthquakes. Damping is .5 to 3 %.
    """
    from .frame_coverage.run import CoveragePlan, run_coverage

    return run_coverage(job, CoveragePlan(**plan))


@benchmark("measured")
@click.argument("files", type=INPUT_FILE, nargs=-1, required=True)
@click.option("--building", type=BUILDING_NAME, required=True, help="Shipped name or TOML file.")
@click.option("--base", default="base", show_default=True, help="Column of the base's motion.")
@click.option("--columns", type=COLUMNS, help="Column names: ours=theirs,...")
@count("--particles", 1000, 200, "Posterior draws.")
@count("--samples", 200, 20, "Histories of a prediction.")
@click.option("--several", is_flag=True, help="Each file from all others together.")
@click.option("--leave-out", metavar="FLOOR", help="Keep a floor from the calibrations.")
def measured(job: Job, **plan: Any) -> Report:
    """How honest intervals are: each of the measured FILES from every other, of one structure."""
    from .measured.run import MeasuredPlan, run_measured

    return run_measured(job, MeasuredPlan(**plan))
