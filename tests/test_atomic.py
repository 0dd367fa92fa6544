"""Files that are written whole or not at all."""

import errno
import os

import pytest

from femupdate.errors import MeasurementError, StudyError
from femupdate.storage import atomic_path


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_file_appears_when_the_block_has_ended(tmp_path):
    target = tmp_path / "deep" / "er" / "file.txt"
    with atomic_path(target) as temporary:
        temporary.write_text("new")
        assert temporary.parent == target.parent
        assert temporary.suffix == ".txt"  # writers choose a format by it
        assert not target.exists()
    assert target.read_text() == "new"
    assert names(target.parent) == ["file.txt"]


@pytest.mark.parametrize("there", [False, True])
@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, StudyError, ZeroDivisionError])
def test_an_error_leaves_all_as_it_was(tmp_path, error, there):
    target = tmp_path / "file.txt"
    if there:
        target.write_text("old")

    def half():
        with atomic_path(target) as temporary:
            temporary.write_text("half")
            raise error("as it is")

    with pytest.raises(error, match="as it is"):
        half()
    assert names(tmp_path) == (["file.txt"] if there else [])
    assert not there or target.read_text() == "old"


def no_space(*_, **__):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("kind", [StudyError, MeasurementError])
def test_a_full_disk(tmp_path, kind):
    target = tmp_path / "file.txt"
    target.write_text("old")
    with pytest.raises(kind) as caught, atomic_path(target, kind):
        no_space()
    text = f"cannot write {target}: the disk is full; free some space and run the command again"
    assert str(caught.value) == text
    assert target.read_text() == "old"
    assert names(tmp_path) == ["file.txt"]


def test_a_file_that_may_not_grow(tmp_path):
    with (
        pytest.raises(StudyError, match=r"may not grow that large here; raise the limit"),
        atomic_path(tmp_path / "f"),
    ):
        raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))


@pytest.mark.parametrize(
    "text",
    [
        "Error while serializing: I/O error: No space left on device (os error 28)",
        "Can't write data (file write failed: errno = 28, error message = 'No space left')",
    ],
)
def test_other_libraries_report_a_full_disk_in_words(tmp_path, text):
    class LibraryError(Exception):
        pass

    with pytest.raises(StudyError, match="the disk is full"), atomic_path(tmp_path / "f"):
        raise LibraryError(text)
