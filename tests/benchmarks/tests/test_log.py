"""Parts of a benchmark on disk: read back as they were, and made again where they are not whole."""

from dataclasses import dataclass

import numpy as np
import pytest
from femupdate.benchmarks.log import ResumableLog

from femupdate.arrays import Floats


@dataclass(frozen=True)
class Inner:
    mean: float
    names: tuple[str, ...]


@dataclass(frozen=True)
class Part:
    count: int
    label: str
    whole: bool
    values: Floats
    inner: Inner
    perhaps: Inner | None
    evidence: float


FIRST = Part(
    *(3, "first", False, np.array([[1.0, np.nan], [0.5, 2.0]])),
    *(Inner(np.nan, ("2F", "RF")), None, -np.inf),
)
SECOND = Part(1, "second", True, np.array([]), Inner(0.5, ()), Inner(2.0, ("3F",)), 1.5)


def refuse():
    raise AssertionError("it was made already")


def same(one, other):
    assert type(one) is type(other)
    for name, value in vars(one).items():
        if isinstance(value, Inner):
            same(value, getattr(other, name))
        else:
            assert type(value) is type(getattr(other, name))
            np.testing.assert_array_equal(value, getattr(other, name))


@pytest.fixture
def path(tmp_path):
    """Of a log of both parts."""
    log = ResumableLog(tmp_path / "folder" / "parts.jsonl", ["a plan", np.nan])
    assert log.get_or_make("first", Part, lambda: FIRST) is FIRST
    assert log.get("second", Part) is None
    log.add("second", SECOND)
    return tmp_path / "folder" / "parts.jsonl"


def test_parts_come_back_as_they_were(path):
    log = ResumableLog(path, ["a plan", np.nan])
    same(log.get_or_make("first", Part, refuse), FIRST)
    same(log.get_or_make("second", Part, refuse), SECOND)


def test_half_a_line_and_another_plan_are_made_again(path):
    path.write_text(path.read_text()[:-40])
    log = ResumableLog(path, ["a plan", np.nan])
    same(log.get_or_make("first", Part, refuse), FIRST)
    assert log.get_or_make("second", Part, lambda: SECOND) is SECOND
    assert len(path.read_text().splitlines()) == 3
    assert ResumableLog(path, "another plan").get("first", Part) is None
