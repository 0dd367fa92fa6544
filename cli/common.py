"""What all commands share: options, progress, errors and JSON output."""

import functools
import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import click

from femupdate.errors import FemupdateError
from femupdate.progress import SILENT
from femupdate.result import Result
from femupdate.study import MAIN_POSTERIOR, Study, copied, locked
from femupdate.tables import require_xlsx, write_tables

from .answer import Answer
from .bars import Bars
from .parameters import (
    Band,
    BuildingName,
    Channel,
    Columns,
    Input,
    InputFile,
    Names,
    StudyFolder,
)

F = TypeVar("F", bound=Callable[..., Any])


class Failure(click.ClickException):
    """A command that failed: one plain sentence, exit code 1."""

    exit_code = 1

    def show(self, file: Any = None) -> None:
        """Print the sentence on stderr."""
        click.echo(f"Error: {self.format_message()}", err=True)


study_option = click.option(
    "--study",
    type=StudyFolder(),
    default="study",
    show_default=True,
    help="Folder that holds everything for one building.",
)
"""Adds --study to a command that takes care of the rest itself."""

building_option = click.option(
    "--building", type=BuildingName(), help="Shipped name or TOML file, for a new study."
)
observations_argument = click.argument("observations", type=InputFile(), nargs=-1, required=True)
device_option = click.option(
    "--device", default="cpu", show_default=True, help="Device for torch: cpu, cuda, ..."
)
unit_option = click.option("--unit", help="Unit of the accelerations, where the file gives none.")
channel_option = click.option(
    "--channel", type=Channel(), help="Channel of the record, by name or number."
)
scale_option = click.option(
    "--scale", type=float, default=1.0, show_default=True, help="Factor on the record."
)
overwrite_option = click.option(
    "--overwrite", "--replace", "overwrite", is_flag=True, help="Overwrite an existing file."
)
"""Of commands that write one file, with `check_free`; --replace is what it was called before."""


def output_option(text: str, *, required: bool = True) -> Callable[[F], F]:
    """Add --output of a command that writes one file.

    Args:
        text: for the help.
    """
    path = click.Path(dir_okay=False, path_type=Path)
    return click.option("-o", "--output", type=path, required=required, help=text)


def check_free(output: Path, overwrite: bool) -> None:
    """Refuse a file that is there, unless it is to be overwritten.

    Raises:
        Failure: it is there.
    """
    if output.exists() and not overwrite:
        raise Failure(f"{output} is there already; choose another name, or add --overwrite")


_POSTERIOR = click.option(
    "--posterior",
    metavar="NAME",
    default=MAIN_POSTERIOR,
    show_default=True,
    help="Posterior of the study to use, as `calibrate --name` named it.",
)
_OUTPUT = click.option(
    "--output",
    "copy",
    type=click.Path(file_okay=False, path_type=Path),
    help="Only read the study; work in a copy of it in this new folder.",
)
_DASK = click.option(
    "--dask",
    metavar="ADDRESS",
    help="Share the work out by Dask: address of a scheduler, or local for processes.",
)
_NO_PICTURES = click.option("--no-pictures", is_flag=True, help="Draw no pictures.")


def posterior_options(function: Callable[..., Answer]) -> Callable[..., Answer]:
    """Add --study and --posterior; the function gets the study with that posterior chosen."""

    @study_option
    @_POSTERIOR
    @functools.wraps(function)
    def wrapper(*args: Any, study: Study, posterior: str, **kwargs: Any) -> Answer:
        return function(*args, study=Study(study.folder, posterior), **kwargs)

    return wrapper


