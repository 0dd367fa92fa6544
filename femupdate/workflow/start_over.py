"""start-over: what femupdate wrote into a study, removed; files of others stay."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from femupdate.errors import StudyError
from femupdate.study import MANIFEST, NAMED, Study

# The record goes first: without it, what is left of an interrupted removal counts for nothing.
_FILES = (
    MANIFEST,
    "building.toml",
    "*.npz",
    "*.safetensors",
    "posterior.nc",
    "prediction.nc",
    "posterior_summary.json",
    "mesh_error.json",
    "diagnosis.json",
    "repair.json",
    "mesh.vtu",
    "opensees_model.py",
    "member_forces.csv",
    "report.html",
    "pictures/*.png",
    "pictures/*.gif",
    "tables/*.csv",
    "tables/*.xlsx",
    "sampling/*",
)
_INSIDE = ("", "repaired/", f"{NAMED}/*/", f"repaired/{NAMED}/*/")


@dataclass(frozen=True)
class Removal:
    """Files that `start-over` removes, or has removed.

    Attributes:
        study: whose they are.
        files: that femupdate wrote.
        stay: files in the folder that it did not write.
    """

    study: Study
    files: tuple[Path, ...]
    stay: tuple[Path, ...]

    @property
    def size(self) -> int:
        """Bytes of the files that are there."""
        return sum(path.stat().st_size for path in self.files if path.exists())

    def question(self) -> str:
        """What is to be removed, for people."""
        names = [path.relative_to(self.study.folder).as_posix() for path in self.files]
        return "\n".join(
            (
                f"Of the study {self.study.folder}, {len(names)} files are removed "
                f"({self.size / 1e6:.1f} MB):",
                *(f"  {name}" for name in names),
                *(f"  {path} stays: femupdate did not write it" for path in self.stay),
            )
        )

    def as_dict(self) -> dict[str, Any]:
        """What `--json` holds."""
        return {"study": self.study.folder, "removed": self.files, "stay": self.stay}

    def lines(self) -> tuple[str, ...]:
        """For people, when it is done."""
        return (f"{len(self.files)} files of {self.study.folder} are removed.",)


def plan_removal(study: Study) -> Removal:
    """Find all that femupdate wrote into a study; removes nothing.

    Raises:
        StudyError: the folder holds no study.
    """
    if not study.path(MANIFEST).exists() and not study.path("building.toml").exists():
        raise StudyError(f"{study.folder} holds no study; choose one with --study")
    patterns = [f"{inside}{name}" for name in _FILES for inside in _INSIDE]
    found = [path for pattern in (*patterns, "dataset/*/*") for path in study.folder.glob(pattern)]
    files = tuple(dict.fromkeys(path for path in found if path.is_file()))
    there = {path for path in study.folder.rglob("*") if path.is_file()}
    return Removal(study, files, tuple(sorted(there - {*files})))


def remove(removal: Removal) -> None:
    """Remove the files, and folders that are empty then, but for the study's own.

    Raises:
        OSError: a file cannot be removed.
    """
    for path in removal.files:
        path.unlink(missing_ok=True)
    folders = {folder for path in removal.files for folder in path.parents}
    inside = [one for one in folders if removal.study.folder in one.parents]
    for folder in sorted(inside, key=lambda one: -len(one.parts)):
        if not any(folder.iterdir()):
            folder.rmdir()
