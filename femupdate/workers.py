"""Work on many pieces at once, in threads of this machine; results do not depend on how many."""

import contextlib
import ctypes
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextvars import ContextVar
from functools import cache
from typing import TypeVar

from threadpoolctl import ThreadpoolController

from femupdate.progress import SILENT, Progress

# What sets the threads of numerical libraries; to find these takes ten milliseconds.
_libraries = cache(ThreadpoolController)
A = TypeVar("A")
T = TypeVar("T")

# Inside of a piece the processors are at work already.
_ALONE: ContextVar[bool] = ContextVar("one piece after the other", default=False)


@contextlib.contextmanager
def one_by_one() -> Iterator[None]:
    """Have all work inside done one piece after the other."""
    token = _ALONE.set(True)
    try:
        yield
    finally:
        _ALONE.reset(token)


def in_threads(
    task: Callable[[A], T], arguments: Iterable[A], progress: Progress = SILENT
) -> list[T]:
    """The results of one thing done with every argument, each a step of the progress.

    The first that fails ends the rest; its error is raised.

    Args:
        task: what to do; it changes nothing that others read.
    """
    if _ALONE.get():
        found = []
        for argument in arguments:
            found.append(task(argument))
            progress.advance()
        return found
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with (
            _libraries().limit(limits=1),
            ThreadPoolExecutor(processor_count(), initializer=_ALONE.set, initargs=(True,)) as pool,
        ):
            pieces = [pool.submit(task, argument) for argument in arguments]
            try:
                for piece in as_completed(pieces):
                    piece.result()
                    progress.advance()
            finally:
                for piece in pieces:
                    piece.cancel()
            return [piece.result() for piece in pieces]
    finally:
        torch.set_num_threads(threads)


def return_memory() -> None:
    """Return to the system what threads have freed, hundreds of MB after a reduction.

    The allocator of glibc keeps it for threads to come.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)


def processor_count() -> int:
    """Processors that this process may use, at least one (all of them where no one can say)."""
    if hasattr(os, "sched_getaffinity"):  # Linux only
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1
