"""The study folder: what is where and what it was made from."""

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from femupdate import __version__
from femupdate.atomic import atomic_path
from femupdate.errors import StudyError

MANIFEST = "study.json"
BUILDING_FILE = "building.toml"


def write_text(path: Path | str, text: str) -> None:
    """Write a UTF-8 text file atomically."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def file_hash(path: Path | str) -> str:
    """SHA-256 of a file's content."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@dataclass(frozen=True)
class Artefact:
    """What is known of one file of a study.

    Attributes:
        file: path inside the study folder.
        command: what made it.
        version: of femupdate.
        created: UTC time, ISO 8601.
        settings: what it was made with.
        made_from: hash of each thing it was made from.
        sha256: of the file itself.
    """

    file: str
    command: str
    version: str
    created: str
    settings: Mapping[str, Any]
    made_from: Mapping[str, str]
    sha256: str


class Study:
    """A folder that holds everything made for one building and its observation.

    Args:
        folder: made when the first artefact is written.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)

    def path(self, *parts: str) -> Path:
        """Path of a file inside the study."""
        return self.folder.joinpath(*parts)

    def check_folder(self) -> Path:
        """The folder itself where it is there, else the lowest folder above it that is.

        Raises:
            StudyError: a file stands in its place.
        """
        above = (self.folder, *self.folder.absolute().parents)
        lowest = next(path for path in above if path.exists())
        if not lowest.is_dir():
            raise StudyError(f"{lowest} is a file, not a folder; choose another with --study")
        return lowest

    def check_writable(self) -> None:
        """Make sure that files can be written into the folder, which need not be there yet.

        Raises:
            StudyError: they cannot.
        """
        folder = self.check_folder()
        if not os.access(folder, os.W_OK | os.X_OK):
            raise StudyError(f"cannot write into {folder}; check its permissions or choose another")

    def artefacts(self) -> dict[str, Artefact]:
        """All recorded artefacts by name.

        Raises:
            StudyError: the record cannot be read.
        """
        manifest = self.path(MANIFEST)
        if not manifest.exists():
            return {}
        try:
            entries = json.loads(manifest.read_text(encoding="utf-8"))["artefacts"]
            return {name: Artefact(**entry) for name, entry in entries.items()}
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise StudyError(
                f"{manifest} cannot be read ({error}); move it away and run the commands again"
            ) from error

    def record(
        self,
        name: str,
        file: str,
        command: str,
        made_from: Mapping[str, str],
        settings: Mapping[str, Any] | None = None,
    ) -> Artefact:
        """Note that `file` has been written, by what and from what."""
        artefact = Artefact(
            file,
            command,
            __version__,
            datetime.now(UTC).isoformat(timespec="seconds"),
            dict(settings or {}),
            dict(made_from),
            file_hash(self.path(file)),
        )
        entries = {**self.artefacts(), name: artefact}
        content = {
            "femupdate": __version__,
            "artefacts": {key: asdict(value) for key, value in sorted(entries.items())},
        }
        write_text(self.path(MANIFEST), json.dumps(content, indent=2, sort_keys=True) + "\n")
        return artefact

    def find(self, name: str, made_from: Mapping[str, str]) -> Path | None:
        """Path of an artefact if it is there, whole, and made from just these things."""
        artefact = self.artefacts().get(name)
        if artefact is None or dict(artefact.made_from) != dict(made_from):
            return None
        path = self.path(artefact.file)
        if not path.exists() or file_hash(path) != artefact.sha256:
            return None
        return path

    def require(self, name: str, command: str) -> Path:
        """Path of an artefact that must be there and whole.

        Args:
            name: of the artefact.
            command: what the user should run when it is not.

        Raises:
            StudyError: it is missing, or is not the file that was recorded.
        """
        artefact = self.artefacts().get(name)
        if artefact is None or not self.path(artefact.file).exists():
            raise StudyError(
                f"the study {self.folder} holds no {name}; run `femupdate {command}` first"
            )
        path = self.path(artefact.file)
        if file_hash(path) != artefact.sha256:
            raise StudyError(
                f"{path} is not the file that femupdate wrote (it was changed or cut short); run "
                f"`femupdate {command}` again"
            )
        return path

    def check_fresh(self, name: str, made_from: Mapping[str, str], command: str) -> None:
        """Make sure that an artefact was made from these things.

        Raises:
            StudyError: it is stale; the message names what has changed.
        """
        artefact = self.artefacts().get(name)
        if artefact is None:
            return
        changed = [key for key, value in made_from.items() if artefact.made_from.get(key) != value]
        if changed:
            raise StudyError(
                f"the {name} in {self.folder} was made from another {' and '.join(changed)}; run "
                f"`femupdate {command}` again"
            )
