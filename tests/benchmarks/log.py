"""Finished parts of a long benchmark on disk, so that a run that was cut off goes on from them."""

import json
import threading
from collections.abc import Callable
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from femupdate.errors import StudyError
from femupdate.storage import write_bytes, write_failure

from .result import json_content

T = TypeVar("T")


class ResumableLog:
    """A file whose first line says what the parts depend on; every further line is one part.

    Several threads may add parts.

    Parts are dataclasses. Their fields are numbers, texts, float arrays, other dataclasses, tuples
    of one of these, or None.

    Args:
        path: of the file; made when the first part is added.
        header: what all parts depend on; a file with another one is begun anew.
    """

    def __init__(self, path: Path, header: Any) -> None:
        self._path, self._header = path, json.dumps(json_content(header))
        self._lines: dict[str, str] = {}
        self._open = False
        self._writing = threading.Lock()
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
        if lines and lines[0] == self._header:
            for line in lines[1:]:
                try:
                    self._lines[json.loads(line)["key"]] = line
                except (json.JSONDecodeError, KeyError):
                    continue  # half a line, or one of an earlier version

    def get(self, key: str, kind: type[T]) -> T | None:
        """Return a part, of a dataclass; None where it is not there."""
        line = self._lines.get(key)
        return None if line is None else restored(kind, json.loads(line)["content"])

    def add(self, key: str, part: Any) -> None:
        """Write one part at once; it takes the place of one with the same key."""
        # Python's JSON keeps NaN and infinities, which parts may hold.
        content = {"key": key, "content": asdict(part)}
        line = json.dumps(content, default=lambda array: array.tolist())
        with self._writing:
            self._lines[key] = line
            if self._open:
                self._append(line)
            else:  # all of them, as the last line may have been cut off
                lines = (self._header, *self._lines.values())
                write_bytes(self._path, "".join(f"{line}\n" for line in lines).encode())
            self._open = True

    def _append(self, line: str) -> None:
        try:
            with open(self._path, "a", encoding="utf-8") as file:
                file.write(f"{line}\n")
        except OSError as error:
            raise StudyError(write_failure(self._path, error)) from error

    def get_or_make(self, key: str, kind: type[T], make: Callable[[], T]) -> T:
        """Return a part, which is made and added where it is not there."""
        part = self.get(key, kind)
        if part is None:
            part = make()
            self.add(key, part)
        return part


def restored(kind: Any, content: Any) -> Any:
    """Return a value of the annotated kind from what JSON holds of `asdict`."""
    if isinstance(kind, type) and is_dataclass(kind):
        kinds = get_type_hints(kind)
        names = [field.name for field in fields(kind)]
        return kind(**{name: restored(kinds[name], content[name]) for name in names})
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is UnionType and content is not None:
        (some,) = (one for one in arguments if one is not NoneType)
        return restored(some, content)
    if origin is tuple:
        return tuple(restored(arguments[0], item) for item in content)
    # From numpy 2.5 on, NDArray is an alias.
    if np.ndarray in (origin, get_origin(getattr(origin, "__value__", None))):
        return np.array(content, dtype=float)
    return content
