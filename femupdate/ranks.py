"""Processes that train together, as torch's own launcher (torchrun) starts them.

They send each other objects of Python: whoever reaches their port can run programs in them. They
belong inside a network that is trusted.
"""

import contextlib
import os
import signal
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import TYPE_CHECKING, Any, TypeVar

from femupdate.errors import WorkersError

if TYPE_CHECKING:
    from torch import Tensor

T = TypeVar("T")

_NAMES = ("RANK", "WORLD_SIZE", "LOCAL_RANK", "LOCAL_WORLD_SIZE", "MASTER_ADDR", "MASTER_PORT")
# The others wait while the first makes a data set. A process that is lost is noticed at once, by
# its connection and by the launcher.
_PATIENCE = timedelta(days=30)
_LOOK_S = 1.0  # between two looks at whether the launcher is still there
_LOST = (
    "a process of this training was lost, or torchrun was stopped; run the same command again, "
    "which goes on from the last whole epoch"
)


@dataclass(frozen=True)
class Launch:
    """What the launcher says of this process.

    Attributes:
        number: of this process, from 0.
        count: of all processes.
        place: number of this process on its machine.
        neighbours: processes on its machine.
    """

    number: int = 0
    count: int = 1
    place: int = 0
    neighbours: int = 1


def launched(environment: Mapping[str, str] = os.environ) -> Launch | None:
    """What torchrun says of this process, or None where it did not start it."""
    said = [environment.get(name, "") for name in _NAMES]
    if not all(said) or not all(word.isdecimal() for word in said[:4]):
        return None
    return Launch(*map(int, said[:4]))


class Ranks:
    """One process by itself.

    Attributes:
        number: of this process, from 0; the first alone reads, writes and decides.
        count: of all processes.
        device: where this one computes.
    """

    number = 0
    count = 1
    device = "cpu"

    def shared(self, value: T) -> T:
        """What the first process has here, on all of them.

        Args:
            value: of the first; any on the others.

        Raises:
            WorkersError: a process was lost.
        """
        return value

    def add_up(self, values: Sequence["Tensor"]) -> None:
        """Replace each of these by its sum over all processes.

        Raises:
            WorkersError: a process was lost.
        """


ALONE = Ranks()


class _Together(Ranks):
    """One of several processes.

    Args:
        launch: what the launcher says of it.
    """

    def __init__(self, launch: Launch) -> None:
        import torch
        from torch import distributed

        self.number, self.count = launch.number, launch.count
        # Objects are sent between processors. Only the gradients go from one GPU to the other.
        with _heard():
            distributed.init_process_group("gloo", timeout=_PATIENCE)
            able = torch.tensor(torch.cuda.device_count() >= launch.neighbours, dtype=torch.int32)
            distributed.all_reduce(able, distributed.ReduceOp.MIN)
            self._group: Any = None
            if able:
                self.device = f"cuda:{launch.place}"
                torch.cuda.set_device(self.device)
                self._group = distributed.new_group(backend="nccl")

    def shared(self, value: T) -> T:
        from torch import distributed

        box = [value]
        with _heard():
            distributed.broadcast_object_list(box, src=0)
        return box[0]

    def add_up(self, values: Sequence["Tensor"]) -> None:
        import torch
        from torch import distributed

        flat = torch.cat([value.flatten() for value in values])
        with _heard():
            distributed.all_reduce(flat, group=self._group)
        parts = flat.split([value.numel() for value in values])
        for value, part in zip(values, parts, strict=True):
            value.copy_(part.view_as(value))


@contextlib.contextmanager
def _heard() -> Iterator[None]:
    """Turn torch's many errors of a connection into one."""
    try:
        yield
    except (RuntimeError, ValueError) as error:
        raise WorkersError(_LOST) from error


@contextlib.contextmanager
def together(launch: Launch | None) -> Iterator[Ranks]:
    """The processes of a launch, joined for as long as they are used; this one alone for None.

    A process ends with its launcher, even one that was killed.

    Raises:
        WorkersError: a process was lost, or the launcher ends them all.
    """
    if launch is None:
        yield ALONE
        return
    from torch import distributed

    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
    # The first one can then still say what is to be done.
    before = signal.signal(signal.SIGTERM, _stopped) if launch.number == 0 else None
    try:
        yield _Together(launch)
        # After an error the others learn of it by the end of this process.
        distributed.destroy_process_group()
    finally:
        if before is not None:
            signal.signal(signal.SIGTERM, before)


def _stopped(*_: object) -> None:
    raise WorkersError(_LOST)


def _end_with(parent: int) -> None:
    """End this process when its parent has ended."""
    while os.getppid() == parent:
        time.sleep(_LOOK_S)
    os._exit(1)
