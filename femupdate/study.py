"""The study folder: what is where, what it was made from, and one writer at a time."""

import contextlib
import hashlib
import json
import os
import re
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path, PurePath
from typing import Any, Generic, TypeVar

from femupdate import __version__
from femupdate.errors import InferenceError, MeasurementError, StudyError, brief
from femupdate.storage import read_file, remove_parts, write_failure, write_text

MANIFEST = "study.json"
BUILDING_FILE = "building.toml"
SUMMARY = "posterior_summary.json"
LAYOUT = 1
"""Of a study's files; it grows by one when an older femupdate could not read what a newer wrote."""

MAIN_POSTERIOR = "posterior"
"""Name of the posterior that has none of its own; its files lie in the study's own folder."""
NAMED = "posteriors"
"""Folder of a study in which every other posterior has a folder of its own."""
_OF_A_POSTERIOR = ("posterior", "prediction")  # artefacts that every posterior has for itself
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,40}")

_RUNNING: ContextVar[tuple[str, ...]] = ContextVar("words of the running command", default=())
_READING = ("--unit", "--columns", "--sensors", "--band", "--force", "--mode-error")


def file_hash(path: Path | str) -> str:
    """SHA-256 of a file's content."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextmanager
def made_by(words: Sequence[str]) -> Iterator[None]:
    """Note with all that is recorded inside which command makes it.

    Args:
        words: of the command, without `femupdate`; those that no terminal shows are not noted.
    """
    token = _RUNNING.set(tuple(words) if _are_words(list(words)) else ())
    try:
        yield
    finally:
        _RUNNING.reset(token)


def typed(words: str, file: Path) -> str:
    """A command as it is typed, for the study and the posterior that hold a file."""
    named = file.parent.parent.name == NAMED
    folder = shlex.quote(str(file.parents[2] if named else file.parent))
    if named and words.split()[0] in ("predict", "report"):
        words += f" --posterior {shlex.quote(file.parent.name)}"
    return f"femupdate {words}" + ("" if folder == "study" else f" --study {folder}")


def on_files(command: str, files: Sequence[Path]) -> str:
    """Words of a command on files, read as the running command was told to."""
    told = [pair for pair in pairwise(_RUNNING.get()) if pair[0] in _READING]
    return shlex.join([command, *map(str, files), *(word for pair in told for word in pair)])


def _are_texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(text, str) for text in value)


def _are_words(value: Any) -> bool:
    """Whether this is a command that can be shown and typed, whoever wrote it."""
    whole = _are_texts(value) and bool(value) and sum(map(len, value)) <= 100_000
    return whole and all(word.isprintable() for word in value)


# Settings that other commands read, each with whether a value can be one.
_SETTINGS: dict[str, Callable[[Any], bool]] = {
    "words": _are_words,
    "further": _are_texts,
    "scale": lambda value: isinstance(value, int | float),
}


@dataclass(frozen=True)
class Artefact:
    """What is known of one file of a study.

    Attributes:
        file: path inside the study folder.
        command: what made it.
        version: of femupdate.
        created: UTC time, ISO 8601.
        settings: what it was made with; under `words`, the command that made it.
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


REPAIRED = "repaired"
"""Folder of the study of a repaired building, inside that of the building as it was."""

BESIDE = ("holdout", "measured")
"""Options of commands that take files beside those which they are called with."""


def owner_of(key: str) -> str:
    """Name of the posterior that a recorded artefact belongs to."""
    owner, _, name = key.rpartition(" ")
    # Names of other artefacts have several words as well.
    return owner if owner and name in _OF_A_POSTERIOR else MAIN_POSTERIOR


@contextmanager
def as_written(path: Path) -> Iterator[None]:
    """Use of what an artefact holds.

    Raises:
        StudyError: it holds something else, such as what an older version wrote.
    """
    try:
        yield
    except (LookupError, TypeError, ValueError, AttributeError, RecursionError) as error:
        text = (str(error).splitlines() or [type(error).__name__])[0]
        raise StudyError(
            f"{path} is not what femupdate writes there ({text}); remove it and run the command "
            "again"
        ) from error


