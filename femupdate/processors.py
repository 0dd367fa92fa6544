"""How many processors there are to work with, and how to share work out among them."""

import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import TypeVar

A = TypeVar("A")
T = TypeVar("T")

_LARGE = 2000  # degrees of freedom from which processes of their own pay
_WATCH_EVERY_S = 0.5


def processor_count() -> int:
    """Processors that this process may use, at least one (all of them where no one can say)."""
    if hasattr(os, "sched_getaffinity"):  # Linux only
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1


def everywhere(task: Callable[[A], T], arguments: Sequence[A], dof: int) -> Iterator[T]:
    """Do one thing with every argument, on all processors, in order.

    ARPACK and SuperLU hold Python's lock: threads would take turns, processes do not. Each has one
    BLAS thread, as more would only be in each other's way.

    Args:
        task: what to do; it is sent to the processes with all that it holds.
        arguments: of each.
        dof: degrees of freedom of the model that it works on: a small one stays in this process.
    """
    from joblib import Parallel, delayed, parallel_config
    from threadpoolctl import threadpool_limits

    workers = processor_count() if dof > _LARGE else 1
    # A process gets the task's data with every job: a few arguments share one journey.
    count = max(1, -(-len(arguments) // 4))
    parts = [
        arguments[k * len(arguments) // count : (k + 1) * len(arguments) // count]
        for k in range(count)
    ]
    with threadpool_limits(1), parallel_config("loky", inner_max_num_threads=1):
        pool = Parallel(n_jobs=workers, max_nbytes=None, batch_size=1, return_as="generator")
        for results in pool(delayed(_several)(task, part, os.getpid()) for part in parts):
            yield from results


def _several(task: Callable[[A], T], arguments: Sequence[A], employer: int) -> list[T]:
    if employer != os.getpid():
        _end_with(employer)
    return [task(argument) for argument in arguments]


@cache
def _end_with(employer: int) -> None:
    """End this process soon after the one that it works for: a killed one cannot tell it."""

    def watch() -> None:
        while os.getppid() == employer:
            time.sleep(_WATCH_EVERY_S)
        os._exit(1)

    if hasattr(os, "fork"):  # elsewhere the number of a dead parent stays
        threading.Thread(target=watch, name="employer", daemon=True).start()
