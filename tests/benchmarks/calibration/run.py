"""The benchmark `calibration`: coverage, ranks and TARP over simulated buildings."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from femupdate.building.files import load_building
from femupdate.progress import Progress, Silent
from femupdate.study import Study
from femupdate.surrogate.storage import ANY_FLOORS, TrainedSurrogate
from femupdate.workflow.model import StudyModel, open_study
from femupdate.workflow.surrogates import shipped_surrogate

from ..machine import Machine, this_machine
from ..result import ResultFiles, markdown_table, plain, write_result
from ..shear4dof.case import benchmark_model
from .cases import (
    CalibrationCase,
    CaseSettings,
    Judged,
    Widths,
    calibration_case,
)
from .coverage import (
    REGIONS,
    Coverage,
    central_level,
    coverage,
    rank_histogram_p_value,
    uniformity_p_value,
)
from .coverage_power import PowerFit, fit_power
from .log import CaseLog, surrogate_mark

NAME = "calibration"


@dataclass(frozen=True)
class CalibrationPlan:
    """What is simulated.

    Attributes:
        building: shipped name.
        floors: observed; the roof alone where empty; `ANY_FLOORS` alone for random sets.
        cases: simulated buildings.
        particles: of each posterior.
        beside: the first so many cases also get the data-space posterior; all where None.
        power: of the latent likelihood; default the surrogate's own.
        noise_sd: of ln|H|; default that of the surrogate's training.
    """

    building: str = "shear_4dof"
    floors: tuple[str, ...] = ()
    cases: int = 200
    particles: int = 1000
    beside: int | None = None
    power: float | None = None
    noise_sd: float | None = None

    def of_cases(self, model: StudyModel, seed: int) -> CaseSettings:
        """What is made of every case."""
        beside = self.cases if self.beside is None else self.beside
        floors = self.floors or (model.building.floors[-1],)
        return CaseSettings(floors, self.particles, beside, self.power, seed, self.noise_sd)


@dataclass(frozen=True)
class Scores:
    """How one kind of posterior does over all cases.

    Attributes:
        density: coverage of highest-density regions.
        central: coverage of the central intervals of all parameters together.
        rank_p: (p,) chi-square p-values of the rank histograms.
        tarp_p: Kolmogorov-Smirnov p-value of the TARP levels.
    """

    density: Coverage
    central: Coverage
    rank_p: tuple[float, ...]
    tarp_p: float


@dataclass(frozen=True)
class CalibrationBenchmark:
    """What the benchmark found.

    Attributes:
        machine: it ran on.
        plan: what was simulated.
        latent, exact: scores; `exact` is None where it was not asked for.
        fit: the power that would calibrate the latent likelihood (beside the one in use).
        text: tables in Markdown.
        files: written.
    """

    machine: Machine
    plan: CalibrationPlan
    latent: Scores
    exact: Scores | None
    fit: PowerFit
    text: str
    files: ResultFiles


def run_calibration(
    folder: Path, plan: CalibrationPlan, seed: int = 0, progress: Progress | None = None
) -> CalibrationBenchmark:
    """Run the benchmark and write its results.

    Every case is written when it is done, beside the results; a run that was cut off goes on, and
    one with more cases adds to them. The reduced model of a frame is kept in the folder as well.

    Raises:
        SurrogateError: there is no shipped surrogate of the building.
        StudyError: a file cannot be written.
    """
    show, machine = progress or Silent(), this_machine()
    building = load_building(plan.building)
    surrogate = shipped_surrogate(building)
    model = _model(folder, plan.building, show)
    name = f"{NAME}_{plan.building}_{'_'.join(plan.floors) or 'roof'}"
    if plan.noise_sd is not None:
        name += f"_noise_{plan.noise_sd:g}"
    log = CaseLog(folder / f"{name}_cases.jsonl", _header(model, surrogate, plan, seed))
    cases = _cases(model, surrogate, plan, seed, show, log)
    latent = scores([case.latent for case in cases])
    both = [case.exact for case in cases if case.exact is not None]
    exact = scores(both) if both else None
    fit = fit_power([case.likelihoods for case in cases], seed)
    widths = width_rows(model.prior.names, [c.widths for c in cases if c.widths is not None])
    text = _text(plan, latent, exact, fit, cases, widths)
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
        "posterior_predictive_p_exact": [judged.check for judged in both],
        "widths": [case.widths for case in cases if case.widths is not None],
    }
    files = write_result(folder, name, machine, seed, content, text)
    return CalibrationBenchmark(machine, plan, latent, exact, fit, text, files)


def calibrated(
    surrogate: TrainedSurrogate,
    model: StudyModel,
    cases: int = 200,
    seed: int = 12345,
    progress: Progress | None = None,
) -> TrainedSurrogate:
    """A surrogate with its likelihood power, found over random sets of observed floors.

    The simulations are fresh draws from the prior: the training has seen none of them.
    """
    show = progress or Silent()
    plan = CalibrationPlan(model.building.name, (ANY_FLOORS,), cases, beside=0, power=1.0)
    found = _cases(model, surrogate, plan, seed, show)
    fit = fit_power([case.likelihoods for case in found], seed)
    before = float(np.mean([c.latent.density <= 0.9 for c in found]))
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
    return TrainedSurrogate(surrogate.mvae, info)


def _model(folder: Path, name: str, show: Progress) -> StudyModel:
    """The building, made ready; a frame's reduced model takes minutes and is kept."""
    if load_building(name).kind == "shear":
        return benchmark_model(name)
    return open_study(Study(folder / f"{NAME}_{name}_model"), name, show)