T = TypeVar("T")


@dataclass(frozen=True)
class StudyPart(Generic[T]):
    """What a study keeps in a file, so that it is made once.

    Attributes:
        name: under which it is recorded.
        file: inside the study.
        command: that makes it.
        write: writes it to a path, whole or not at all.
        read: reads it back; None where an older version wrote less than is needed now.
        settings: what the record says of it.
    """

    name: str
    file: str
    command: str
    write: Callable[[T, Path], object]
    read: Callable[[Path], T | None]
    settings: Callable[[T], Mapping[str, Any]] = lambda _: {}


class Study:
    """A folder that holds everything made for one building, seen with one of its posteriors.

        >>> import femupdate
        >>> study = femupdate.Study("house")
        >>> model = femupdate.reduce(study, "shear_3dof")
        >>> study.path("reduced_model.npz").exists(), study.artefact("reduced model").command
        (True, 'build-model')

    Args:
        folder: made when the first artefact is written.
        posterior: name of the posterior that artefacts and results are of.

    Raises:
        StudyError: a posterior cannot have this name.
    """

    __repr__ = brief

    def __init__(self, folder: Path | str, posterior: str = MAIN_POSTERIOR) -> None:
        if _NAME.fullmatch(posterior) is None:
            raise StudyError(
                f"{posterior!r} cannot be the name of a posterior; use at most 41 letters, "
                "digits, - and _"
            )
        self.folder, self.posterior = Path(folder), posterior

    def path(self, *parts: str) -> Path:
        """Path of a file inside the study."""
        return self.folder.joinpath(*parts)

    def result(self, *parts: str) -> Path:
        """Path of a file that comes of the chosen posterior."""
        if self.posterior == MAIN_POSTERIOR:
            return self.path(*parts)
        return self.path(NAMED, self.posterior, *parts)

    def key(self, name: str) -> str:
        """Under which an artefact is recorded, such as "posterior" or "roof posterior"."""
        if self.posterior == MAIN_POSTERIOR or name not in _OF_A_POSTERIOR:
            return name
        return f"{self.posterior} {name}"

    def artefact(self, name: str) -> Artefact | None:
        """What is recorded of an artefact, that of the chosen posterior.

        Raises:
            StudyError: the record cannot be read.
        """
        return self.artefacts().get(self.key(name))

    def reading_of(self, path: Path) -> dict[str, Any]:
        """Unit and columns by which the study has read a file before."""
        content = file_hash(path) if path.is_file() else ""
        read: dict[str, Any] = {}
        for artefact in self.artefacts().values():
            if content in artefact.made_from.values():
                known = artefact.settings
                read |= {name: known[name] for name in ("unit", "columns") if name in known}
        return read

    def summary(self) -> dict[str, Any]:
        """What the report of a calibration wrote; empty where there is none, as after a repair.

        Raises:
            StudyError: the file cannot be read.
        """
        path = self.result(SUMMARY)
        if not path.exists():
            return {}
        try:
            return dict(json.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError) as error:
            raise StudyError(
                f"{path} cannot be read ({error}); run `femupdate calibrate` again"
            ) from error

    def posteriors(self) -> tuple[str, ...]:
        """Names of all posteriors, in the order of their names but the one without first.

        Raises:
            StudyError: the record cannot be read.
        """
        keys = [key for key in self.artefacts() if key.split(" ")[-1] == MAIN_POSTERIOR]
        return tuple(owner_of(key) for key in sorted(keys, key=lambda key: (" " in key, key)))

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
            raise StudyError(
                f"cannot write into {folder}; check its permissions, or copy it to another folder "
                "and name that"
            )

    def artefacts(self) -> dict[str, Artefact]:
        """All recorded artefacts by name.

        Raises:
            StudyError: the record cannot be read.
        """
        manifest = self.path(MANIFEST)
        if not os.path.lexists(manifest):
            return {}
        try:
            content = json.loads(read_file(manifest, 10_000_000, StudyError))
            self._check_layout(content)
            found = {name: Artefact(**entry) for name, entry in content["artefacts"].items()}
            for artefact in found.values():
                path = PurePath(artefact.file)
                if path.is_absolute() or ".." in path.parts:
                    raise ValueError(f"{artefact.file} lies outside the study")
                if not all(isinstance(value, str) for value in artefact.made_from.values()):
                    raise ValueError(f"what {artefact.file} was made from is not told by hashes")
                for key, can_be in _SETTINGS.items():
                    if key in artefact.settings and not can_be(artefact.settings[key]):
                        value = repr(artefact.settings[key])
                        value = value if len(value) < 80 else f"{value[:80]} ..."
                        said = f"{key} of {artefact.file} is {value}"
                        raise ValueError(f"{said}, which no command wrote")
            return found
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise StudyError(
                f"{manifest} cannot be read ({error}); move it away and run the commands again"
            ) from error

    def _check_layout(self, content: Mapping[str, Any]) -> None:
        """Refuse the study of a newer femupdate; one of an older is read as it is."""
        layout = content.get("layout", LAYOUT)
        if int(layout) > LAYOUT:
            raise StudyError(
                f"the study {self.folder} was made by a newer femupdate "
                f"({content.get('femupdate')}, this is {__version__}); update femupdate, or choose "
                "another folder with --study"
            )

    @contextmanager
    def whole(self) -> Iterator[None]:
        """What is recorded meanwhile in a new study goes again where the data are refused."""
        new = not self.path(BUILDING_FILE).exists()
        try:
            yield
        except (MeasurementError, InferenceError):
            made = self.artefacts()
            if new and "surrogate" not in made:  # that took minutes
                for file in (*(each.file for each in made.values()), BUILDING_FILE, MANIFEST):
                    self.path(file).unlink(missing_ok=True)
            raise

    def record(
        self,
        name: str,
        file: str,
        command: str,
        made_from: Mapping[str, str],
        settings: Mapping[str, Any] | None = None,
    ) -> Artefact:
        """Note that `file` has been written, by what and from what.

        Args:
            file: inside the study, or inside the folder of the chosen posterior.
            command: that makes such a file; the one that is running may be another (`made_by`).
            made_from: hash of each thing it was made from.
        """
        words = _RUNNING.get()
        written = self.result(file) if name in _OF_A_POSTERIOR else self.path(file)
        artefact = Artefact(
            written.relative_to(self.folder).as_posix(),
            command,
            __version__,
            datetime.now(UTC).isoformat(timespec="milliseconds"),
            {**(settings or {}), **({"words": list(words)} if words else {})},
            dict(made_from),
            file_hash(written),
        )
        entries = {**self.artefacts(), self.key(name): artefact}
        content = {
            "femupdate": __version__,
            "layout": LAYOUT,
            "artefacts": {key: asdict(value) for key, value in sorted(entries.items())},
        }
        write_text(self.path(MANIFEST), json.dumps(content, indent=2, sort_keys=True) + "\n")
        return artefact

    def cached(self, part: StudyPart[T], made_from: Mapping[str, str], make: Callable[[], T]) -> T:
        """A part made from just these things: read back where it is kept, else made and kept.

        Raises:
            StudyError: its file holds something else, or cannot be written.
        """
        value = self.kept(part, made_from)
        return self.keep(part, made_from, make()) if value is None else value

    def kept(self, part: StudyPart[T], made_from: Mapping[str, str]) -> T | None:
        """A part made from just these things, or None where the study has none.

        Raises:
            StudyError: its file holds something else.
        """
        path = self.find(part.name, made_from)
        if path is None:
            return None
        with as_written(path):
            return part.read(path)

    def keep(self, part: StudyPart[T], made_from: Mapping[str, str], value: T) -> T:
        """Write a part and record what it was made from; returns it.

        Raises:
            StudyError: it cannot be written.
        """
        part.write(value, self.path(part.file))
        self.record(part.name, part.file, part.command, made_from, part.settings(value))
        return value

    def find(self, name: str, made_from: Mapping[str, str]) -> Path | None:
        """Path of an artefact if it is there, whole, and made from just these things."""
        artefact = self.artefact(name)
        if artefact is None or dict(artefact.made_from) != dict(made_from):
            return None
        path = self.path(artefact.file)
        if not path.is_file() or file_hash(path) != artefact.sha256:
            return None
        return path

    def made_by(self, command: str) -> str:
        """The command, as it is typed, that makes what this study lacks, be it repaired or not."""
        inside = self.folder.name == REPAIRED
        return typed("repair FILE", self.folder) if inside else f"femupdate {command}"

    def require(self, name: str, command: str) -> Path:
        """Path of an artefact that must be there and whole.

        Args:
            command: what the user should run when it is not.

        Raises:
            StudyError: it is missing, or is not the file that was recorded.
        """
        artefact = self.artefact(name)
        if artefact is None or not self.path(artefact.file).is_file():
            others = [path for path in self.posteriors() if path != self.posterior]
            meant = f", or choose {' or '.join(others)} with --posterior"
            raise StudyError(
                f"the study {self.folder} holds no {self.key(name)}; run "
                f"`{self.made_by(command)}` first"
                + (meant if others and name == MAIN_POSTERIOR else "")
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
        artefact = self.artefact(name)
        if artefact is None:
            return
        changed = [key for key, value in made_from.items() if artefact.made_from.get(key) != value]
        if changed:
            raise StudyError(
                f"the {self.key(name)} in {self.folder} was made from another "
                f"{' and '.join(changed)}; run `femupdate {command}` again"
            )


def study_of(study: Study | Path | str) -> Study:
    """A study, of which its folder will do."""
    return study if isinstance(study, Study) else Study(study)


def timed(columns: Mapping[str, str] | None, rate: float | None) -> Mapping[str, str] | None:
    """Names of columns as commands read them, with the rate of a table without times."""
    named = {ours: str(theirs) for ours, theirs in (columns or {}).items()}
    return (named if rate is None else {**named, "time_s": f"{rate:.9g} Hz"}) or None


_LOCK = ".lock"
# Folders inside a study into which files are written.
_WRITTEN = ("", "pictures", "tables")
_INNER = [f"{study}{inner}" for study in ("", "repaired/", "posteriors/*/") for inner in _WRITTEN]


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a study for this process; the system frees it whenever and however the process ends.

    What killed processes have left of unfinished files is removed first. Folders that were made
    for the lock and hold nothing at the end are removed.

    Args:
        folder: of the study, made where it is missing.

    Raises:
        StudyError: another process holds it, or the folder cannot be written.
    """
    from filelock import FileLock, Timeout

    made = [path for path in (folder, *folder.absolute().parents) if not path.exists()]
    lock = FileLock(folder / _LOCK)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock.acquire(blocking=False)
    except Timeout:
        raise StudyError(
            f"another process is writing into the study {folder}; wait until it has ended, or "
            "choose another folder with --study"
        ) from None
    except OSError as error:
        raise StudyError(write_failure(folder / _LOCK, error)) from error
    try:
        for inner in _INNER:
            for place in folder.glob(inner) if inner else (folder,):
                remove_parts(place)
        yield
    finally:
        with contextlib.suppress(OSError):
            (folder / _LOCK).unlink()
        lock.release()
        with contextlib.suppress(OSError):
            for path in made:
                path.rmdir()
