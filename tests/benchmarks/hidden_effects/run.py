"""The trials of the effect finder, counted: false alarms, detection, names, sizes, gaps closed."""

from dataclasses import dataclass
from functools import partial

from femupdate.building import load_building
from femupdate.study import Study
from femupdate.workers import completed
from femupdate.workflow import open_study

from ..log import ResumableLog
from ..result import Job, Report
from .draw import CLEAN, ONE, OUTSIDE, TWO
from .kinds import BASE
from .measurement import TrialSettings
from .summary import summary, summary_text
from .trial import Outcome, Trial, run_trial, trial_models


@dataclass(frozen=True)
class TrialPlan:
    """How many trials of each kind."""

    clean: int = 100
    one: int = 150
    two: int = 30
    outside: int = 30

    def trials(self, seed: int) -> list[Trial]:
        """All trials, the kinds mixed evenly, so that a part of them is a smaller plan.

        The seeds of two plans with different seeds never meet.
        """
        counts = ((CLEAN, self.clean), (ONE, self.one), (TWO, self.two), (OUTSIDE, self.outside))
        first = 100_000 * seed
        ranked = [
            ((k + 0.5) / count, Trial(first + k, kind))
            for kind, count in counts
            for k in range(count)
        ]
        return [trial for _, trial in sorted(ranked, key=lambda one: one[0])]


QUICK = TrialPlan(clean=4, one=6, two=1, outside=1)


def run_hidden_effects(
    job: Job,
    building: str,
    plan: TrialPlan,
    settings: TrialSettings | None = None,
    data: str = BASE,
) -> Report:
    """Run the trials wherever work is done and write the result.

    Every outcome is written at once; trials whose outcomes are there are not run again. The reduced
    model is kept in the folder as well.
    """
    settings, name = settings or TrialSettings(), load_building(building).name
    study = Study(job.folder / f"study_{name}")
    model = open_study(study, building, job.progress)
    files = f"hidden_effects_{name}" + ("" if data == BASE else f"_{data}")
    header = {"building": model.hash, "settings": settings}
    log = ResumableLog(job.folder / f"{files}.jsonl", header)
    trials = plan.trials(job.seed)
    left = [trial for trial in trials if log.get(_key(trial), Outcome) is None]
    if left:
        models = trial_models(study, model, settings, job.progress, data)
        job.progress.start("Hidden-effect trials", len(left))
        for _, outcome in completed(partial(run_trial, models=models), left):
            log.add(_key(outcome), outcome)
            job.progress.advance(1, outcome.verdict)
    known = (log.get(_key(trial), Outcome) for trial in trials)
    outcomes = [outcome for outcome in known if outcome is not None]
    rows = summary(outcomes)
    return job.write(
        files,
        {"building": name, "data": data, "settings": settings, "rows": rows, "outcomes": outcomes},
        summary_text(name, settings, rows, data),
        answer={"rows": [{"what": r.what, "found": r.found, "cases": r.of} for r in rows]},
    )


def _key(trial: Trial | Outcome) -> str:
    return f"{trial.kind} {trial.number}"
