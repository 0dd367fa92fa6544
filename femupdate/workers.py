"""Where work is done: in threads of this machine, or by any executor, such as that of Dask.

Whoever has many pieces of the same work says `everywhere` or `completed`, and does not know where
they are done. The results are the same to the last digit wherever that is.

Dask (extra `distributed`) sends objects of Python between machines: whoever reaches its scheduler
can run programs on its workers. It belongs inside a network that is trusted.
"""

import contextlib
import ctypes
import logging
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor, as_completed
from contextvars import ContextVar
from functools import cache, lru_cache
from typing import Any, TypeVar

from threadpoolctl import ThreadpoolController, threadpool_limits

from femupdate import __version__
from femupdate.errors import WorkersError
from femupdate.progress import SILENT, Progress

logger = logging.getLogger(__name__)

LOCAL = "local"
_CONNECT_S = 20.0
_CONFIGURATION = {
    # Of workers over one piece, after which the piece is to blame.
    "distributed.scheduler.allowed-failures": 10,
    # A process that was killed comes back. On a busy machine its imports outlast Dask's 15 s,
    # after which it is given up for good.
    "distributed.deploy.lost-worker-timeout": "1 day",
    # Only local workers are given up, where none comes back at all: an address keeps its own.
    "distributed.scheduler.no-workers-timeout": "5 minutes",
    # A model of a hundred megabytes is sent on purpose.
    "distributed.admin.large-graph-warning-threshold": "100 GiB",
}
_NOISY = ("distributed", "tornado", "asyncio")
# What sets the threads of numerical libraries; to find these takes ten milliseconds.
_libraries = cache(ThreadpoolController)
A = TypeVar("A")
T = TypeVar("T")

# The executor that is used; "none" inside of a piece, where the processors are at work already.
_CHOSEN: ContextVar[Executor | str | None] = ContextVar("executor", default=None)
_NONE = "none"


@contextlib.contextmanager
def working_on(executor: Executor | str) -> Iterator[None]:
    """Have all work inside done by an executor, or by "none": one piece after the other."""
    token = _CHOSEN.set(executor)
    try:
        yield
    finally:
        _CHOSEN.reset(token)


def completed(task: Callable[[A], T], arguments: Sequence[A]) -> Iterator[tuple[int, T]]:
    """Do one thing with every argument; number and result of each as soon as it is done.

    The first that fails ends the rest; its error is raised.

    Args:
        task: what to do; it changes nothing that others read.
    """
    chosen = _CHOSEN.get()
    if chosen is None:
        return _by_threads(task, arguments)
    if not isinstance(chosen, Executor):
        return ((number, task(argument)) for number, argument in enumerate(arguments))
    return _submitted(chosen, task, arguments)


def everywhere(
    task: Callable[[A], T], arguments: Sequence[A], progress: Progress = SILENT
) -> list[T]:
    """The results of `completed`, in the order of the arguments, each a step of the progress."""
    found = []
    for result in _in_order(completed(task, arguments)):
        found.append(result)
        progress.advance()
    return found


def in_threads(task: Callable[[A], T], arguments: Iterable[A]) -> list[T]:
    """The results of small pieces that share much, in the order of the arguments.

    They never leave this machine: to send them would take longer than to do them.
    """
    if _CHOSEN.get() == _NONE:
        return [task(argument) for argument in arguments]
    return list(_in_order(_by_threads(task, tuple(arguments))))


def processor_count() -> int:
    """Processors that this process may use, at least one (all of them where no one can say)."""
    if hasattr(os, "sched_getaffinity"):  # Linux only
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1


def _in_order(pieces: Iterator[tuple[int, T]]) -> Iterator[T]:
    waiting: dict[int, Any] = {}
    following = 0
    for number, result in pieces:
        waiting[number] = result
        while following in waiting:
            yield waiting.pop(following)
            following += 1


def _submitted(
    executor: Executor, task: Callable[[A], T], arguments: Sequence[A]
) -> Iterator[tuple[int, T]]:
    places = {executor.submit(task, argument): k for k, argument in enumerate(arguments)}
    try:
        for future in as_completed(places):
            yield places[future], future.result()
    finally:
        for future in places:
            future.cancel()


def _by_threads(task: Callable[[A], T], arguments: Sequence[A]) -> Iterator[tuple[int, T]]:
    """On the processors of this machine."""
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with (
            _libraries().limit(limits=1),
            ThreadPoolExecutor(
                processor_count(), initializer=_CHOSEN.set, initargs=(_NONE,)
            ) as pool,
        ):
            yield from _submitted(pool, task, arguments)
    finally:
        torch.set_num_threads(threads)
        # The allocator of glibc keeps what threads have freed for threads to come: hundreds of MB
        # after a reduction.
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
        if trim is not None:
            trim(0)


