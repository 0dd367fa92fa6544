"""What all commands share: options, progress, errors and JSON output."""

import functools
import json
import logging
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click

from femupdate.errors import FemupdateError
from femupdate.study import Study

from .parameters import Band, Columns, Input, Names, StudyFolder

F = TypeVar("F", bound=Callable[..., Any])


class Failure(click.ClickException):
    """A command that failed: one plain sentence, exit code 1."""

    exit_code = 1

    def show(self, file: Any = None) -> None:
        """Print the sentence on stderr."""
        click.echo(f"Error: {self.format_message()}", err=True)


def study_options(needs: str | None = None, writes: bool = True) -> Callable[[F], F]:
    """Add --study, --seed, --json and -v, and turn the library's errors into exit code 1.

    Args:
        needs: artefact that the study must hold, made by `femupdate calibrate`.
        writes: the command writes into the study.
    """

    def decorate(function: F) -> F:
        @click.option(
            "--study",
            type=StudyFolder(),
            default="study",
            show_default=True,
            help="Folder that holds everything for one building.",
        )
        @_running
        @functools.wraps(function)
        def wrapper(*args: Any, study: Study, **kwargs: Any) -> Any:
            if needs is not None:
                study.require(needs, "calibrate")
            if writes:
                study.check_writable()
            return function(*args, study=study, **kwargs)

        return wrapper  # type: ignore[return-value]

    return decorate


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
    @click.option("--columns", type=Columns(), help="Column names: ours=theirs,...")
    @functools.wraps(function)
    def wrapper(*args: Any, sensors: Any, band: Any, unit: Any, columns: Any, **kwargs: Any) -> Any:
        reading = {"sensors": sensors, "band_hz": band, "unit": unit, "columns": columns}
        return function(*args, reading=reading, **kwargs)

    return wrapper  # type: ignore[return-value]


def benchmark_options(function: F) -> F:
    """Add --output, --seed, --json and -v, and turn the library's errors into exit code 1."""

    @click.option(
        "--output",
        "output_folder",
        type=click.Path(file_okay=False, path_type=Path),
        default=Path("benchmarks"),
        show_default=True,
        help="Folder for the results.",
    )
    @_running
    @functools.wraps(function)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        return function(*args, **kwargs)

    return wrapper  # type: ignore[return-value]


def _running(function: F) -> F:
    """Add --seed, --json and -v, and turn the library's errors into exit code 1."""

    @click.option(
        "--seed",
        type=click.IntRange(0, 2**32 - 1),
        default=0,
        show_default=True,
        help="Random seed.",
    )
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


def print_json(content: dict[str, Any]) -> None:
    """Print one JSON object; numbers that are not finite become null."""
    click.echo(json.dumps(_plain(content), indent=2))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


class Bars:
    """Progress on stderr: bars on a terminal, one line for each step in a log."""

    def __init__(self) -> None:
        self._bar: Any = None
        self._on_terminal = sys.stderr.isatty()

    def __enter__(self) -> "Bars":
        return self

    def __exit__(self, *_: object) -> None:
        self._finish()

    def start(self, label: str, total: int) -> None:
        """Begin a bar."""
        self._finish()
        if not self._on_terminal:
            click.echo(f"{label} ...", err=True)
            return
        from tqdm import tqdm

        self._bar = tqdm(
            total=total,
            desc=label,
            leave=False,
            delay=0.5,
            bar_format="{desc}: {percentage:3.0f}%|{bar:30}| {elapsed}<{remaining} {postfix}",
        )

    def advance(self, count: int = 1, note: str = "") -> None:
        """Move the bar."""
        if self._bar is not None:
            if note:
                self._bar.set_postfix_str(note, refresh=False)
            self._bar.update(count)

    def say(self, text: str) -> None:
        """Print a line between the bars."""
        if self._bar is not None:
            self._bar.clear()
        click.echo(text, err=True)

    def _finish(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    """Return a table with the first column aligned left, the others right."""
    widths = [max(len(row[k]) for row in [head, *rows]) for k in range(len(head))]
    lines = []
    for row in [head, *rows]:
        cells = [
            cell.ljust(width) if k == 0 else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  " + "  ".join(cells).rstrip())
    return "\n".join(lines)


def print_notes(notes: tuple[str, ...]) -> None:
    """Print each note on its own line."""
    for note in notes:
        click.echo(f"  - {note}")


def print_pictures(pictures: tuple[Path, ...]) -> None:
    """Print the path of each picture once."""
    for picture in dict.fromkeys(pictures):
        click.echo(f"  {picture}")


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
