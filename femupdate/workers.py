"""Where work is done: on the processors of this machine, or on those that Dask shares out.

Whoever has many pieces of the same work says `everywhere` or `completed`, and does not know where
they are done. The results are the same to the last digit wherever that is.
"""

import contextlib
import ctypes
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextvars import ContextVar
from typing import Any, Protocol, TypeVar

A = TypeVar("A")
T = TypeVar("T")


class Workers(Protocol):
    """Do pieces of work, several at a time."""

    def completed(self, task: Callable[[A], T], arguments: Sequence[A]) -> Iterator[tuple[int, T]]:
        """Number and result of every piece, as soon as each is done.

        The first that fails ends the rest; its error is raised.
        """
        ...


def processor_count() -> int:
    """Processors that this process may use, at least one (all of them where no one can say)."""
    if hasattr(os, "sched_getaffinity"):  # Linux only
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1


class Threads:
    """The processors of this machine.

    Threads share the model. SuperLU, LAPACK and BLAS let go of Python's lock, and what is done here
    is theirs. Each has one thread of its own, as more would only be in each other's way.
    """

    def completed(self, task: Callable[[A], T], arguments: Sequence[A]) -> Iterator[tuple[int, T]]:
        """As `Workers` says; what is being done when another piece fails still comes."""
        failed: BaseException | None = None
        with _single_threads():
            pool = ThreadPoolExecutor(
                processor_count(), initializer=_CHOSEN.set, initargs=(OneByOne(),)
            )
            try:
                places = {pool.submit(task, one): k for k, one in enumerate(arguments)}
                for future in as_completed(places):
                    if future.cancelled():
                        continue
                    if (error := future.exception()) is None:
                        yield places[future], future.result()
                        continue
                    failed = failed or error
                    for other in places:
                        other.cancel()
            finally:
                pool.shutdown(cancel_futures=True)
                _give_memory_back()
        if failed is not None:
            raise failed


class OneByOne:
    """One piece after the other, where the processors are at work already: inside of a piece."""

    def completed(self, task: Callable[[A], T], arguments: Sequence[A]) -> Iterator[tuple[int, T]]:
        """As `Workers` says."""
        return ((number, task(one)) for number, one in enumerate(arguments))


@contextlib.contextmanager
def _single_threads() -> Iterator[None]:
    """Keep the numerical libraries to one thread, and give them back theirs."""
    import torch
    from threadpoolctl import threadpool_limits

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with threadpool_limits(1):
            yield
    finally:
        torch.set_num_threads(threads)


def _give_memory_back() -> None:
    """Hand freed memory back to the system, where the allocator can (glibc).

    It keeps what threads have freed for threads to come: hundreds of MB after a reduction.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)


_CHOSEN: ContextVar[Workers | None] = ContextVar("workers", default=None)


@contextlib.contextmanager
def working_on(workers: Workers) -> Iterator[None]:
    """Have all work inside done by these."""
    token = _CHOSEN.set(workers)
    try:
        yield
    finally:
        _CHOSEN.reset(token)


def completed(task: Callable[[A], T], arguments: Sequence[A]) -> Iterator[tuple[int, T]]:
    """Do one thing with every argument; number and result of each as soon as it is done.

    Args:
        task: what to do; it changes nothing that others read.
        arguments: of each.
    """
    return (_CHOSEN.get() or Threads()).completed(task, arguments)


def everywhere(task: Callable[[A], T], arguments: Sequence[A]) -> Iterator[T]:
    """The results of `completed`, in the order of the arguments."""
    return _in_order(completed(task, arguments))


def in_threads(task: Callable[[A], T], arguments: Iterable[A]) -> list[T]:
    """The results of small pieces that share much, in the order of the arguments.

    They never leave this machine: to send them would take longer than to do them.
    """
    chosen = _CHOSEN.get()
    here = chosen if isinstance(chosen, OneByOne) else Threads()
    return list(_in_order(here.completed(task, tuple(arguments))))


def _in_order(pieces: Iterator[tuple[int, T]]) -> Iterator[T]:
    waiting: dict[int, Any] = {}
    following = 0
    for number, result in pieces:
        waiting[number] = result
        while following in waiting:
            yield waiting.pop(following)
            following += 1
