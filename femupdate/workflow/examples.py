"""examples: the shipped example files, copied where they can be used."""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from femupdate.result import Item, Note, Result
from femupdate.storage import atomic_path

_LEFT_OUT = ("__init__.py", "__pycache__")


@dataclass(frozen=True)
class CopiedExamples(Result):
    """Example files in a folder: the new ones, and those that were there and stay as they are."""

    folder: Path
    copied: tuple[Path, ...]
    kept: tuple[Path, ...]

    def items(self) -> Iterator[Item]:
        """The files."""
        yield Note(f"Examples in {self.folder}:", {"folder": self.folder})
        yield Note("\n".join(f"  {path}" for path in self.copied), {"copied": self.copied})
        there = (f"  {path} was there already and stays as it is" for path in self.kept)
        yield Note("\n".join(there), {"kept": self.kept})


def copy_examples(folder: Path) -> CopiedExamples:
    """Copy the shipped examples and building files into a folder; no file there is replaced.

    Raises:
        StudyError: a file cannot be written.
    """
    copied, kept = [], []
    models = [
        (Path("models") / name, source)
        for name, source in _shipped(files("femupdate.models"))
        if name.suffix == ".toml"
    ]
    for name, source in (*_shipped(files("femupdate.examples")), *models):
        target = folder / name
        if target.exists():
            kept.append(target)
            continue
        with atomic_path(target) as temporary:
            temporary.write_bytes(source.read_bytes())
        copied.append(target)
    return CopiedExamples(folder, tuple(copied), tuple(kept))


def _shipped(folder: Traversable, above: Path = Path()) -> Iterator[tuple[Path, Traversable]]:
    """Path below the folder and content of every file."""
    for entry in sorted(folder.iterdir(), key=lambda path: path.name):
        if entry.name in _LEFT_OUT:
            continue
        if entry.is_dir():
            yield from _shipped(entry, above / entry.name)
        else:
            yield above / entry.name, entry
