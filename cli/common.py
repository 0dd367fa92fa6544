"""What all commands share: options, progress, errors and JSON output."""

import functools
import logging
import sys
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any, TypeVar

import click

from femupdate.errors import FemupdateError
from femupdate.study import Study
from femupdate.study_lock import locked

from .answer import Answer
from .bars import Bars
from .parameters import Band, Columns, Input, InputFile, Names, StudyFolder

F = TypeVar("F", bound=Callable[..., Any])


class Failure(click.ClickException):
    """A command that failed: one plain sentence, exit code 1."""

    exit_code = 1

    def show(self, file: Any = None) -> None:
        """Print the sentence on stderr."""
        click.echo(f"Error: {self.format_message()}", err=True)


def study_options(
    needs: str | None = None, writes: bool = True, draws: bool = True
) -> Callable[[Callable[..., Answer]], Callable[..., None]]:
    """Add --study, --seed, --json and -v, print the answer, turn errors into exit code 1.

    The function gets `study`, `seed` and `bars`, the progress; and, where it draws pictures that
    can be left out, `pictures`.

    Args:
        needs: artefact that the study must hold, made by `femupdate calibrate`.
        writes: the command writes into the study.
        draws: add --no-pictures.
    """

    def decorate(function: Callable[..., Answer]) -> Callable[..., None]:
        @click.option(
            "--study",
            type=StudyFolder(),
            default="study",
            show_default=True,
            help="Folder that holds everything for one building.",
        )
        @running
        @functools.wraps(function)
        def wrapper(*args: Any, study: Study, as_json: bool, **kwargs: Any) -> None:
            if needs is not None:
                study.require(needs, "calibrate")
            if draws:
                kwargs["pictures"] = not kwargs.pop("no_pictures")
            with ExitStack() as stack:
                if writes:
                    study.check_writable()
                    stack.enter_context(locked(study.folder, _command_name()))
                bars = stack.enter_context(Bars())
                answer = function(*args, study=study, bars=bars, **kwargs)
            answer.show(as_json)

        if not draws:
            return wrapper
        return click.option("--no-pictures", is_flag=True, help="Draw no pictures.")(wrapper)

    return decorate


def _command_name() -> str:
    return click.get_current_context().info_name or "command"


def plain_options(function: Callable[..., Answer]) -> Callable[..., None]:
    """Add --json and -v to a command that needs no study, and print its answer."""

    @_reporting
    @functools.wraps(function)
    def wrapper(*args: Any, as_json: bool, **kwargs: Any) -> None:
        function(*args, **kwargs).show(as_json)

    return wrapper


def reading_options(function: F) -> F:
    """Add the options for reading observation files, passed on as `reading`."""

    @click.option(
        "--sensors",
        type=Names(),
        default=(),
        help="Floors to use, such as RF or 2F,RF; default all.",
    )
    @click.option("--band", type=Band(), help="Frequency range, such as 0.5,18 (Hz).")
    @click.option("--unit", help="Unit of the accelerations, where the file gives none.")
    @columns_options
    @functools.wraps(function)
    def wrapper(*args: Any, sensors: Any, band: Any, unit: Any, columns: Any, **kwargs: Any) -> Any:
        reading = {"sensors": sensors, "band_hz": band, "unit": unit, "columns": columns}
        return function(*args, reading=reading, **kwargs)

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
        from femupdate.measurement.mapping_file import read_mapping

        try:
            read = read_mapping(mapping)
        except FemupdateError as error:
            raise Failure(str(error)) from error
        if "unit" in kwargs:
            kwargs["unit"] = kwargs["unit"] or read.unit
        return function(*args, columns=dict(read.columns), **kwargs)

    return wrapper  # type: ignore[return-value]


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
    @functools.wraps(function)
    def wrapper(*args: Any, verbose: int, **kwargs: Any) -> Any:
        _start_logging(verbose)
        try:
            _require_inputs()
            return function(*args, **kwargs)
        except FemupdateError as error:
            if verbose >= 2:
                logging.getLogger(__name__).exception("traceback")
            raise Failure(str(error)) from error
        except OSError as error:
            raise Failure(_os_failure(error)) from error

    return wrapper  # type: ignore[return-value]


def _require_inputs() -> None:
    """Refuse a misspelt name before anything heavy is imported."""
    context = click.get_current_context()
    for parameter in context.command.params:
        value = context.params.get(parameter.name or "")
        if isinstance(parameter.type, Input) and value is not None:
            for one in value if isinstance(value, tuple) else (value,):
                parameter.type.require(one)


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
