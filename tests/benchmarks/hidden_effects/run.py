"""The trials of the effect finder, counted: false alarms, detection, names, sizes, gaps closed."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed, parallel_config

from femupdate.building.files import load_building
from femupdate.processors import processor_count
from femupdate.progress import Progress, Silent
from femupdate.study import Study
from femupdate.workflow.model import StudyModel, open_study

from ..machine import Machine, this_machine
from ..result import ResultFiles, write_result
from .cases import (
    CLEAN,
    FOREIGN,
    ONE,
    TWO,
    KeptModels,
    Outcome,
    Trial,
    TrialSettings,
    kept_models,
    run_trial,
)
from .log import TrialLog
from .summary import Row, summary, summary_text


@dataclass(frozen=True)
class Plan:
    """How many trials of each kind."""

    clean: int = 100
    one: int = 150
    two: int = 30
    outside: int = 30

    def trials(self, seed: int) -> list[Trial]:
        """All trials, the kinds mixed evenly, so that a part of them is a smaller plan.

        The seeds of two plans with different seeds never meet.
        """
        counts = ((CLEAN, self.clean), (ONE, self.one), (TWO, self.two), (FOREIGN, self.outside))
        first = 100_000 * seed
        ranked = [
            ((k + 0.5) / count, Trial(first + k, kind))
            for kind, count in counts
            for k in range(count)
        ]
        return [trial for _, trial in sorted(ranked, key=lambda one: one[0])]


QUICK = Plan(clean=4, one=6, two=1, outside=1)


@dataclass(frozen=True)
class HiddenReport:
    """Outcomes and their summary."""

    machine: Machine
    outcomes: tuple[Outcome, ...]
    rows: tuple[Row, ...]
    text: str
    files: ResultFiles


def run_hidden_effects(
    output: Path,
    building: str,
    plan: Plan,
    settings: TrialSettings,
    seed: int = 1,
    progress: Progress | None = None,
    study: Study | None = None,
    minutes: float = np.inf,
) -> HiddenReport:
    """Run the trials on all processors and write the result.

    Every outcome is written at once (`TrialLog`); trials whose outcomes are there are not run
    again.

    Args:
        output: folder of the result files.
        building: shipped name or path.
        plan: how many trials.
        settings: of the measurement.
        seed: of all trials.
        progress: told about every trial.
        study: where the reduced model is kept; by default a folder in the output.
        minutes: after which no further trial is started.
    """
    show = progress or Silent()
    chosen = load_building(building)
    own = study or Study(output / f"study_{chosen.name}")
    model = open_study(own, building, show)
    name = f"hidden_effects_{chosen.name}{'' if settings.use_phase else '_amplitude'}"
    trials, log = plan.trials(seed), TrialLog(output / f"{name}.jsonl", model.hash, settings)
    done = {trial: one for trial, one in log.read().items() if trial in trials}
    log.start(done)
    left = [trial for trial in trials if trial not in done]
    show.start("Hidden-effect trials", len(left))
    deadline = time.monotonic() + 60.0 * minutes
    kept = kept_models(own, model, settings, show) if left else None
    for outcome in _run(left, model, settings, kept, deadline):
        done[Trial(outcome.number, outcome.kind)] = outcome
        log.add(outcome)
        show.advance(1, f"{outcome.verdict}")
    outcomes = [done[trial] for trial in trials if trial in done]
    rows = summary(outcomes)
    machine = this_machine()
    text = summary_text(chosen.name, settings, outcomes, rows)
    content = {"building": chosen.name, "settings": settings, "rows": rows, "outcomes": outcomes}
    files = write_result(output, name, machine, seed, content, text)
    return HiddenReport(machine, tuple(outcomes), tuple(rows), text, files)


def _run(
    trials: Sequence[Trial],
    model: StudyModel,
    settings: TrialSettings,
    kept: KeptModels | None,
    deadline: float,
) -> Iterator[Outcome]:
    """Outcomes, in order, until a time of the monotonic clock (s)."""
    # The models of a frame are too large to be sent with every trial.
    workers = 1 if model.building.kind == "frame" else processor_count()
    in_time = (trial for trial in trials if time.monotonic() < deadline)
    with parallel_config("loky", inner_max_num_threads=1):
        pool = Parallel(n_jobs=workers, return_as="generator", batch_size=1, pre_dispatch=workers)
        yield from pool(delayed(run_trial)(trial, model, settings, kept) for trial in in_time)