@contextlib.contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """The executor of the Dask scheduler at an address, or of one made here while it is used.

    Args:
        address: such as tcp://10.0.0.1:8786; "local" for a process a processor of this machine.

    Raises:
        WorkersError: Dask is not installed, no scheduler answers or it is lost, a process does not
            start, or a worker has no femupdate, or another.
    """
    try:
        import dask
        from distributed import Client
        from distributed.scheduler import KilledWorker, NoValidWorkerError, NoWorkerError
    except ImportError as error:
        raise WorkersError(
            'Dask is not installed; pip install "femupdate[distributed]", or leave --dask out'
        ) from error
    for name in list(logging.root.manager.loggerDict):
        if name.split(".")[0] in _NOISY:  # what goes wrong is told in one sentence
            logging.getLogger(name).setLevel(logging.CRITICAL)
    with contextlib.ExitStack() as stack:
        stack.enter_context(dask.config.set(_CONFIGURATION))
        target: Any = stack.enter_context(_local_cluster()) if address == LOCAL else address
        try:
            client = Client(target, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise WorkersError(
                f"no Dask scheduler answers at {address}; start one with `dask scheduler`, and "
                "workers with `dask worker ADDRESS`"
            ) from error
        stack.enter_context(client)
        if not client.scheduler_info(n_workers=-1)["workers"]:
            logger.warning("%s has no workers yet; the work starts with the first", address)
        for worker, answer in client.run(_version, on_error="return").items():
            if answer != __version__ and not isinstance(answer, OSError):  # which has just died
                found = f"none ({answer})" if isinstance(answer, Exception) else answer
                raise _another(__version__, worker, found)
        try:
            yield _DaskExecutor(client)
        except KilledWorker as error:
            raise WorkersError(
                f"workers of {address} died again and again over one piece of work; give each "
                "more memory, or fewer threads, and run the command again"
            ) from error
        except (NoValidWorkerError, NoWorkerError) as error:
            raise WorkersError(
                f"all workers of {address} ended and none came back; what is done is kept, so run "
                "the command again"
            ) from error
        except CancelledError as error:
            raise WorkersError(
                f"the Dask scheduler {address} was lost; what is done is kept, so start it and run "
                "the command again"
            ) from error


class _DaskExecutor(Executor):
    """The executor of a client, which sends every task once and not with each of its arguments."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._inner = client.get_executor(pure=False)
        self._sent: tuple[Any, Any] = (None, None)

    def submit(  # type: ignore[override]
        self, task: Callable[[A], T], /, argument: A
    ) -> "Future[T]":
        from distributed.protocol.pickle import dumps

        if self._sent[0] is not task:
            # The scheduler keeps the bytes: a worker that dies takes no copy of them along that
            # could not be made again. Pieces may leave in a task what cannot be sent, such as a
            # factorization; were it passed on to another worker, Dask would wait for ever
            # (dask/distributed#6705). Bytes always can be.
            self._sent = task, self._client.submit(bytes, dumps(task), pure=False)
        future: Future[T] = self._inner.submit(_done, __version__, self._sent[1], dumps(argument))
        return future


def _local_cluster() -> Any:
    """A process for every processor of this machine."""
    from distributed import LocalCluster

    try:
        return LocalCluster(
            n_workers=processor_count(),
            threads_per_worker=1,
            memory_limit=0,
            dashboard_address=None,
            # Another cluster on this machine may have the usual port.
            scheduler_kwargs={"dashboard_address": ":0"},
            silence_logs=logging.CRITICAL,
        )
    except RuntimeError as error:  # Dask's word for it
        raise WorkersError(
            f"a process of --dask {LOCAL} ended while it was starting; run the command again, or "
            "leave --dask out where memory is short"
        ) from error


def _another(here: str, worker: str, there: str) -> WorkersError:
    return WorkersError(
        f"here is femupdate {here}, and on the worker {worker} {there}; install the same everywhere"
    )


def _version() -> str:
    return __version__


@lru_cache(maxsize=1)
def _task(pickled: bytes) -> Callable[[Any], Any]:
    """On a worker: one copy of the task for all pieces."""
    from distributed.protocol.pickle import loads

    task: Callable[[Any], Any] = loads(pickled)
    return task


def _done(version: str, task: bytes, argument: bytes) -> Any:
    """On a worker: one piece, with one thread of the numerical libraries as everywhere."""
    import torch
    from distributed import get_worker
    from distributed.protocol.pickle import loads

    if version != __version__:
        raise _another(version, get_worker().address, __version__)
    # For good: threads of one worker would give each other's numbers back.
    torch.set_num_threads(1)
    threadpool_limits(1)
    with working_on(_NONE):
        return _task(task)(loads(argument))
