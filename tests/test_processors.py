"""The number of processors, on systems that tell it and on others."""

import os

import pytest

from femupdate.processors import everywhere, processor_count


def test_processors_that_this_process_may_use():
    assert 1 <= processor_count() <= (os.cpu_count() or 1)


def test_systems_without_affinity(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 6)
    assert processor_count() == 6
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert processor_count() == 1


@pytest.mark.parametrize("dof", [10, 10_000])  # in this process, and in processes of their own
def test_work_comes_back_in_order(dof):
    assert list(everywhere(abs, [-3, 1, -4, 1, -5, 9, -2], dof)) == [3, 1, 4, 1, 5, 9, 2]
    assert list(everywhere(abs, [], dof)) == []
