"""The benchmark `calibration`: coverage over simulated buildings."""

from dataclasses import replace
from pathlib import Path

from femupdate.building import load_building
from femupdate.progress import Progress
from femupdate.study import Study
from femupdate.surrogate import Surrogate
from femupdate.surrogate.storage import ANY_FLOORS
from femupdate.workflow import StudyModel, open_study

from ..log import ResumableLog
from ..result import Job, Report
from ..shipped import benchmark_model, shipped_surrogate, surrogate_mark
from .cases import CalibrationCase, CalibrationPlan, calibration_case
from .tables import calibration_text, coverage

NAME = "calibration"


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
    header = [model.hash, surrogate_mark(surrogate), job.seed, replace(plan, cases=0, beside=0)]
    log = ResumableLog(job.folder / f"{name}_cases.jsonl", header)
    cases = _cases(model, surrogate, plan, job, log)
    exact_cases = [case.exact for case in cases if case.exact is not None]
    latent = coverage([case.latent for case in cases])
    exact = coverage(exact_cases) if exact_cases else None
    content = {
        "plan": plan,
        "latent": latent,
        "exact": exact,
        "misfits": [case.misfit for case in cases],
        "responses": [case.responses for case in cases],
        "density_levels": [case.latent for case in cases],
        "widths": [case.widths for case in cases if case.widths is not None],
    }
    answer = {
        "nominal": latent.nominal,
        "latent": latent.found,
        "exact": None if exact is None else exact.found,
        "error": latent.error,
    }
    return job.write(
        name,
        content,
        f"{_intro(plan)}\n\n{calibration_text(model.prior.names, cases)}",
        answer={"coverage": answer},
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


def _model(folder: Path, name: str, progress: Progress) -> StudyModel:
    """The building, made ready; a frame's reduced model takes minutes and is kept."""
    if load_building(name).kind == "shear":
        return benchmark_model(name)
    return open_study(Study(folder / f"{NAME}_{name}_model"), name, progress)


def _cases(
    model: StudyModel, surrogate: Surrogate, plan: CalibrationPlan, job: Job, log: ResumableLog
) -> list[CalibrationCase]:
    job.progress.start("Simulated buildings", plan.cases)
    cases = []
    for number in range(plan.cases):
        case = log.get(str(number), CalibrationCase)
        if case is None or (case.exact is None and number < plan.compared):
            case = calibration_case(model, surrogate, plan, job.seed, number)
            log.add(str(number), case)
        cases.append(case)
        job.progress.advance()
    return cases
