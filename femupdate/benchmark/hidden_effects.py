"""The trials of the effect finder, counted: false alarms, detection, names, sizes, gaps closed."""

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed, parallel_config
from numpy.typing import NDArray

from femupdate.benchmark.hidden_cases import (
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
from femupdate.benchmark.machine import Machine, this_machine
from femupdate.benchmark.result import ResultFiles, markdown_table, write_result
from femupdate.benchmark.trial_log import TrialLog
from femupdate.building.files import load_building
from femupdate.processors import processor_count
from femupdate.study import Study
from femupdate.workflow.model import StudyModel, open_study
from femupdate.workflow.progress import Progress, Silent

Floats = NDArray[np.float64]
_SEEN = 0.99  # absorbed beyond this an effect is theta itself


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
class Row:
    """One line of the summary."""

    what: str
    first: str
    goal: str
    found: str
    of: int


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
    text = _text(chosen.name, settings, outcomes, rows)
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


def summary(outcomes: Sequence[Outcome]) -> list[Row]:
    """The table of the targets."""
    clean = [o for o in outcomes if o.kind == CLEAN]
    one = [o for o in outcomes if o.kind == ONE]
    visible = [o for o in one if o.absorbed < _SEEN]
    strong = [o for o in visible if o.strength >= 5.0]
    clear = [o for o in visible if o.strength >= 6.0]
    unseen = [o for o in one if o.absorbed >= _SEEN]
    foreign = [o for o in outcomes if o.kind == FOREIGN and o.p_value < 1e-6]
    right = [o for o in clear if o.verdict == "named" and o.named == o.hidden[0]]

    def named_right(o: Outcome) -> bool:
        return o.named == o.hidden[0]

    def first_three(o: Outcome) -> bool:
        return o.hidden[0] in o.ranking[:3]

    share = _share
    return [
        Row("false alarms on clean cases", "<= 7 %", "<= 5 %", *share(clean, _alarm)),
        Row("detected, D >= 5", ">= 90 %", ">= 97 %", *share(strong, _alarm)),
        Row(
            "first name and place right, D >= 6",
            ">= 80 to 90 %",
            ">= 90 to 97 %",
            *share(clear, named_right),
        ),
        Row("among the first three, D >= 5", ">= 95 %", ">= 98 %", *share(strong, first_three)),
        Row(
            "what theta absorbs is not named",
            ">= 90 %",
            "100 %",
            *share(unseen, lambda o: o.verdict != "named" or named_right(o)),
        ),
        Row(
            "outside the catalogue: unknown or ambiguous",
            ">= 70 %",
            ">= 90 %",
            *share(foreign, lambda o: o.verdict in ("unknown", "ambiguous", "indistinguishable")),
        ),
        Row(
            "excess chi2 removed (median)",
            ">= 85 %",
            ">= 95 %",
            *_median(right, [o.excess_removed for o in right], "%"),
        ),
        Row(
            "excess held-out error removed (median)",
            ">= 50 %",
            ">= 80 %",
            *_median(right, [_held(o) for o in right], "%"),
        ),
        Row(
            "theta bias after, posterior sd (median)",
            "<= 2",
            "<= 1",
            *_median(right, [o.bias_after for o in right], ""),
        ),
        Row(
            "theta bias before, relative (median)",
            "",
            "",
            *_median(right, [o.bias_share_before for o in right], "%"),
        ),
        Row(
            "theta bias after, relative (median)",
            "",
            "",
            *_median(right, [o.bias_share_after for o in right], "%"),
        ),
        Row(
            "size within 2 sd",
            "",
            "95 %",
            *share(
                [o for o in right if np.isfinite(o.size_true)],  # an exchange has none
                lambda o: abs(o.size - o.size_true) <= 2.0 * o.size_sd,
            ),
        ),
        Row(
            "seconds a case (median)",
            "<= 60",
            "<= 10",
            *_median(outcomes, [o.seconds for o in outcomes], ""),
        ),
    ]


def _alarm(outcome: Outcome) -> bool:
    return outcome.verdict != "none"


def _held(outcome: Outcome) -> float:
    """Share of the error beyond what remains when all is right that was removed."""
    excess = outcome.held_before - outcome.held_floor
    return (outcome.held_before - outcome.held_after) / max(excess, 1e-9)


def _share(cases: Sequence[Outcome], good: Callable[[Outcome], bool]) -> tuple[str, int]:
    if not cases:
        return "-", 0
    hits = sum(map(good, cases))
    p = hits / len(cases)
    error = np.sqrt(max(p * (1.0 - p), 0.25 / len(cases)) / len(cases))
    return f"{p:.1%} +- {error:.1%}", len(cases)


def _median(cases: Sequence[Outcome], values: list[float], unit: str) -> tuple[str, int]:
    finite = [v for v in values if np.isfinite(v)]
    if not finite:
        return "-", 0
    middle = float(np.median(finite))
    return (f"{middle:.1%}" if unit == "%" else f"{middle:.2f}"), len(finite)


def _text(
    building: str, settings: TrialSettings, outcomes: Sequence[Outcome], rows: Sequence[Row]
) -> str:
    table = markdown_table(
        ("", "first", "goal", "found", "cases"),
        [(r.what, r.first, r.goal, r.found, str(r.of)) for r in rows],
    )
    compared = "amplitude and phase" if settings.use_phase else "amplitude alone"
    return (
        f"Building {building}, {settings.duration_s:g} s at {settings.sampling_hz:g} Hz, sensor "
        f"noise {settings.sensor_noise_m_s2:g} m/s2, {compared}.\n\n{table}\n\n"
        f"What was hidden (rows, D >= 6) and what was named:\n\n{_confusion(outcomes)}\n"
    )


def _confusion(outcomes: Sequence[Outcome]) -> str:
    """Named right, right effect at another place, other effect, not named, by hidden effect."""
    head = ("hidden", "right", "other place", "other effect", "not named", "which")
    rows = []
    clear = [o for o in outcomes if o.kind == ONE and o.strength >= 6.0]
    for effect in sorted({_effect(o.hidden[0]) for o in clear}):
        own = [o for o in clear if _effect(o.hidden[0]) == effect]
        right = sum(o.named == o.hidden[0] for o in own)
        place = sum(o.named != o.hidden[0] and _effect(o.named) == effect for o in own)
        missed = sum(not o.named for o in own)
        wrong = Counter(_effect(o.named) for o in own if o.named and _effect(o.named) != effect)
        listed = ", ".join(f"{name} {count}" for name, count in wrong.most_common(3))
        counts = (right, place, sum(wrong.values()), missed)
        rows.append((effect, *map(str, counts), listed))
    return markdown_table(head, rows)


def _effect(label: str) -> str:
    return label.split("@")[0]
