"""Work on the machines of a Dask scheduler, or in processes of this one (extra `distributed`).

Dask sends objects of Python between the machines: whoever reaches the scheduler can run programs on
its workers. It belongs inside a network that is trusted.
"""

import contextlib
import logging
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from functools import lru_cache
from pickle import PickleBuffer
from queue import Empty, SimpleQueue
from typing import Any, TypeVar
from uuid import uuid4

from femupdate import __version__
from femupdate.errors import WorkersError
from femupdate.workers import OneByOne, processor_count, working_on

logger = logging.getLogger(__name__)

LOCAL = "local"
_CONNECT_S = 20.0
_LOOK_S = 10.0  # between two looks for workers while none finishes a piece
_DEATHS = 10  # of workers over one piece, after which the piece is to blame
_CONFIGURATION = {
    "distributed.scheduler.allowed-failures": _DEATHS,
    # A process that was killed comes back. On a busy machine its imports outlast Dask's 15 s,
    # after which it is given up for good.
    "distributed.deploy.lost-worker-timeout": "1 day",
    # Only local workers are given up, where none comes back at all: an address keeps its own.
    "distributed.scheduler.no-workers-timeout": "5 minutes",
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
        WorkersError: Dask is not installed, no scheduler answers, or a process does not start.
    """
    try:
        import dask
        from distributed import Client
    except ImportError as error:
        raise WorkersError(
            'Dask is not installed; pip install "femupdate[distributed]", or leave --dask out'
        ) from error
    _silence()
    with contextlib.ExitStack() as stack:
        stack.enter_context(dask.config.set(_CONFIGURATION))
        if address == LOCAL:
            target: Any = stack.enter_context(_local_cluster())
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


def _silence() -> None:
    """What goes wrong is told in one sentence, not in Dask's log."""
    for name in list(logging.root.manager.loggerDict):
        if name.split(".")[0] in _NOISY:
            logging.getLogger(name).setLevel(logging.CRITICAL)


@dataclass(frozen=True)
class _Work:
    """What is done with every argument, as bytes: sent once, and again to workers that come later.

    Attributes:
        name: of its own.
        frames: the task as Dask pickles it, and the buffers of its arrays.
    """

    name: str
    frames: Sequence[Any] = field(compare=False)

    @classmethod
    def of(cls, task: Callable[[Any], Any]) -> "_Work":
        """The work of a task."""
        from distributed.protocol.pickle import dumps

        buffers: list[PickleBuffer] = []
        pickled = dumps(task, buffer_callback=buffers.append)
        return cls(uuid4().hex, [pickled, *(one.raw() for one in buffers)])


@dataclass(frozen=True)
class _Sent:
    """A buffer on its way out, which need not be copied here; a bytearray where it arrives."""

    buffer: bytes | memoryview

    def __reduce__(self) -> tuple[Any, ...]:
        return bytearray, (PickleBuffer(self.buffer),)


@dataclass(frozen=True)
class _Piece:
    """One argument. Unpickled where the work is, a piece becomes its result.

    What Dask passes on is bytes, and the work begins by unpickling them. Dask cannot read an object
    of femupdate on a worker without femupdate: the worker would end, and Dask wait for ever. So
    the task of that worker fails instead, with an error that comes back.

    Attributes:
        argument: pickled.
    """

    work: _Work
    argument: bytes

    def __reduce__(self) -> tuple[Any, ...]:
        """Without the bytes of the work, which every piece has beside it."""
        frames = [PickleBuffer(one) for one in self.work.frames]
        return _done, (__version__, self.work.name, frames, self.argument)


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
        if self._alone():
            logger.warning("%s has no workers yet; the work starts with the first", self._address)
        for worker, answer in self._client.run(_version, on_error="return").items():
            if answer == __version__ or isinstance(answer, OSError):  # the second has just died
                continue
            found = f"none ({answer})" if isinstance(answer, Exception) else answer
            raise _another(__version__, worker, found)

    def completed(self, task: Callable[[A], T], arguments: Sequence[A]) -> Iterator[tuple[int, T]]:
        """As `Workers` says.

        Raises:
            WorkersError: the scheduler is lost, or workers die again and again over one piece.
        """
        from distributed.protocol.pickle import dumps, loads

        work = _Work.of(task)
        # The scheduler keeps the work itself: a worker that dies takes no copy of it along that
        # could not be made again.
        frames = self._client.submit(list, [_Sent(one) for one in work.frames], pure=False)
        places = {}
        for k, one in enumerate(arguments):
            piece = dumps(_Piece(work, dumps(one)), buffer_callback=_beside)
            places[self._client.submit(loads, piece, buffers=frames, pure=False)] = k
        try:
            for future in self._ended(places):
                yield places[future], self._result(future)
                future.release()
        finally:
            self._client.cancel([frames, *places], force=True)

    def _ended(self, futures: Collection[Any]) -> Iterator[Any]:
        """In the order in which they end. Says so where the last worker has gone."""
        ended: SimpleQueue[Any] = SimpleQueue()
        for future in futures:
            future.add_done_callback(ended.put)
        left, told = len(futures), False
        while left:
            try:
                yield ended.get(timeout=_LOOK_S)
                left -= 1
            except Empty:
                alone = self._alone()
                if alone and not told:
                    logger.warning(
                        "%s has no workers left; the work goes on with the next", self._address
                    )
                told = alone

    def _alone(self) -> bool:
        return not self._client.scheduler_info(n_workers=-1)["workers"]

    def _result(self, future: Any) -> Any:
        from distributed.scheduler import KilledWorker, NoValidWorkerError, NoWorkerError

        try:
            return future.result()
        except KilledWorker as error:
            raise WorkersError(
                f"workers of {self._address} died again and again over one piece of work; give "
                "each more memory, or fewer threads, and run the command again"
            ) from error
        except (NoValidWorkerError, NoWorkerError) as error:
            raise WorkersError(
                f"all workers of {self._address} ended and none came back; what is done is kept, "
                "so run the command again"
            ) from error
        except (CancelledError, OSError) as error:
            raise WorkersError(
                f"the Dask scheduler {self._address} was lost; what is done is kept, so start it "
                "and run the command again"
            ) from error
        except ImportError as error:
            self.check()  # names the worker, while it is there
            raise WorkersError(
                f"a worker of {self._address} cannot do the work ({error}); install the same "
                "femupdate there as here"
            ) from error


def _another(here: str, worker: str, there: str) -> WorkersError:
    return WorkersError(
        f"here is femupdate {here}, and on the worker {worker} {there}; install the same everywhere"
    )


def _version() -> str:
    return __version__


def _beside(_: PickleBuffer) -> None:
    """Buffers are not pickled but passed beside."""


@lru_cache(maxsize=1)
def _task(work: _Work) -> Callable[[Any], Any]:
    """On a worker: a copy for all pieces; it shares the arrays of numpy with the bytes.

    Pieces may leave in it what cannot be sent, such as a factorization. Were it passed on to
    another worker, Dask would wait for ever (dask/distributed#6705); bytes always can be.
    """
    from distributed.protocol.pickle import loads

    task: Callable[[Any], Any] = loads(work.frames[0], buffers=work.frames[1:])
    return task


def _done(version: str, name: str, frames: Sequence[Any], argument: bytes) -> Any:
    """On a worker: one piece, with one thread of the numerical libraries as everywhere.

    Name and first argument stay as they are, so that other versions can tell.
    """
    import torch
    from distributed import get_worker
    from distributed.protocol.pickle import loads
    from threadpoolctl import threadpool_limits

    if version != __version__:
        raise _another(version, get_worker().address, __version__)
    # For good: threads of one worker would give each other's numbers back.
    torch.set_num_threads(1)
    threadpool_limits(1)
    with working_on(OneByOne()):
        return _task(_Work(name, frames))(loads(argument))
