"""What a reader of a file format is, and the one that a file needs."""

import importlib
import pkgutil
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType

from femupdate.errors import MeasurementError
from femupdate.measurement import readers as folder
from femupdate.measurement.recording import Recording, in_step
from femupdate.measurement.text import read_head, read_text


@dataclass(frozen=True)
class Reader:
    """One file format; a reader's module holds it under the name `READER`.

    Attributes:
        name: by which a user asks for the format, such as `knet`.
        reads: what it reads, for lists and messages.
        recognises: whether a file is in the format, told from its beginning as text (bytes that
            are not text stand as latin-1) and its suffix, such as `.v2`.
        read: path to what the file holds. It raises `MeasurementError` where the file cannot be
            used; `TextFile.error` puts file, line and column in front of the message.
        fallback: tried after all others, for a layout that nearly every file fits.
    """

    name: str
    reads: str
    recognises: Callable[[str, str], bool]
    read: Callable[[Path], Recording]
    fallback: bool = False


# Comments, and the name of the first column as femupdate writes it: no other format begins so.
_OWN_TABLE = re.compile(r"(?:#[^\n]*\n)*time_s,")


@cache
def readers() -> Mapping[str, Reader]:
    """Readers by their names, in the order in which they are tried."""
    names = [info.name for info in pkgutil.iter_modules(folder.__path__)]
    found = [_reader(name) for name in names]
    found.sort(key=lambda reader: (reader.fallback, reader.name))
    return MappingProxyType({reader.name: reader for reader in found})


def _reader(name: str) -> Reader:
    reader: Reader = importlib.import_module(f"{folder.__name__}.{name}").READER
    return reader


def read_measured(path: str | Path) -> Recording:
    """Read any measured file.

    Raises:
        MeasurementError: the file is in no known format, or cannot be read as what it is.
    """
    path = Path(path)
    reader = _recognised(path)
    try:
        recording = reader.read(path)
        channels = in_step(recording.file, dict(enumerate(recording.channels)))
        return replace(recording, channels=tuple(channels.values()), format=reader.name)
    except MeasurementError:
        raise
    except Exception as error:  # damage of a kind that the reader does not expect
        raise MeasurementError(
            f"{path}: it is read as one of {reader.reads}, but is damaged ({error}); write it"
            " again from its source"
        ) from error


def _recognised(path: Path) -> Reader:
    head = read_head(path)
    if path.suffix.lower() == ".csv" and _OWN_TABLE.match(head):
        return _reader("plain")
    for reader in readers().values():
        if reader.recognises(head, path.suffix.lower()):
            return reader
    file = read_text(path)  # says what it is where it is no text
    raise file.error(
        f"the file is in none of the known formats ({', '.join(readers())}); convert it to CSV"
    )