def _header(
    model: StudyModel, surrogate: TrainedSurrogate, plan: CalibrationPlan, seed: int
) -> str:
    """What cases on disk must share with those wanted."""
    settings = replace(plan.of_cases(model, seed), beside=0)
    return json.dumps([model.hash, surrogate_mark(surrogate), plain(settings)])


def _cases(
    model: StudyModel,
    surrogate: TrainedSurrogate,
    plan: CalibrationPlan,
    seed: int,
    show: Progress,
    log: CaseLog | None = None,
) -> list[CalibrationCase]:
    settings = plan.of_cases(model, seed)
    show.start("Simulated buildings", plan.cases)
    known = {} if log is None else log.read()
    if log is not None:
        log.start(known)
    cases = []
    for number in range(plan.cases):
        case = known.get(number)
        if case is None or (case.exact is None and number < settings.beside):
            case = calibration_case(model, surrogate, settings, number)
            if log is not None:
                log.add(number, case)
        cases.append(case)
        show.advance()
    return cases


def scores(judged: Sequence[Judged]) -> Scores:
    """Scores of some cases."""
    rank = np.array([case.rank for case in judged])
    central = coverage(central_level(rank.ravel()))
    # The parameters of a case are not independent: count cases, not parameters.
    error = np.sqrt(central.nominal * (1.0 - central.nominal) / len(judged))
    return Scores(
        coverage([case.density for case in judged]),
        replace(central, error=error, cases=len(judged)),
        tuple(rank_histogram_p_value(column) for column in rank.T),
        uniformity_p_value([case.tarp for case in judged]),
    )


def _text(
    plan: CalibrationPlan,
    latent: Scores,
    exact: Scores | None,
    fit: PowerFit,
    cases: Sequence[CalibrationCase],
    widths: Sequence[tuple[str, ...]],
) -> str:
    head = ("region", *(f"{region:.0%}" for region in REGIONS), "p, ranks (least)", "p, TARP")
    rows = []
    for name, found in (("latent", latent), ("data-space", exact)):
        if found is None:
            continue
        last = (f"{min(found.rank_p):.3f}", f"{found.tarp_p:.3f}")
        rows.append((f"{name}, highest density", *_cells(found.density), *last))
        rows.append((f"{name}, central intervals", *_cells(found.central), "", ""))
    floors = ", ".join(plan.floors) or "the roof alone"
    if plan.floors == (ANY_FLOORS,):
        floors = "random sets of floors"
    if plan.noise_sd is not None:
        floors += f", noise {plan.noise_sd:g} on ln|H|"
    beside = [markdown_table(_WIDTH_HEAD, widths)] if widths else []
    checks = [
        *predictive_rows("latent", [case.latent for case in cases]),
        *predictive_rows("data-space", [c.exact for c in cases if c.exact is not None]),
    ]
    if checks:
        beside += [markdown_table(_CHECK_HEAD, checks), _CHECK_NOTE]
    return "\n\n".join(
        (
            f"{plan.building}, {floors}: {plan.cases} simulated buildings, {plan.particles} "
            "particles; share of truths inside ± binomial standard deviation of the nominal share.",
            markdown_table(head, rows),
            *beside,
            f"The power that would calibrate the latent likelihood, beside the one in use: "
            f"{fit.power:.2f} ± {fit.error:.2f}; with it the 90 % region holds "
            f"{(fit.level <= 0.9).mean():.1%}. Responses of the building that a latent likelihood "
            f"took: {np.median([case.responses for case in cases]):.0f} (median).",
        )
    )


_CHECK_HEAD = (
    "posterior predictive p-values",
    "number",
    *("5 %", "25 %", "median", "75 %", "95 %"),
    "below .05",
)
_CHECK_NOTE = (
    "Replicated data miss the response of a posterior draw by more than the data do, in chi-square "
    "(Gelman, Meng & Stern 1996). The data judge a posterior that they have moved: of a right one "
    "the p-values gather about a half, and at most .1 of them lie below .05 (Meng 1994)."
)


def predictive_rows(name: str, judged: Sequence[Judged]) -> list[tuple[str, ...]]:
    """Quantiles of the predictive p-values of a kind of posterior, whole and floor by floor."""
    checks = [one.check for one in judged if one.check is not None]
    kinds = [("all floors together", [check.whole for check in checks])]
    if any(len(check.floors) > 1 for check in checks):
        each = [value for check in checks for value in check.floors if np.isfinite(value)]
        kinds.append(("floor by floor", each))
    rows = []
    for what, values in kinds:
        if values:
            quantiles = np.quantile(values, [0.05, 0.25, 0.5, 0.75, 0.95])
            numbers = (f"{value:.2f}" for value in (*quantiles, np.mean(np.less(values, 0.05))))
            rows.append((f"{name}, {what}", str(len(values)), *numbers))
    return rows


_WIDTH_HEAD = (
    "latent against data-space",
    "cases",
    "sd ratio, median",
    "5 to 95 %",
    "shift of the mean, exact sd",
)


def width_rows(names: Sequence[str], widths: Sequence[Widths]) -> list[tuple[str, ...]]:
    """A row a parameter: how wide the latent posterior is, and how far its mean is off."""
    if not widths:
        return []
    ratio = np.array([one.ratio for one in widths])
    shift = np.abs([one.shift for one in widths])
    low, middle, high = np.quantile(ratio, [0.05, 0.5, 0.95], axis=0)
    return [
        (
            name,
            str(len(widths)),
            f"{middle[k]:.2f}",
            f"{low[k]:.2f} to {high[k]:.2f}",
            f"{np.median(shift[:, k]):.2f} (largest {shift[:, k].max():.2f})",
        )
        for k, name in enumerate(names)
    ]


def _cells(found: Coverage) -> list[str]:
    return [f"{share:.3f} ± {sd:.3f}" for share, sd in zip(found.found, found.error, strict=True)]
