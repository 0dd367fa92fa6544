"""Files: written whole or not at all, read without trust; archives of arrays."""

import errno
import io
import os
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from femupdate.building import load_building
from femupdate.errors import BuildingError, FemupdateError, MeasurementError, StudyError
from femupdate.measurement import read_observation_file, read_record
from femupdate.storage import (
    ArchiveError,
    atomic_path,
    check_shapes,
    read_arrays,
    read_file,
    write_arrays,
)


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


ARRAYS = {"a": np.arange(12.0).reshape(3, 4), "n": np.array([1, 2]), "text": np.array("θ")}


@pytest.fixture
def path(tmp_path):
    write_arrays(tmp_path / "arrays.npz", **ARRAYS)
    return tmp_path / "arrays.npz"


def test_arrays_come_back(path):
    back = read_arrays(path)
    assert back.keys() == ARRAYS.keys()
    for name, value in ARRAYS.items():
        np.testing.assert_array_equal(back[name], value)


@settings(deadline=None, max_examples=150)
@given(data=st.data())
def test_no_damage_ends_in_a_traceback(tmp_path_factory, data):
    buffer = io.BytesIO()
    np.savez(buffer, **ARRAYS)
    content = bytearray(buffer.getvalue())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(content)))
    path = tmp_path_factory.getbasetemp() / "damaged.npz"
    path.write_bytes(content[:cut] if data.draw(st.booleans()) else content)
    try:
        assert isinstance(read_arrays(path, 1e6), dict)
    except ArchiveError as error:
        assert "\n" not in str(error)  # noqa: PT017


def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path):
    """Zeros shrink a thousandfold: 80 MB in less than 100 kB."""
    np.savez_compressed(tmp_path / "bomb.npz", a=np.zeros(10_000_000))
    assert (tmp_path / "bomb.npz").stat().st_size < 100_000
    with pytest.raises(ArchiveError, match=r"a\.npy claims 0\.08 GB"):
        read_arrays(tmp_path / "bomb.npz", largest_bytes=10_000_000)


def test_what_is_no_array_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "z.npz", "w") as archive:
        archive.writestr("note.txt", "hello")
    with pytest.raises(ArchiveError, match="no archive of numpy arrays"):
        read_arrays(tmp_path / "z.npz")


SHAPES = {"a": "rc", "b": "c"}


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"a": np.ones((3, 4))}, "b is missing"),
        ({"a": np.ones((3, 4)), "b": np.ones(3)}, r"b has the shape \(3,\)"),
        ({"a": np.ones(3), "b": np.ones(3)}, r"a has the shape \(3,\)"),
        ({"a": np.ones((3, 4)), "b": np.array(["x"] * 4)}, "b has the shape"),
        ({"a": np.full((3, 4), np.nan), "b": np.ones(4)}, "a holds a value that is no number"),
        ({"a": np.ones((3, 4)), "b": np.full(4, np.inf)}, "b holds a value that is no number"),
    ],
)
def test_shapes_that_do_not(arrays, message):
    with pytest.raises(ArchiveError, match=message):
        check_shapes(arrays, SHAPES)


def test_a_file_that_is_too_large(tmp_path):
    (tmp_path / "f").write_bytes(bytes(2_000_001))
    with pytest.raises(StudyError, match=r"f has 2 MB, more than the 1 MB .*split it"):
        read_file(tmp_path / "f", 1_000_000, StudyError)


def fifo(folder):
    os.mkfifo(folder / "pipe.csv")
    return folder / "pipe.csv"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes and devices of POSIX")
@pytest.mark.parametrize("make", [fifo, lambda folder: Path("/dev/zero")], ids=["pipe", "device"])
@pytest.mark.parametrize("read", [load_building, read_observation_file, read_record])
def test_pipes_and_devices(tmp_path, make, read):
    with pytest.raises(FemupdateError, match="is a pipe or a device; save its content as a file"):
        read(make(tmp_path))


def test_limits_of_texts(tmp_path):
    with open(tmp_path / "long.csv", "wb") as file:
        file.write(b"time_s,a\ns,gal\n0,1\n")
        file.truncate(300_000_001)  # the rest takes no room on the disk
    with pytest.raises(MeasurementError, match="more than the 300 MB that such a file may have"):
        read_record(tmp_path / "long.csv")
    (tmp_path / "b.toml").write_bytes(b" " * 20_000_001)
    with pytest.raises(BuildingError, match="too large for a building file"):
        load_building(tmp_path / "b.toml")