def study_options(
    needs: str | None = None, writes: bool = True, draws: bool = True, shares: bool = False
) -> Callable[[Callable[..., Answer]], Callable[..., None]]:
    """Add --study, --seed, --json and -v, print the answer, turn errors into exit code 1.

    The function gets `study`, `seed` and `bars`, the progress; and, where it draws pictures that
    can be left out, `pictures`.

    Args:
        needs: artefact that the study must hold, made by `femupdate calibrate`; of a posterior,
            whose name is asked for as well.
        writes: the command writes into the study; add --output, which leaves the study as it is.
        draws: add --no-pictures.
        shares: add --dask, which says where the work is done.
    """
    options = [
        *([_POSTERIOR] if needs is not None else []),
        *([_OUTPUT] if writes else []),
        *([_NO_PICTURES] if draws else []),
        *([_DASK] if shares else []),
    ]

    def decorate(function: Callable[..., Answer]) -> Callable[..., None]:
        @study_option
        @running
        @functools.wraps(function)
        def wrapper(*args: Any, study: Study, as_json: bool, **kwargs: Any) -> None:
            study = Study(study.folder, kwargs.pop("posterior", MAIN_POSTERIOR))
            if needs is not None:
                study.require(needs, "calibrate")
            if draws:
                kwargs["pictures"] = not kwargs.pop("no_pictures")
            with ExitStack() as stack:
                if copy := kwargs.pop("copy", None):
                    study = copied(study, copy)
                if writes:
                    study.check_writable()
                    stack.enter_context(locked(study.folder, _command_name()))
                stack.enter_context(shared_out(kwargs.pop("dask", None)))
                bars = progress_bars(stack)
                answer = function(*args, study=study, bars=bars, **kwargs)
            answer.show(as_json, asked_for("verbose"))

        return functools.reduce(lambda made, option: option(made), options, wrapper)

    return decorate


@contextmanager
def shared_out(address: str | None) -> Iterator[None]:
    """Have the work inside done by a Dask scheduler's workers; by this process where None.

    Raises:
        WorkersError: there is no such scheduler.
    """
    if address is None:
        yield
        return
    from femupdate.workers import dask_executor, working_on

    with dask_executor(address) as executor, working_on(executor):
        yield


def asked_for(name: str) -> bool:
    """Whether the running command was given a flag that all commands have."""
    return bool(click.get_current_context().params.get(name))


def progress_bars(stack: ExitStack) -> Any:
    """Progress on stderr, or none where it was asked for quiet."""
    return SILENT if asked_for("quiet") else stack.enter_context(Bars())


def _command_name() -> str:
    return click.get_current_context().info_name or "command"


def plain_options(function: Callable[..., Answer]) -> Callable[..., None]:
    """Add --json and -v to a command that needs no study, and print its answer."""

    @_reporting
    @functools.wraps(function)
    def wrapper(*args: Any, as_json: bool, **kwargs: Any) -> None:
        function(*args, **kwargs).show(as_json, asked_for("verbose"))

    return wrapper


def reading_options(function: F) -> F:
    """Add the options for reading observation files."""

    @click.option(
        "--sensors",
        type=Names(),
        default=(),
        help="Floors to use, such as RF or 2F,RF; default all.",
    )
    @click.option("--band", type=Band(), help="Frequency range, such as 0.5,18 (Hz).")
    @unit_option
    @columns_options
    @click.option(
        "--mode-error",
        type=click.FloatRange(min=0.0, max=0.5, min_open=True),
        help="Error of the model's own natural frequencies, as a ratio; default 0.01.",
    )
    @click.option("--force", help="Floor that was hit or shaken, where column names do not say it.")
    @functools.wraps(function)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        names = ("sensors", "unit", "columns", "mode_error", "force")
        reading = {name: kwargs.pop(name) for name in names}
        return function(*args, **reading, band_hz=kwargs.pop("band"), **kwargs)

    return wrapper  # type: ignore[return-value]


