"""Pictures of a posterior."""

from pathlib import Path

from femupdate.building.parameters import factor_titles
from femupdate.progress import SILENT, Progress
from femupdate.report.figure import save_figure
from femupdate.report.plot_curves import frf_fit
from femupdate.report.plot_intervals import theta_intervals
from femupdate.report.plot_posterior import SampleSet, posterior_pairs
from femupdate.study import Study
from femupdate.workflow.calibration_report import CalibrationReport
from femupdate.workflow.compare import CompareReport
from femupdate.workflow.fitted_curves import fitted_curves
from femupdate.workflow.mesh_error import open_system


def draw_posterior(
    study: Study, report: CalibrationReport, progress: Progress = SILENT
) -> tuple[Path, ...]:
    """Draw the FRF fit, pairs of parameters and intervals of a posterior."""
    model, posterior = report.model, report.posterior
    progress.start("Drawing", 3)
    names = [_short(name) for name in posterior.names]
    label = f"{', '.join(posterior.observation.floors)} ({posterior.drawn.likelihood} likelihood)"
    sets = [SampleSet(label, posterior.samples)]
    frf = frf_fit(fitted_curves(open_system(study, model), model, posterior))
    paths = [save_figure(frf, study.result("pictures", "frf_fit.png"))]
    progress.advance()
    pairs = posterior_pairs(sets, names, posterior.bounds)
    paths.append(save_figure(pairs, study.result("pictures", "posterior.png")))
    progress.advance()
    factors, titles = posterior.of("stiffness"), factor_titles(model.building)
    intervals = theta_intervals(
        [titles[name] for name in factors.names],
        [SampleSet(label, factors.samples)],
        factors.bounds,
    )
    paths.append(save_figure(intervals, study.result("pictures", "stiffness_factors.png")))
    progress.advance()
    return tuple(paths)


def _short(name: str) -> str:
    """A name that stands below a panel: θ1, or an effect and which of its parameters."""
    effect, _, rest = name.partition("@")
    if not rest:
        return name.replace("theta_", "θ")
    place, _, parameter = rest.rpartition(".")
    return f"{effect.replace('_', ' ')}, {place}" + (f": {parameter}" if parameter else "")


def draw_cases(study: Study, cases: dict[str, CalibrationReport], truth: tuple[float, ...]) -> Path:
    """Draw posteriors of one building over one another, by what each is called.

    Args:
        cases: at least one.
    """
    first = next(iter(cases.values())).posterior
    figure = posterior_pairs(
        [SampleSet(name, case.posterior.samples) for name, case in cases.items()],
        [_short(name) for name in first.names],
        first.bounds,
        truth,
    )
    return save_figure(figure, study.result("pictures", "posterior_cases.png"))


def draw_comparison(report: CompareReport, path: Path) -> Path:
    """Draw the intervals of all factors before and after."""
    figure = theta_intervals(
        report.titles,
        [SampleSet(*case) for case in zip(("Before", "After"), report.draws, strict=True)],
        report.before.posterior.of("stiffness").bounds,
        title="Stiffness factors before and after",
    )
    return save_figure(figure, path)
