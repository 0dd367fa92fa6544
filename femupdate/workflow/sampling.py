"""Independent runs of the sampler, with their progress, gone on with after a kill."""

import hashlib
import json
import shutil
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from femupdate.inference.bridge import Start, bridge
from femupdate.inference.parameters import Parameters
from femupdate.inference.sampler_run import Level, SamplerRun
from femupdate.inference.smc import SmcSettings, SmcState, TemperedSmc
from femupdate.inference.tempering import LogLikelihood, Points
from femupdate.progress import Percent, Progress
from femupdate.seeds import Seed, spawn
from femupdate.storage import read_arrays, write_arrays

FIRST, BRIDGE = 0, 1
"""Stages of a calibration, each with random streams of its own."""
_TENSORS = ("xi", "base", "target")
# Writing the state takes milliseconds; a run that takes seconds in all need not do it every level.
_SAVE_EVERY_S = 2.0


@dataclass(frozen=True)
class ChainRunner:
    """Runs a sampler several times and keeps what is done in a folder until all is stored.

    Attributes:
        particles: in all runs together.
        chains: number of runs.
        seed: of all of them.
        show: told about progress.
        folder: where the state of every chain is kept between levels.
        fingerprint: what the state belongs to; a state of anything else is not gone on from.
    """

    particles: int
    chains: int
    seed: Seed
    show: Progress
    folder: Path
    fingerprint: str

    @property
    def each(self) -> int:
        """Particles of one run."""
        return max(self.particles // self.chains, 50)

    def stage(self, number: int) -> Seed:
        """The stream of a stage, `FIRST` or `BRIDGE`."""
        return spawn(self.seed, number + 1)[number]

    def __call__(self, sampler: TemperedSmc, label: str) -> list[SamplerRun]:
        """Run all chains of one sampler, named by its label, from the prior."""
        self.show.start(label, 100 * self.chains)
        runs = []
        for chain, seed in enumerate(spawn(self.stage(FIRST), self.chains)):
            kept = _Kept(self.folder, json.dumps([self.fingerprint, label, chain]))
            teller = _Teller(self.show, kept)
            runs.append(sampler.run(self.each, seed, state=kept.load(), progress=teller))
        return runs

    def bridge(
        self,
        prior: Parameters,
        target: LogLikelihood,
        base: LogLikelihood | None,
        starts: list[SamplerRun],
        settings: SmcSettings,
    ) -> list[SamplerRun]:
        """Bring every chain from its base (None: the target itself) to precise target draws."""
        # Fitting the proposal usually takes three rounds of as many draws as there are particles.
        expected = 7 * sum(len(start.theta) for start in starts)
        self.show.start("Importance sampling (data-space likelihood)", expected)
        parts = zip(starts, spawn(self.stage(BRIDGE), len(starts)), strict=True)
        return [
            bridge(prior, target, Start(start, base), seed, settings=settings, progress=self.show)
            for start, seed in parts
        ]

    def clear(self) -> None:
        """Remove the folder: the posterior is stored."""
        shutil.rmtree(self.folder, ignore_errors=True)


@dataclass(frozen=True)
class _Kept:
    """The state of one chain on disk; `mark` says what it belongs to."""

    folder: Path
    mark: str

    @property
    def path(self) -> Path:
        return self.folder / f"{hashlib.sha256(self.mark.encode()).hexdigest()[:16]}.npz"

    def save(self, state: SmcState) -> None:
        arrays = {name: getattr(state.points, name).cpu().numpy() for name in _TENSORS}
        numbers = {
            "beta": state.beta,
            "tuning": state.tuning,
            "log_evidence": state.log_evidence,
            "evaluations": state.evaluations,
            "invalid": state.invalid,
            "levels": [asdict(level) for level in state.levels],
        }
        write_arrays(
            self.path,
            mark=np.array(self.mark),
            numbers=np.array(json.dumps(numbers)),
            random_state=state.random_state.cpu().numpy(),
            **arrays,
        )

    def load(self) -> SmcState | None:
        if not self.path.exists():
            return None
        try:
            data = read_arrays(self.path)
            return _state(data) if str(data["mark"]) == self.mark else None
        except (ValueError, KeyError, TypeError, RecursionError):
            return None  # a state that cannot be read only costs the time to draw it again


def _state(data: Mapping[str, NDArray[Any]]) -> SmcState:
    numbers = json.loads(str(data["numbers"]))
    return SmcState(
        points=Points(*(torch.from_numpy(data[name]) for name in _TENSORS)),
        beta=numbers["beta"],
        log_evidence=tuple(numbers["log_evidence"]),
        tuning=tuple(numbers["tuning"]),
        levels=tuple(_level(**level) for level in numbers["levels"]),
        evaluations=numbers["evaluations"],
        invalid=numbers["invalid"],
        random_state=torch.from_numpy(data["random_state"]),
    )


def _level(*, acceptance: list[float], **numbers: float) -> Level:
    return Level(acceptance=tuple(acceptance), **numbers)


class _Teller:
    """Moves the bar evenly in the logarithm of beta, and saves the state now and then."""

    def __init__(self, show: Progress, kept: _Kept) -> None:
        self._percent, self._kept = Percent(show), kept
        self._started = self._saved = time.monotonic()

    def __call__(self, state: SmcState) -> None:
        # beta runs from about 1e-5 to 1.
        done = 1.0 + np.log10(state.beta) / 5.0
        self._percent.reached(done, f"power {state.beta:.2g}")
        now = time.monotonic()
        last = state.done and now - self._started > _SAVE_EVERY_S
        if last or now - self._saved > _SAVE_EVERY_S:
            self._kept.save(state)
            self._saved = now
