"""What all commands share: options, progress, errors and the JSON object."""

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

F = TypeVar("F", bound=Callable[..., Any])


class Failure(click.ClickException):
    """The work could not be done: one plain sentence, exit code 1."""

    exit_code = 1

    def show(self, file: Any = None) -> None:
        """Print the sentence on stderr."""
        click.echo(f"Error: {self.format_message()}", err=True)


def shared_options(function: F) -> F:
    """Add --study, --seed, --json and -v, and turn the library's errors into exit code 1."""

    @click.option(
        "--study",
        "study_folder",
        type=click.Path(path_type=Path),
        callback=_require_folder,
        default=Path("study"),
        show_default=True,
        help="Folder that holds everything made for one building.",
    )
    @_running
    @functools.wraps(function)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        return function(*args, **kwargs)

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
        help="Of everything random.",
    )
    @click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
    @click.option("-v", "--verbose", count=True, help="Say more; -vv for debugging.")
    @functools.wraps(function)
    def wrapper(*args: Any, verbose: int, **kwargs: Any) -> Any:
        _start_logging(verbose)
        try:
            return function(*args, **kwargs)
        except FemupdateError as error:
            if verbose >= 2:
                logging.getLogger(__name__).exception("traceback")
            raise Failure(str(error)) from error
        except OSError as error:
            raise Failure(_os_failure(error)) from error

    return wrapper  # type: ignore[return-value]


def _require_folder(context: click.Context, parameter: click.Parameter, path: Path) -> Path:
    """A study need not be there yet, but nothing else may stand in its place."""
    if path.exists() and not path.is_dir():
        raise Failure(f"{path} is a file, not a folder; choose another folder with --study")
    return path


def parse_columns(
    context: click.Context, parameter: click.Parameter, text: str | None
) -> dict[str, str] | None:
    """Read `ours=theirs,ours=theirs`."""
    if text is None:
        return None
    pairs = [part.split("=", 1) for part in text.split(",") if part.strip()]
    if not pairs or any(len(pair) != 2 or not all(p.strip() for p in pair) for pair in pairs):
        raise click.BadParameter("write ours=theirs pairs with commas, such as base=a0,2F=a1,RF=a2")
    return {ours.strip(): theirs.strip() for ours, theirs in pairs}


def parse_members(
    context: click.Context, parameter: click.Parameter, texts: tuple[str, ...]
) -> tuple[tuple[float, float, float] | str, ...]:
    """Read places `x,y,z` in m and names of walls, such as `X2:S1`."""
    members: list[tuple[float, float, float] | str] = []
    for text in texts:
        if text.count(":") in (1, 2):
            members.append(text)
            continue
        try:
            x, y, z = (float(part) for part in text.split(","))
        except ValueError:
            raise click.BadParameter(
                f"{text!r} is neither a place nor a wall; write x,y,z in m, such as 3.6,0,1.5, or "
                "the wall's line and story, such as X2:S1"
            ) from None
        members.append((x, y, z))
    return tuple(members)


def parse_names(
    context: click.Context, parameter: click.Parameter, text: str | None
) -> tuple[str, ...]:
    """Read names with commas between them."""
    return () if text is None else tuple(part.strip() for part in text.split(",") if part.strip())


def parse_numbers(
    context: click.Context, parameter: click.Parameter, text: str | None
) -> tuple[float, ...] | None:
    """Read numbers with commas between them."""
    if text is None:
        return None
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise click.BadParameter("write numbers with commas, such as 0.8,1.1,1.0") from None


def parse_band(
    context: click.Context, parameter: click.Parameter, text: str | None
) -> tuple[float, float] | None:
    """Read two frequencies, the lower first."""
    numbers = parse_numbers(context, parameter, text)
    if numbers is None:
        return None
    if len(numbers) != 2 or not 0.0 <= numbers[0] < numbers[1]:
        raise click.BadParameter("write the lowest and the highest frequency, such as 0.5,18")
    return numbers[0], numbers[1]


def print_json(content: dict[str, Any]) -> None:
    """Print one JSON object; what is not a number becomes null."""
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
    """Progress on stderr: bars on a terminal, one line a piece of work in a log."""

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
        """A line between the bars."""
        if self._bar is not None:
            self._bar.clear()
        click.echo(text, err=True)

    def _finish(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    """Columns aligned to the right, the first to the left."""
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
    """Sentences, each on a line of its own."""
    for note in notes:
        click.echo(f"  - {note}")


def print_pictures(pictures: tuple[Path, ...]) -> None:
    """Where the pictures are."""
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
