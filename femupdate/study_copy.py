"""A copy of a study, for work that leaves the study itself as it is."""

import shutil
from pathlib import Path

from femupdate.atomic import atomic_path
from femupdate.errors import StudyError
from femupdate.study import BUILDING_FILE, MANIFEST, Study

_BESIDE = (BUILDING_FILE, "posterior_summary.json", "posteriors/*/posterior_summary.json")


def copied(study: Study, folder: Path) -> Study:
    """Copy what commands read of a study; pictures, tables and pages stay behind.

    Args:
        study: only read.
        folder: new, or without a study.

    Raises:
        StudyError: there is nothing to copy, the folder holds a study, or it cannot be written.
    """
    if not study.path(MANIFEST).exists():
        raise StudyError(
            f"{study.folder} holds no study to copy; choose one with --study, or begin a new one "
            f"by --study {folder}"
        )
    copy = Study(folder, study.posterior)
    copy.check_writable()
    if copy.path(MANIFEST).exists():
        raise StudyError(
            f"{folder} holds a study already; go on with it by --study {folder}, or choose another "
            "folder with --output"
        )
    beside = [path for name in _BESIDE for path in study.folder.glob(name)]
    recorded = [study.path(artefact.file) for artefact in study.artefacts().values()]
    # The record comes last: a copy that was cut short is no study.
    for path in (*beside, *recorded, study.path(MANIFEST)):
        if path.is_file():
            with atomic_path(folder / path.relative_to(study.folder)) as temporary:
                shutil.copyfile(path, temporary)
    return copy