def columns_options(function: F) -> F:
    """Add --columns and --mapping, passed on as `columns`, and fill a `unit` that is missing."""

    @click.option("--columns", type=Columns(), help="Column names: ours=theirs,...")
    @click.option(
        "--mapping", type=InputFile(), help="File that says which channel is which floor."
    )
    @functools.wraps(function)
    def wrapper(*args: Any, columns: Any, mapping: Any, **kwargs: Any) -> Any:
        if mapping is None:
            return function(*args, columns=columns, **kwargs)
        if columns is not None:
            raise click.UsageError("--columns and --mapping say the same; give one of them")
        from femupdate.measurement.write import read_mapping

        try:
            columns, unit = read_mapping(mapping)
        except FemupdateError as error:
            raise Failure(str(error)) from error
        if "unit" in kwargs:
            kwargs["unit"] = kwargs["unit"] or unit
        return function(*args, columns=columns, **kwargs)

    return wrapper  # type: ignore[return-value]


def drawn(result: Result, folder: Path, wanted: bool, bars: Bars) -> tuple[Path, ...]:
    """The pictures of a result, drawn into a folder where they are wanted."""
    if not wanted:
        return ()
    from femupdate.report.figure import draw

    return draw(result, folder, bars)


@dataclass(frozen=True)
class Tables:
    """Writes tables of a command into its study.

    Attributes:
        workbook: name of the XLSX file that holds them all; None where there is none.
    """

    workbook: str | None

    def write(self, study: Study, result: Result) -> tuple[Path, ...]:
        """Write those of a result beside the others of the chosen posterior."""
        return write_tables(study.result("tables"), result.tables(), self.workbook)


def table_options(workbook: str) -> Callable[[F], F]:
    """Add --xlsx to a command that writes tables; the function gets `tables`.

    Args:
        workbook: name of the XLSX file.
    """

    def decorate(function: F) -> F:
        @click.option("--xlsx", is_flag=True, help="Also write the tables as one XLSX workbook.")
        @functools.wraps(function)
        def wrapper(*args: Any, xlsx: bool, **kwargs: Any) -> Any:
            if xlsx:
                require_xlsx()
            return function(*args, tables=Tables(workbook if xlsx else None), **kwargs)

        return wrapper  # type: ignore[return-value]

    return decorate


def running(function: F) -> F:
    """Add --seed, --json and -v, and turn the library's errors into exit code 1."""
    seed = click.option(
        "--seed",
        type=click.IntRange(0, 2**32 - 1),
        default=0,
        show_default=True,
        help="Random seed.",
    )
    return seed(_reporting(function))


def _reporting(function: F) -> F:
    """Add --json and -v, and turn the library's errors into exit code 1."""

    @click.option("--json", "as_json", is_flag=True, help="Print one JSON object on stdout.")
    @click.option("-v", "--verbose", count=True, help="Say more; -vv for debugging.")
    @click.option("-q", "--quiet", is_flag=True, help="Show no progress, only the answer.")
    @functools.wraps(function)
    def wrapper(*args: Any, verbose: int, quiet: bool, **kwargs: Any) -> Any:
        _start_logging(verbose)
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
            raise Failure(_os_failure(error)) from error

    return wrapper  # type: ignore[return-value]


def _require_inputs() -> None:
    """Refuse a misspelt name before anything heavy is imported."""
    context = click.get_current_context()
    for parameter in context.command.params:
        value = context.params.get(parameter.name or "")
        if isinstance(parameter.type, Input) and value is not None:
            for item in value if isinstance(value, tuple) else (value,):
                parameter.type.require(item)


def _start_logging(verbose: int) -> None:
    level = {0: logging.WARNING, 1: logging.INFO}.get(verbose, logging.DEBUG)
    logging.basicConfig(level=logging.WARNING, format="%(message)s", stream=sys.stderr)
    logging.getLogger("femupdate").setLevel(level)


def _os_failure(error: OSError) -> str:
    import errno

    where = error.filename or "a file"
    if error.errno == errno.ENOSPC:
        return f"cannot write {where}: the disk is full; free some space and run the command again"
    return f"{where}: {error.strerror or error}; check the path and its permissions"
