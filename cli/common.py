"""What all commands share: options, progress, errors, and what is printed."""

import errno
import functools
import json
import logging
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import click

from femupdate.bars import Bars
from femupdate.errors import FemupdateError
from femupdate.progress import SILENT
from femupdate.result import Result, plain
from femupdate.study import MAIN_POSTERIOR, Study, locked, timed
from femupdate.tables import write_tables

from .group import Failure
from .parameters import (
    BAND,
    BUILDING_NAME,
    CHANNEL,
    COLUMNS,
    INPUT_FILE,
    NAMES,
    STUDY_FOLDER,
    Kind,
)


@dataclass(frozen=True)
class Answer:
    """What a command prints when its work is done.

    Attributes:
        pictures: files drawn; None of a command that draws none of its own.
        more: goes into the JSON object as well.
        files: other files written, named beside the pictures.
        tables: CSV files written, named to those who ask for more; None where none could be.
    """

    result: Result
    more: dict[str, Any] = field(default_factory=dict)
    pictures: tuple[Path, ...] | None = None
    files: tuple[Path, ...] = ()
    tables: tuple[Path, ...] | None = None

    def show(self, as_json: bool, details: bool = False) -> None:
        """Print it, for scripts or for people, the path of each file once."""
        if as_json:
            made = {"pictures": self.pictures, "tables": self.tables}
            written = {key: paths for key, paths in made.items() if paths is not None}
            content = {**self.result.as_dict(), **plain({**written, **self.more})}
            click.echo(json.dumps(content, indent=2))
            return
        click.echo("\n".join(self.result.lines(details)))
        tables = (self.tables or ()) if details else ()
        for path in dict.fromkeys((*(self.pictures or ()), *self.files, *tables)):
            click.echo(f"  {path}")


F = TypeVar("F", bound=Callable[..., Any])


def option(
    names: str, text: str, kind: Any = None, default: Any = None, **more: Any
) -> Callable[[F], F]:
    """An option by its names, help, type and default, which the help shows."""
    if default is not None:  # none at all, for click lets a required option be None by default
        more = {"default": default, "show_default": True, **more}
    return click.option(*names.split(), type=kind, help=text, **more)


def flag(names: str, text: str) -> Callable[[F], F]:
    """An option that is there or not."""
    return click.option(*names.split(), is_flag=True, help=text)


NEW_FILE = click.Path(dir_okay=False, path_type=Path)

building_option = option("--building", "Shipped name or TOML file, for a new study.", BUILDING_NAME)
observations_argument = click.argument("observations", type=INPUT_FILE, nargs=-1, required=True)
unit_option = option("--unit", "Unit of the accelerations, where the file gives none.")
channel_option = option("--channel", "Channel of the record, by name or number.", CHANNEL)
scale_option = option("--scale", "Factor on the record.", float, 1.0)
overwrite_option = flag("--overwrite", "Overwrite an existing file.")
no_pictures_option = flag("--no-pictures", "Draw no pictures.")


def output_option(text: str, *, required: bool = True) -> Callable[[F], F]:
    """Add --output of a command that writes one file."""
    return option("-o --output", text, NEW_FILE, required=required)


def check_free(output: Path, overwrite: bool) -> None:
    """Refuse a file that is there, unless it is to be overwritten.

    Raises:
        Failure: it is there.
    """
    if output.exists() and not overwrite:
        raise Failure(f"{output} is there already; choose another name, or add --overwrite")


_STUDY = option("--study", "Folder that holds everything for one building.", STUDY_FOLDER, "study")
_POSTERIOR = option(
    "--posterior",
    "Posterior of the study to use, as `calibrate --name` named it.",
    default=MAIN_POSTERIOR,
    metavar="NAME",
)


def study_options(
    *,
    needs: str = "",
    posterior: bool = False,
    writes: bool = True,
    draws: bool = True,
    seeded: bool = True,
) -> Callable[[Callable[..., Answer]], Callable[..., None]]:
    """Add --study, --seed, --json and -v, print the answer, turn errors into exit code 1.

    The function gets `study`, `seed` and `bars`, the progress. Pictures and tables of what it
    found are drawn and written beside the other results of the posterior.

    Args:
        needs: artefact that the study must hold, made by `femupdate calibrate`; of a posterior,
            whose name is asked for as well.
        posterior: ask for the name of a posterior, which the study may lack.
    """
    asked = {_POSTERIOR: posterior or bool(needs), no_pictures_option: draws}

    def decorate(function: Callable[..., Answer]) -> Callable[..., None]:
        @_STUDY
        @(running if seeded else reporting)
        @functools.wraps(function)
        def wrapper(*args: Any, study: Study, as_json: bool, **kwargs: Any) -> None:
            study = Study(study.folder, kwargs.pop("posterior", MAIN_POSTERIOR))
            if needs:
                study.require(needs, "calibrate")
            pictures = draws and not kwargs.pop("no_pictures")
            with ExitStack() as stack:
                if writes:
                    study.check_writable()
                    stack.enter_context(locked(study.folder))
                bars = SILENT if asked_for("quiet") else stack.enter_context(Bars())
                answer = function(*args, study=study, bars=bars, **kwargs)
                study = Study(study.folder, kwargs.get("name", study.posterior))
                if writes and (tables := answer.result.tables()):
                    answer = replace(answer, tables=write_tables(study.result("tables"), tables))
                if pictures:
                    from femupdate.report.figure import draw

                    drawn = draw(answer.result, study.result("pictures"), bars)
                    answer = replace(answer, pictures=drawn)
                elif draws:
                    answer = replace(answer, pictures=())
            answer.show(as_json, asked_for("verbose"))

        return together(*[add for add, wanted in asked.items() if wanted][::-1])(wrapper)

    return decorate


