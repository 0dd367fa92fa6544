"""Threads at work, and the seeds of what is random in them."""

import os
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import torch

from femupdate.seeds import spawn, torch_generator
from femupdate.workers import in_threads, processor_count


def test_processors_that_this_process_may_use():
    assert 1 <= processor_count() <= (os.cpu_count() or 1)


def test_work_comes_back_in_order():
    assert list(in_threads(abs, [-3, 1, -4, 1, -5, 9, -2])) == [3, 1, 4, 1, 5, 9, 2]
    assert list(in_threads(abs, [])) == []


def test_work_inside_of_a_piece_stays_in_its_thread():
    """Else every processor would have as many pieces at work as there are processors."""

    def outer(number):
        inside = [lambda k=k: (number + k, threading.get_ident()) for k in range(4)]
        found = in_threads(lambda task: task(), inside)
        assert {thread for _, thread in found} == {threading.get_ident()}
        return [value for value, _ in found]

    for number, values in enumerate(in_threads(outer, range(6))):
        assert values == [number + k for k in range(4)]


def test_what_fails_ends_the_rest():
    """The first of many arguments is refused; most of the others are not tried any more."""
    tried = []

    def task(number):
        tried.append(number)
        time.sleep(0.01)
        if number == 0:
            raise ValueError("zero")

    with pytest.raises(ValueError, match="zero"):
        list(in_threads(task, range(200)))
    assert len(tried) < 100


# Each task frees 128 MB in pieces, and what it returns lies behind them.
HELD = """
import os
from pathlib import Path

import numpy as np

from femupdate.workers import in_threads, return_memory

def held():
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6

def task(number):
    scratch = [np.ones(4_000) for _ in range(4_000)]
    return float(scratch[-1][0]) * np.ones(4_000)

list(in_threads(task, [0]))
before = held()
found = list(in_threads(task, range(8)))
return_memory()
print(held() - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the allocator of Linux")
def test_freed_memory_goes_back_to_the_system():
    """In a process of its own, as others hold memory too; without it 190 MB stay."""
    done = subprocess.run(
        [sys.executable, "-c", HELD], capture_output=True, text=True, check=True, timeout=120
    )
    assert float(done.stdout) < 50.0


def numbers(seed):
    return tuple(torch.rand(3, generator=torch_generator(seed)).tolist())


def test_streams_differ_from_one_another_and_from_those_of_other_seeds():
    """Seeds up to 1,100 and their first runs: 1009 seed + k met the stream of another seed."""
    streams = [
        stream for seed in range(1100) for stream in (seed, *spawn(seed, 3), *spawn(seed + 1, 1))
    ]
    drawn = {numbers(stream) for stream in streams}
    # The first stream of a seed is listed twice, as that of a seed and as its successor's.
    assert len(drawn) == 1100 * 4 + 1


def test_spawning_again_gives_the_same_streams():
    parent = spawn(3, 1)[0]
    first, again = spawn(parent, 2), spawn(parent, 3)[:2]
    assert [numbers(one) for one in first] == [numbers(one) for one in again]
    one, other = (np.random.default_rng(part).random(4) for part in (first[0], again[0]))
    np.testing.assert_array_equal(one, other)
