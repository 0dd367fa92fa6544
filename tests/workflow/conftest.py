"""Studies of the tower and of the cabin."""

from collections.abc import Callable
from pathlib import Path

import pytest

from femupdate.study import Study
from femupdate.workflow import StudyModel, open_study


@pytest.fixture
def tower(calibrated: Path) -> Study:
    """A study of the tower with a posterior, for one test alone."""
    return Study(calibrated)


@pytest.fixture(scope="session")
def tower_model(tower_study: Path) -> StudyModel:
    """The tower's model."""
    return open_study(Study(tower_study))


@pytest.fixture
def cabin_study(cabin_built: Study, tmp_path: Path) -> Study:
    """A study of the cabin, built, for one test alone."""
    import shutil

    return Study(shutil.copytree(cabin_built.folder, tmp_path / "cabin"))


@pytest.fixture(scope="session")
def cabin_built(built_once: Callable[..., Path], cabin_file: Path) -> Study:
    """A study of the cabin with its model and nothing else."""
    return Study(built_once("cabin", lambda folder: open_study(Study(folder), str(cabin_file))))
