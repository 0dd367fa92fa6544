"""Archives of arrays: what comes back, and files that are none."""

import io
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from femupdate.storage import ArchiveError, check_shapes, read_arrays, write_arrays

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
