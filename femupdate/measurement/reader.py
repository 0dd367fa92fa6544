"""What a reader of a file format is, and the one that a file needs."""

import importlib
import pkgutil
import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

from femupdate.errors import MeasurementError
from femupdate.measurement import readers as folder
from femupdate.measurement.recording import Recording, in_step
from femupdate.measurement.text import read_head, read_text


class Reader(Protocol):
    """One file format: a module of the folder `readers`, whose name is that of the format.

    With `FALLBACK = True` it is tried after all others, for a layout that nearly every file fits.
    """

    READS: str  # what it reads, for lists and messages

    def recognises(self, head: str, suffix: str) -> bool:
        """Whether a file is in the format.

        Args:
            head: its beginning as text; bytes that are not text stand as latin-1.
            suffix: such as `.v2`.
        """

    def read(self, path: Path) -> Recording:
        """What the file holds.

        Raises:
            MeasurementError: it cannot be used; `TextFile.error` puts file, line and column in
                front of the message.
        """


# Comments, and the name of the first column as femupdate writes it: no other format begins so.
_OWN_TABLE = re.compile(r"(?:#[^\n]*\n)*time_s,")


@cache
def readers() -> Mapping[str, Reader]:
    """Readers by their names, in the order in which they are tried."""
    names = sorted(info.name for info in pkgutil.iter_modules(folder.__path__))
    known: dict[str, Any] = {
        name: importlib.import_module(f"{folder.__name__}.{name}") for name in names
    }
    return MappingProxyType(dict(sorted(known.items(), key=lambda item: is_fallback(item[1]))))


def is_fallback(reader: Reader) -> bool:
    """Whether nearly every file is in this format."""
    return getattr(reader, "FALLBACK", False)


def read_measured(path: str | Path) -> Recording:
    """Read any measured file.

    Raises:
        MeasurementError: the file is in no known format, or cannot be read as what it is.
    """
    path = Path(path)
    name = _recognised(path)
    reader = readers()[name]
    try:
        recording = reader.read(path)
        channels = in_step(recording.file, dict(enumerate(recording.channels)))
        return replace(recording, channels=tuple(channels.values()), format=name)
    except MeasurementError:
        raise
    except Exception as error:  # damage of a kind that the reader does not expect
        raise MeasurementError(
            f"{path}: it is read as one of {reader.READS}, but is damaged ({error}); write it"
            " again from its source"
        ) from error


def _recognised(path: Path) -> str:
    """Name of the format of a file."""
    head = read_head(path)
    if path.suffix.lower() == ".csv" and _OWN_TABLE.match(head):
        return "plain"
    for name, reader in readers().items():
        if reader.recognises(head, path.suffix.lower()):
            return name
    file = read_text(path)  # says what it is where it is no text
    raise file.error(
        f"the file is in none of the known formats ({', '.join(readers())}); convert it to CSV"
    )
