"""Parts of a long benchmark on disk as they are done, so that a run that was cut off goes on."""

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

T = TypeVar("T")


class KeptParts:
    """A file of finished parts, one line each.

    Args:
        path: of the file; made when the first part is done.
        header: what all parts depend on; a file with another one is begun anew.
    """

    def __init__(self, path: Path, header: str) -> None:
        self._path, self._header = path, header
        self._known: dict[str, dict[str, Any]] = {}
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
        if lines and lines[0] == header:
            for line in lines[1:]:
                try:
                    part = json.loads(line)
                except json.JSONDecodeError:
                    continue  # half a line
                self._known[part["key"]] = part["content"]

    def __call__(self, key: str, make: Callable[[], T], back: Callable[[dict[str, Any]], T]) -> T:
        """Return a part: read back where it is known, else made and written.

        Args:
            key: of the part.
            make: makes it, a dataclass.
            back: makes it from what `asdict` gave, arrays as lists.
        """
        if key in self._known:
            return back(self._known[key])
        made = make()
        content = asdict(made)  # type: ignore[call-overload] # T is a dataclass
        self._known[key] = json.loads(json.dumps(content, default=lambda array: array.tolist()))
        self._write()
        return made

    def _write(self) -> None:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        lines = [json.dumps({"key": k, "content": v}) for k, v in self._known.items()]
        self._path.write_text("\n".join([self._header, *lines]) + "\n", encoding="utf-8")
