"""The number of processors, on systems that tell it and on others."""

import os

from femupdate.processors import processor_count


def test_processors_that_this_process_may_use():
    assert 1 <= processor_count() <= (os.cpu_count() or 1)


def test_systems_without_affinity(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 6)
    assert processor_count() == 6
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert processor_count() == 1
