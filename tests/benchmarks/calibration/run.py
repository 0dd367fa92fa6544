"""The benchmark `calibration`: coverage, ranks and TARP over simulated buildings."""

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from femupdate.building import load_building
from femupdate.progress import SILENT, Progress
from femupdate.study import Study
from femupdate.surrogate import Surrogate
from femupdate.surrogate.storage import ANY_FLOORS
from femupdate.workflow import StudyModel, open_study

from ..log import ResumableLog
from ..result import Job, Report
from ..shipped import benchmark_model, shipped_surrogate, surrogate_mark
from .cases import CalibrationCase, CaseSettings, calibration_case
from .coverage_power import fit_power
from .tables import calibration_text, scores

NAME = "calibration"


@dataclass(frozen=True, kw_only=True)
class CalibrationPlan:
    """What is simulated."""

    building: str = "shear_4dof"  # shipped name
    # Observed; the roof alone where empty; `ANY_FLOORS` alone for random sets
    floors: tuple[str, ...] = ()
    cases: int = 200  # simulated buildings
    particles: int = 1000  # of each posterior
    # The first so many cases also get the data-space posterior; all where None
    beside: int | None = None
    power: float | None = None  # of the latent likelihood; default the surrogate's own
    noise_sd: float | None = None  # of ln|H|; default that of the surrogate's training

    def of_cases(self, model: StudyModel, seed: int) -> CaseSettings:
        """What is made of every case."""
        beside = self.cases if self.beside is None else self.beside
        floors = self.floors or (model.building.floors[-1],)
        return CaseSettings(
            floors=floors,
            particles=self.particles,
            beside=beside,
            power=self.power,
            seed=seed,
            noise_sd=self.noise_sd,
        )


def run_calibration(job: Job, plan: CalibrationPlan) -> Report:
    """Run the benchmark and write its results.

    Every case is written when it is done, beside the results; a run that was cut off goes on, and
    one with more cases adds to them. The reduced model of a frame is kept in the folder as well.
    """
    surrogate = shipped_surrogate(load_building(plan.building))
    model = _model(job.folder, plan.building, job.progress)
    name = f"{NAME}_{plan.building}_{'_'.join(plan.floors) or 'roof'}"
    if plan.noise_sd is not None:
        name += f"_noise_{plan.noise_sd:g}"
    settings = plan.of_cases(model, job.seed)
    header = [model.hash, surrogate_mark(surrogate), replace(settings, beside=0)]
    log = ResumableLog(job.folder / f"{name}_cases.jsonl", header)
    cases = _cases(model, surrogate, settings, plan.cases, job.progress, log)
    exact_cases = [case.exact for case in cases if case.exact is not None]
    latent = scores([case.latent for case in cases])
    exact = scores(exact_cases) if exact_cases else None
    fit = fit_power([case.likelihoods for case in cases], job.seed)
    content = {
        "plan": plan,
        "latent": latent,
        "exact": exact,
        "power": fit.power,
        "power_error": fit.error,
        "misfits": [case.misfit for case in cases],
        "responses": [case.responses for case in cases],
        "density_levels": [case.latent.density for case in cases],
        "ranks": [case.latent.rank for case in cases],
        "posterior_predictive_p": [case.latent.check for case in cases],
        "posterior_predictive_p_exact": [judged.check for judged in exact_cases],
        "widths": [case.widths for case in cases if case.widths is not None],
    }
    coverage = {
        "nominal": latent.density.nominal,
        "latent": latent.density.found,
        "exact": None if exact is None else exact.density.found,
        "error": latent.density.error,
    }
    return job.write(
        name,
        content,
        f"{_intro(plan)}\n\n{calibration_text(model.prior.names, cases, fit)}",
        answer={"coverage": coverage, "power": fit.power, "power_error": fit.error},
    )


def _intro(plan: CalibrationPlan) -> str:
    floors = ", ".join(plan.floors) or "the roof alone"
    if plan.floors == (ANY_FLOORS,):
        floors = "random sets of floors"
    if plan.noise_sd is not None:
        floors += f", noise {plan.noise_sd:g} on ln|H|"
    return (
        f"{plan.building}, {floors}: {plan.cases} simulated buildings, {plan.particles} "
        "particles; share of truths inside ± binomial standard deviation of the nominal share."
    )


def calibrated(
    surrogate: Surrogate,
    model: StudyModel,
    cases: int = 200,
    seed: int = 12345,
    progress: Progress = SILENT,
) -> Surrogate:
    """A surrogate with its likelihood power, found over random sets of observed floors.

    The simulations are fresh draws from the prior: the training has seen none of them.
    """
    settings = CaseSettings(floors=(ANY_FLOORS,), power=1.0, seed=seed)
    found = _cases(model, surrogate, settings, cases, progress)
    fit = fit_power([case.likelihoods for case in found], seed)
    before = float(np.mean([case.latent.density <= 0.9 for case in found]))
    # A posterior that is a little wider than need be is left as it is.
    wide = fit.power >= 1.0
    info = replace(
        surrogate.info,
        likelihood_power=1.0 if wide else fit.power,
        calibration={
            "cases": cases,
            "seed": seed,
            "floors": [ANY_FLOORS],
            "power_found": fit.power,
            "power_error": fit.error,
            "coverage_90_before": before,
            "coverage_90_after": before if wide else float((fit.level <= 0.9).mean()),
            "date": datetime.now(UTC).date().isoformat(),
        },
    )
    return Surrogate(surrogate.mvae, info)


def _model(folder: Path, name: str, progress: Progress) -> StudyModel:
    """The building, made ready; a frame's reduced model takes minutes and is kept."""
    if load_building(name).kind == "shear":
        return benchmark_model(name)
    return open_study(Study(folder / f"{NAME}_{name}_model"), name, progress)


def _cases(
    model: StudyModel,
    surrogate: Surrogate,
    settings: CaseSettings,
    count: int,
    progress: Progress,
    log: ResumableLog | None = None,
) -> list[CalibrationCase]:
    progress.start("Simulated buildings", count)
    cases = []
    for number in range(count):
        case = None if log is None else log.get(str(number), CalibrationCase)
        if case is None or (case.exact is None and number < settings.beside):
            case = calibration_case(model, surrogate, settings, number)
            if log is not None:
                log.add(str(number), case)
        cases.append(case)
        progress.advance()
    return cases
