"""The benchmark `mutations`: what it changes, and whether tests notice it."""

import importlib
import os

import pytest
from femupdate.benchmarks.mutations.mutants import mutants_of
from femupdate.benchmarks.mutations.run import passes

SOURCE = '''\
LIMIT = 3.0

class Scale:
    """Not 1 + 1."""

    def of(self, a: "1 + 1", b=2):
        if a < b and a != -b:
            raise ValueError(f"{a + 1} is too small")
        return -a * 2.5
'''
TEST = """\
from changed import Scale

def test_scale():
    assert Scale().of(4.0) == -10.0
"""


@pytest.fixture
def module(tmp_path, monkeypatch):
    path = tmp_path / "changed.py"
    path.write_text(SOURCE)
    monkeypatch.syspath_prepend(str(tmp_path))
    return path


def test_operators_signs_and_numbers_of_functions_are_changed(module):
    found = [(one.function, one.line, one.before, one.after) for one in mutants_of(module)]
    assert {name for name, *_ in found} == {"Scale.of"}
    assert [rest for _, *rest in found] == [
        [7, "a < b and a != -b", "a < b or a != -b"],
        [7, "a < b", "a <= b"],
        [7, "a != -b", "a == -b"],
        [7, "-b", "+b"],
        [9, "-a * 2.5", "-a / 2.5"],
        [9, "-a", "+a"],
        [9, "2.5", "2.75"],
    ]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_change_is_noticed_or_survives(module):
    (module.parent / "test_changed.py").write_text(TEST)
    importlib.import_module("changed")
    tests = [str(module.parent / "test_changed.py")]
    assert passes(None, tests, 60)
    kept = [one.before for one in mutants_of(module) if passes(one, tests, 60)]
    assert kept == ["a < b", "a != -b", "-b"]
