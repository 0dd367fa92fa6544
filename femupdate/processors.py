"""How many processors there are to work with, and how to share work out among them."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

A = TypeVar("A")
T = TypeVar("T")


def processor_count() -> int:
    """Processors that this process may use, at least one (all of them where no one can say)."""
    if hasattr(os, "sched_getaffinity"):  # Linux only
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1


def everywhere(task: Callable[[A], T], arguments: Sequence[A]) -> Iterator[T]:
    """Do one thing with every argument, on all processors, in order.

    Threads share the model. SuperLU, LAPACK and BLAS let go of Python's lock, and what is done here
    is theirs. Each thread has one BLAS thread, as more would only be in each other's way.

    Args:
        task: what to do; it changes nothing that others read.
        arguments: of each.
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        pool = ThreadPoolExecutor(processor_count())
        try:
            yield from pool.map(task, arguments)
        finally:
            pool.shutdown(cancel_futures=True)