def asked_for(name: str) -> bool:
    """Whether the running command was given a flag that all commands have."""
    return bool(click.get_current_context().params.get(name))


def plain_options(function: Callable[..., Answer]) -> Callable[..., None]:
    """Add --json and -v to a command that needs no study, and print its answer."""

    @reporting
    @functools.wraps(function)
    def wrapper(*args: Any, as_json: bool, **kwargs: Any) -> None:
        function(*args, **kwargs).show(as_json, asked_for("verbose"))

    return wrapper


def columns_options(function: F) -> F:
    """Add --columns, and --rate, which is passed on with it."""

    @option("--columns", "Column names: ours=theirs,...", COLUMNS)
    @option("--rate", "Samples a second, of a table without times.", click.FloatRange(1e-3, 1e6))
    @functools.wraps(function)
    def wrapper(*args: Any, columns: Any, rate: Any, **kwargs: Any) -> Any:
        return function(*args, columns=timed(columns, rate), **kwargs)

    return wrapper  # type: ignore[return-value]


def together(*options: Callable[[F], F]) -> Callable[[F], F]:
    """Add options in the order of the help."""
    return lambda function: functools.reduce(lambda made, add: add(made), options[::-1], function)


def reading_options(function: F) -> F:
    """Add the options for reading observation files."""
    return together(
        option("--sensors", "Floors to use, such as RF or 2F,RF; default all.", NAMES, ()),
        option("--band band_hz", "Frequency range, such as 0.5,18 (Hz).", BAND),
        unit_option,
        columns_options,
        option(
            "--mode-error",
            "Error of the model's own natural frequencies, as a ratio, beside the learned one.",
            click.FloatRange(0.0, 0.5, min_open=True),
        ),
        option("--force", "Floor that was hit or shaken, where column names do not say it."),
    )(function)


def running(function: F) -> F:
    """Add --seed, --json and -v, and turn the library's errors into exit code 1."""
    return option("--seed", "Random seed.", click.IntRange(0, 2**32 - 1), 0)(reporting(function))


def reporting(function: F) -> F:
    """Add --json, -v and -q, and turn the library's errors into exit code 1."""

    @flag("--json as_json", "Print one JSON object on stdout.")
    @click.option("-v", "--verbose", count=True, help="Say more; -vv for debugging.")
    @flag("-q --quiet", "Show no progress, only the answer.")
    @functools.wraps(function)
    def wrapper(*args: Any, verbose: int, quiet: bool, **kwargs: Any) -> Any:
        level = {0: logging.WARNING, 1: logging.INFO}.get(verbose, logging.DEBUG)
        logging.basicConfig(level=logging.WARNING, format="%(message)s", stream=sys.stderr)
        logging.getLogger("femupdate").setLevel(level)
        try:
            _require_inputs()
            return function(*args, **kwargs)
        except FemupdateError as error:
            if verbose >= 2:
                logging.getLogger(__name__).exception("traceback")
            raise Failure(str(error)) from error
        except BrokenPipeError:  # such as `| head`; click ends quietly
            raise
        except OSError as error:
            where, why = error.filename or "a file", error.strerror or error
            full = error.errno == errno.ENOSPC
            raise Failure(
                f"cannot write {where}: the disk is full; free some space and run the command again"
                if full
                else f"{where}: {why}; check the path and its permissions"
            ) from error

    return wrapper  # type: ignore[return-value]


def _require_inputs() -> None:
    """Refuse a misspelt name before anything heavy is imported."""
    context = click.get_current_context()
    for parameter in context.command.params:
        value = context.params.get(parameter.name or "")
        kind = parameter.type
        if isinstance(kind, Kind) and kind.require is not None and value is not None:
            for item in value if isinstance(value, tuple) else (value,):
                kind.require(item)
