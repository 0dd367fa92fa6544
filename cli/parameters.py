"""Types of options and arguments: each reads one kind of text and says how to write it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from femupdate.study import Study

Place = tuple[float, float, float]


class Kind(click.types.FuncParamType):
    """A type by its name in the help, and what reads a text.

    Args:
        require: raises the library's error, without heavy imports, where what a value names must
            exist before a command starts and does not.
    """

    def __init__(
        self, name: str, read: Callable[[Any], Any], require: Callable[[Any], object] | None = None
    ) -> None:
        super().__init__(read)
        self.name, self.require = name, require


def _there(file: Path) -> None:
    """Refuse a file that is missing or empty."""
    from femupdate.measurement.text import read_head

    read_head(file)


def _known(building: str) -> None:
    """Refuse a name that is neither a file nor a shipped building."""
    from femupdate.building.shipped import building_text

    building_text(building)


def names(value: str | tuple[str, ...]) -> tuple[str, ...]:
    """Names with commas between them, without empty ones."""
    if isinstance(value, tuple):
        return value
    return tuple(part.strip() for part in value.split(",") if part.strip())


def numbers(value: str) -> tuple[float, ...]:
    """Numbers with commas between them."""
    try:
        return tuple(float(part) for part in value.split(","))
    except ValueError:
        raise click.BadParameter("write numbers with commas, such as 0.8,1.1,1.0") from None


def band(value: str | tuple[float, float]) -> tuple[float, ...]:
    """Two frequencies, Hz, the lower first."""
    ends = numbers(value) if isinstance(value, str) else value
    if len(ends) != 2 or not 0.0 <= ends[0] < ends[1]:
        raise click.BadParameter("write the lowest and the highest frequency, such as 0.5,18")
    return ends


def columns(value: str) -> dict[str, str]:
    """Our column names, each with the name in the file."""
    pairs = [part.split("=", 1) for part in value.split(",") if part.strip()]
    if not pairs or any(len(pair) != 2 or not all(p.strip() for p in pair) for pair in pairs):
        raise click.BadParameter("write ours=theirs pairs with commas, such as base=a0,2F=a1,RF=a2")
    from femupdate.measurement.names import is_ours

    stripped = [(ours.strip(), theirs.strip()) for ours, theirs in pairs]
    named = dict(  # written the other way round, they say the same
        pair[::-1] if is_ours(pair[1]) and not is_ours(pair[0]) else pair for pair in stripped
    )
    if len(named) < len(pairs):
        raise click.BadParameter("one of our names is given twice; give each once")
    return named


def channel(value: str) -> int | str:
    """A channel of a record: a number where digits are written, else a name."""
    return int(value) if value.isdigit() else value


def member(value: str) -> Place | str:
    """A point x, y, z in the building, m, or the name of a wall."""
    if value.count(":") in (1, 2):
        return value
    try:
        x, y, z = (float(part) for part in value.split(","))
    except ValueError:
        raise click.BadParameter(
            f"{value!r} is neither a place nor a wall; write x,y,z in m, such as 3.6,0,1.5, or "
            "the wall's line and story, such as X2:S1"
        ) from None
    return x, y, z


def sized_effect(value: str) -> tuple[str, tuple[float, ...]]:
    """An effect at its place, such as added_mass@3F, and its first parameters."""
    label, _, sizes = value.partition("=")
    try:
        values = tuple(float(part) for part in sizes.split(",")) if sizes else ()
    except ValueError:
        values, label = (), ""
    if "@" not in label:
        raise click.BadParameter("write name@place=size, such as added_mass@3F=0.1")
    return label.strip(), values


INPUT_FILE = Kind("file", Path, _there)
BUILDING_NAME = Kind("building", str, _known)
STUDY_FOLDER = Kind("directory", lambda folder: Study(Path(folder)), Study.check_folder)
NAMES, NUMBERS, BAND = Kind("names", names), Kind("numbers", numbers), Kind("low,high", band)
COLUMNS, CHANNEL = Kind("ours=theirs,...", columns), Kind("channel", channel)
MEMBER, SIZED_EFFECT = Kind("place|wall", member), Kind("name@place=size", sized_effect)
