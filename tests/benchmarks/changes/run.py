"""Pairs of simulated states, calibrated apart and compared."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from femupdate.arrays import Floats
from femupdate.building import load_building
from femupdate.simulation import SimulationSettings, simulate_observation, write_simulation
from femupdate.study import Study
from femupdate.workflow import (
    CalibrationSettings,
    ObservationSource,
    calibrate_study,
    compare_states,
    open_state,
    open_study,
)
from femupdate.workflow.compare import CompareReport, State

from ..result import Job, Report, markdown_table

BUILDING = "shear_4dof"
STORY, SOFTER = 1, 0.9
_LACKS = (("added_mass@3F", (0.1,)),)
Effects = tuple[tuple[str, tuple[float, ...]], ...]
MODELS: dict[str, Effects] = {"right": (), "lacks a tenth of a floor's mass": _LACKS}
_STATES = ("before", "unchanged", "softened")
_PARTICLES = 400


@dataclass(frozen=True, kw_only=True)
class Compared:
    """What `compare` said of one pair."""

    model: str  # "right", or what it lacks
    state: str  # "unchanged" or "softened", beside the state before
    verdict: str  # "changed", "unchanged" or "unclear"
    named: tuple[str, ...]  # names of the stories that were named
    probability: float  # that story 2 changed
    change: float  # of story 2, as a ratio less one

    @property
    def right(self) -> bool:
        """Exactly what was changed is named, or that nothing was changed is said."""
        if self.state == "unchanged":
            return self.verdict == "unchanged"
        return self.named == (f"theta_{STORY + 1}",)

    @property
    def false_alarm(self) -> bool:
        """A story is named that did not change."""
        allowed = {f"theta_{STORY + 1}"} if self.state == "softened" else set()
        return bool(set(self.named) - allowed)


def run_changes(job: Job, pairs: int, models: Mapping[str, Effects] = MODELS) -> Report:
    """Simulate, calibrate and compare all pairs."""
    job.progress.start("Comparing states", pairs * len(models) * len(_STATES))
    found = []
    for model, effects in models.items():
        for number, rng in enumerate(np.random.default_rng(job.seed).spawn(pairs)):
            theta = rng.uniform(0.7, 1.4, 4)
            with TemporaryDirectory() as name:
                states = [
                    _state(job, Study(Path(name), state), theta, 3 * number + k, effects)
                    for k, state in enumerate(_STATES)
                ]
                found += [
                    _compared(model, after.name, compare_states(states[0], after))
                    for after in states[1:]
                ]
    return _report(job, found)


def _state(job: Job, study: Study, theta: Floats, seed: int, effects: Effects) -> State:
    """Measure and calibrate a building; its state is the name of the posterior."""
    now = theta * np.where(np.arange(len(theta)) == STORY, SOFTER, 1.0)
    settings = SimulationSettings(
        theta=tuple((now if study.posterior == "softened" else theta).tolist()),
        duration_s=120.0,
        sampling_hz=100.0,
        band_hz=(0.3, 30.0),
        sensor_noise_m_s2=0.01,
        effects=effects,
        seed=1000 * job.seed + seed,
    )
    simulation = simulate_observation(load_building(BUILDING), settings)
    path = write_simulation(simulation, study.path(f"{study.posterior}.csv")).observation
    chosen = CalibrationSettings(particles=_PARTICLES, chains=1, exact=True, seed=seed)
    calibrate_study(study, open_study(study, BUILDING), ObservationSource(path), chosen)
    job.progress.advance()
    return open_state(study, study.posterior)


def _compared(model: str, state: str, report: CompareReport) -> Compared:
    answer = report.as_dict()["changes"]
    return Compared(
        model=model,
        state=state,
        verdict=report.verdict,
        named=report.named,
        probability=answer[STORY]["probability"],
        change=answer[STORY]["change"],
    )


def _report(job: Job, found: list[Compared]) -> Report:
    rows, answer = [], {}
    for model in dict.fromkeys(pair.model for pair in found):
        for state in _STATES[1:]:
            own = [one for one in found if (one.model, one.state) == (model, state)]
            verdicts = Counter(one.verdict for one in own)
            alarms, right = (sum(k) for k in ([o.false_alarm for o in own], [o.right for o in own]))
            size = 100.0 * np.array([one.change for one in own])
            answer[f"{model}: {state}"] = {
                "pairs": len(own),
                "right": right,
                "false_alarms": alarms,
                "unclear": verdicts["unclear"],
            }
            told = f"{size.mean():+.2f} % ± {size.std():.2f} %" if state == "softened" else ""
            rows.append(
                [
                    model,
                    "nothing" if state == "unchanged" else "story 2 by -10 %",
                    *(str(value) for value in answer[f"{model}: {state}"].values()),
                    told,
                ]
            )
    head = ["model", "changed", "pairs", "right", "false alarms", "unclear", "change found"]
    text = (
        f"{markdown_table(head, rows)}\n\n"
        "Right: exactly story 2 is named, or it is said that nothing changed. "
        "False alarm: a story is named that did not change.\n"
    )
    content = {"building": BUILDING, "pairs": [asdict(one) for one in found]}
    return job.write("changes", content, text, answer=answer)
