"""Two trainings side by side: in turns, in one process, judged by one loss."""

import logging
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import torch
from torch import Tensor

logger = logging.getLogger(__name__)

# Every stretch of training is so much longer than all before it together, until it is a slice.
_GROWTH = 0.25
_ROWS = 250


@dataclass(frozen=True)
class HeldOut:
    """What emulators of the roof's FRF are judged on.

    Attributes:
        theta: (n, p).
        log_frf: ln|H| (n, k) of the roof without noise.
        noise_sd: standard deviation of the noise that an observation carries.
    """

    theta: Tensor
    log_frf: Tensor
    noise_sd: float

    @property
    def limit(self) -> float:
        """The loss of a perfect emulator: the entropy of the noise, nats a sample."""
        nats = 0.5 + math.log(self.noise_sd) + 0.5 * math.log(2.0 * math.pi)
        return self.log_frf.shape[1] * nats


# Mean and variance (n, k) of the noisy ln|H| of the roof at theta (n, p).
Emulator = Callable[[Tensor], tuple[Tensor, Tensor]]


@dataclass(frozen=True)
class Point:
    """A training looked at.

    Attributes:
        cpu_seconds, clock_seconds: of training alone, until then.
        steps: of the optimiser, until then.
        loss: -ln p(x'|theta), nats a sample.
        rms: error of the mean in ln|H|.
    """

    cpu_seconds: float
    clock_seconds: float
    steps: int
    loss: float
    rms: float


@dataclass
class Runner:
    """One of the two trainings.

    Attributes:
        name: of it.
        training: stops after each step; all that comes before the first is done.
        emulator: what it has trained so far.
        points: where it was looked at.
    """

    name: str
    training: Iterator[object]
    emulator: Emulator
    points: list[Point] = field(default_factory=list)
    _cpu: float = 0.0
    _clock: float = 0.0
    _steps: int = 0

    def run_to(self, cpu_seconds: float) -> None:
        """Train until so much processor time has gone into it, or to its end."""
        cpu, clock = time.process_time() - self._cpu, time.perf_counter() - self._clock
        while time.process_time() - cpu < cpu_seconds:
            if next(self.training, None) is None:
                break
            self._steps += 1
        self._cpu, self._clock = time.process_time() - cpu, time.perf_counter() - clock

    def look(self, held_out: HeldOut) -> Point:
        """Judge what it has become."""
        loss, rms = score(self.emulator, held_out)
        self.points.append(Point(self._cpu, self._clock, self._steps, loss, rms))
        return self.points[-1]


def race(
    runners: Sequence[Runner],
    held_out: HeldOut,
    ends: Sequence[float],
    tell: Callable[[str], None],
) -> None:
    """Train all in turns until each has had its processor time.

    Whatever else the machine does falls on all alike. An interrupt (Ctrl-C) ends the race early.

    Args:
        runners: whose points are filled.
        held_out: they are judged on, outside the time that counts.
        ends: of the turns, s of the processor, see `turn_ends`.
        tell: called after every turn with a note.
    """
    for runner in runners:
        runner.look(held_out)
    try:
        for end in ends:
            for runner in runners:
                runner.run_to(end)
                tell(f"{runner.name}, loss {runner.look(held_out).loss:.1f}")
    except KeyboardInterrupt:
        logger.warning("interrupted: the results are those of the time until now")


def turn_ends(seconds: float, longest: float) -> list[float]:
    """Processor times at which turns end, up to `seconds`: at first close together.

    So the beginning of the curves is seen; later turns are `longest` apart.
    """
    ends = [min(1.0, seconds)]
    while ends[-1] < seconds:
        ends.append(min(seconds, ends[-1] + min(longest, max(1.0, _GROWTH * ends[-1]))))
    return ends


def score(emulator: Emulator, held_out: HeldOut) -> tuple[float, float]:
    """Loss and rms error of an emulator.

    The loss is the mean over samples of -ln N(x'; mean, variance), summed over the points, for x'
    with noise; its expectation over that noise is known and stands for a draw.
    """
    nats, squares = 0.0, 0.0
    with torch.no_grad():
        pairs = zip(held_out.theta.split(_ROWS), held_out.log_frf.split(_ROWS), strict=True)
        for theta, log_frf in pairs:
            mean, variance = emulator(theta)
            square = (log_frf.float() - mean) ** 2
            expected = (square + held_out.noise_sd**2) / variance
            nats += 0.5 * float((expected + torch.log(2.0 * math.pi * variance)).sum())
            squares += float(square.sum())
    return nats / len(held_out.theta), math.sqrt(squares / held_out.log_frf.numel())


def first_to(points: Sequence[Point], loss: float) -> Point | None:
    """Where a training, once begun, first had this loss or a lower one."""
    return next((point for point in points if point.steps and point.loss <= loss), None)
