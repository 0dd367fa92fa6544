"""What a module of the folder `readers` brings to have its file format read."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from femupdate.measurement.recording import Recording


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
