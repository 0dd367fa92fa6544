"""The number of processors, on systems that tell it and on others."""

import os
import time

import pytest

from femupdate.workers import everywhere, processor_count


def test_processors_that_this_process_may_use():
    assert 1 <= processor_count() <= (os.cpu_count() or 1)


def test_systems_without_affinity(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 6)
    assert processor_count() == 6
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert processor_count() == 1


def test_work_comes_back_in_order():
    assert list(everywhere(abs, [-3, 1, -4, 1, -5, 9, -2])) == [3, 1, 4, 1, 5, 9, 2]
    assert list(everywhere(abs, [])) == []


def test_what_fails_ends_the_rest():
    """The first of many arguments is refused; most of the others are not tried any more."""
    tried = []

    def task(number):
        tried.append(number)
        time.sleep(0.01)
        if number == 0:
            raise ValueError("zero")

    with pytest.raises(ValueError, match="zero"):
        list(everywhere(task, range(200)))
    assert len(tried) < 100
