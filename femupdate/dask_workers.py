"""Work on the machines of a Dask scheduler, or in processes of this one (extra `distributed`).

Dask sends objects of Python between the machines: whoever reaches the scheduler can run programs on
its workers. It belongs inside a network that is trusted.
"""

import contextlib
import logging
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, TypeVar

from femupdate import __version__
from femupdate.errors import WorkersError
from femupdate.workers import OneByOne, processor_count, working_on

logger = logging.getLogger(__name__)

LOCAL = "local"
_CONNECT_S = 20.0
_DEATHS = 10  # of workers over one piece, after which the piece is to blame
_CONFIGURATION = {
    "distributed.scheduler.allowed-failures": _DEATHS,
    # A process that was killed comes back. On a busy machine its imports outlast Dask's 15 s,
    # after which it is given up for good.
    "distributed.deploy.lost-worker-timeout": "1 day",
    # A model of a hundred megabytes is sent on purpose.
    "distributed.admin.large-graph-warning-threshold": "100 GiB",
}
_NOISY = ("distributed", "tornado", "asyncio")
A = TypeVar("A")
T = TypeVar("T")


@contextlib.contextmanager
def dask_workers(address: str) -> Iterator["DaskWorkers"]:
    """Workers of the scheduler at an address, or of one made here for as long as they are used.

    Args:
        address: such as tcp://10.0.0.1:8786; "local" for a process a processor of this machine.

    Raises:
        WorkersError: Dask is not installed, or no scheduler answers.
    """
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise WorkersError(
            'Dask is not installed; pip install "femupdate[distributed]", or leave --dask out'
        ) from error
    _silence()
    with contextlib.ExitStack() as stack:
        stack.enter_context(dask.config.set(_CONFIGURATION))
        if address == LOCAL:
            cluster = LocalCluster(
                n_workers=processor_count(),
                threads_per_worker=1,
                memory_limit=0,
                dashboard_address=None,
                # Another cluster on this machine may have the usual port.
                scheduler_kwargs={"dashboard_address": ":0"},
                silence_logs=logging.CRITICAL,
            )
            target: Any = stack.enter_context(cluster)
        else:
            target = address
        try:
            client = Client(target, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise WorkersError(
                f"no Dask scheduler answers at {address}; start one with `dask scheduler`, and "
                "workers with `dask worker ADDRESS`"
            ) from error
        workers = DaskWorkers(stack.enter_context(client), address)
        workers.check()
        yield workers


def _silence() -> None:
    """What goes wrong is told in one sentence, not in Dask's log."""
    for name in list(logging.root.manager.loggerDict):
        if name.split(".")[0] in _NOISY:
            logging.getLogger(name).setLevel(logging.CRITICAL)


@dataclass(frozen=True)
class _Work(Generic[A, T]):
    """What is done with every argument; sent once, and again to workers that come later.

    Attributes:
        task: as it was sent, for workers that come later.
        version: of femupdate.
    """

    task: Callable[[A], T]
    version: str

    @cached_property
    def used(self) -> Callable[[A], T]:
        """A copy of the task for the pieces on this worker; it shares the arrays of numpy.

        Pieces may leave in it what cannot be sent, such as a factorization. Were it passed on to
        another worker, Dask would wait for ever (dask/distributed#6705).
        """
        from distributed.protocol import deserialize, serialize

        copy: Callable[[A], T] = deserialize(*serialize(self.task, on_error="raise"))
        return copy

    def __reduce__(self) -> tuple[Any, ...]:
        """Without the copy."""
        return _Work, (self.task, self.version)


@dataclass(frozen=True)
class _Piece(Generic[A]):
    """One argument, which Dask need not look into."""

    argument: A


class DaskWorkers:
    """Workers of a Dask scheduler, which may die and come back.

    Args:
        client: of the scheduler.
        address: of it, for messages.
    """

    def __init__(self, client: Any, address: str) -> None:
        self._client, self._address = client, address

    def check(self) -> None:
        """Say so where there are no workers yet: the work waits for the first.

        Raises:
            WorkersError: one has no femupdate, or another. Given work that it cannot read, it would
                end, and the work wait for ever.
        """
        if not self._client.scheduler_info(n_workers=-1)["workers"]:
            logger.warning("%s has no workers yet; the work starts with the first", self._address)
        for worker, answer in self._client.run(_version, on_error="return").items():
            if answer == __version__ or isinstance(answer, OSError):  # the second has just died
                continue
            found = f"none ({answer})" if isinstance(answer, Exception) else answer
            raise WorkersError(
                f"here is femupdate {__version__}, and on the worker {worker} {found}; install "
                "the same everywhere"
            )

    def completed(self, task: Callable[[A], T], arguments: Sequence[A]) -> Iterator[tuple[int, T]]:
        """As `Workers` says.

        Raises:
            WorkersError: the scheduler is lost, or workers die again and again over one piece.
        """
        from distributed import as_completed

        # The scheduler keeps the work itself: a worker that dies takes no copy of it along that
        # could not be made again.
        work = self._client.submit(_kept, _Work(task, __version__), pure=False)
        places = {
            self._client.submit(_done, work, _Piece(one), pure=False): k
            for k, one in enumerate(arguments)
        }
        try:
            for future in as_completed(places, loop=self._client.loop):
                yield places[future], self._result(future)
                future.release()
        finally:
            self._client.cancel([work, *places], force=True)

    def _result(self, future: Any) -> Any:
        from distributed.scheduler import KilledWorker

        try:
            return future.result()
        except KilledWorker as error:
            raise WorkersError(
                f"workers of {self._address} died again and again over one piece of work; give "
                "each more memory, or fewer threads, and run the command again"
            ) from error
        except (CancelledError, OSError) as error:
            raise WorkersError(
                f"the Dask scheduler {self._address} was lost; what is done is kept, so start it "
                "and run the command again"
            ) from error
        except ImportError as error:
            raise WorkersError(
                f"a worker of {self._address} cannot do the work ({error}); install the same "
                "femupdate there as here"
            ) from error


def _version() -> str:
    return __version__


def _kept(work: _Work[A, T]) -> _Work[A, T]:
    return work


def _done(work: _Work[A, T], piece: _Piece[A]) -> T:
    """On a worker: one piece, with one thread of the numerical libraries as everywhere."""
    import torch
    from threadpoolctl import threadpool_limits

    if work.version != __version__:
        raise WorkersError(
            f"a worker has femupdate {__version__}, not {work.version}; install the same everywhere"
        )
    # For good: threads of one worker would give each other's numbers back.
    torch.set_num_threads(1)
    threadpool_limits(1)
    with working_on(OneByOne()):
        return work.used(piece.argument)
