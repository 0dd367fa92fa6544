"""Pictures of the four-story benchmark: latent space, posterior, floors nobody measured."""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse

from femupdate.arrays import Floats
from femupdate.measurement.observation import on_all_floors
from femupdate.report.curves import response_curves
from femupdate.report.density import density_1d
from femupdate.report.figure import add_head, new_figure, save_figure
from femupdate.report.plot_curves import frf_fit
from femupdate.report.style import DASHES, INK, KNOWN, MAGNITUDE_MAP, ORANGE, SERIES, styled
from femupdate.workflow.model import StudyModel

from .case import Case, Shear4dof, case_modes, roof_log_frf

_MARKERS = "osD^vP*X"


@styled
def latent_space(problem: Shear4dof, samples: int = 2500) -> Figure:
    """Means of q(z|theta) over the prior in their first two principal axes.

    Coloured by the first natural frequency; the equivalent solutions and the components of q(z|x)
    of the observation are marked.
    """
    model, case = problem.model, problem.case
    theta = model.prior.sample(samples, torch.Generator().manual_seed(0))

    def means(points: torch.Tensor) -> Floats:
        with torch.inference_mode():
            return problem.surrogate.mvae.encode_parameters(points.float()).double().numpy()

    cloud = means(theta)
    centre = cloud.mean(axis=0)
    _, spread, axes = np.linalg.svd(cloud - centre, full_matrices=False)
    plane = axes[:2]
    figure = new_figure(6.4, 4.9)
    panel = figure.add_subplot()
    frequency = model.system.modal_data(theta).omega[:, 0].numpy() / (2.0 * np.pi)
    order = np.argsort(frequency)
    across, up = ((cloud - centre) @ plane.T)[order].T
    points = panel.scatter(
        across, up, c=frequency[order], s=5, cmap=MAGNITUDE_MAP, linewidths=0, alpha=0.75
    )
    figure.colorbar(points, ax=panel, label="First natural frequency, Hz")
    solutions = (means(torch.from_numpy(case.solutions)) - centre) @ plane.T
    handles = _mark_solutions(panel, case, solutions)
    seen = problem.latent().found.posterior
    covariance = plane @ np.linalg.inv(seen.precision.numpy()) @ plane.T
    _mark_components(panel, (seen.mean.numpy() - centre) @ plane.T, covariance)
    handles.append(
        Line2D([], [], marker="+", color=ORANGE, linestyle="none", label="q(z|x), ± 2 sd")
    )
    share = spread**2 / (spread**2).sum()
    panel.set(
        xlabel=f"First principal axis ({100 * share[0]:.0f} % of the variance)",
        ylabel=f"Second principal axis ({100 * share[1]:.0f} %)",
    )
    note = "Where the prior's buildings lie; open marks have one roof FRF"
    add_head(figure, "Latent space", handles, note=note, columns=3)
    return figure


def _mark_solutions(panel: Axes, case: Case, points: Floats) -> list[Line2D]:
    """Open marks at points (m, 2), and their entries in the legend."""
    handles = []
    for number, (point, solution) in enumerate(zip(points, case.solutions, strict=True)):
        style: dict[str, Any] = {
            "marker": _MARKERS[number % len(_MARKERS)],
            "markersize": 14,
            "markerfacecolor": "none",
            "markeredgecolor": INK,
            "markeredgewidth": 1.6,
            "linestyle": "none",
        }
        panel.plot(*point, **style)
        label = "(" + ", ".join(f"{value:.3g}" for value in solution) + ")"
        handles.append(Line2D([], [], label=label, **{**style, "markersize": 7}))
    return handles


def _mark_components(panel: Axes, means: Floats, covariances: Floats) -> None:
    """Means (c, 2) with ellipses of two standard deviations."""
    for mean, covariance in zip(means, covariances, strict=True):
        panel.plot(*mean, "+", color=ORANGE, markersize=9, markeredgewidth=1.8)
        variance, directions = np.linalg.eigh(covariance)
        angle = np.degrees(np.arctan2(directions[1, 1], directions[0, 1]))
        width, height = 4.0 * np.sqrt(variance[::-1])
        ellipse = Ellipse(mean, width, height, angle=angle, fill=False, edgecolor=ORANGE, lw=1.2)
        panel.add_patch(ellipse)


@styled
def posterior_pairs(model: StudyModel, draws: dict[str, Floats]) -> Figure:
    """Pairs of parameters as points, with histograms on the diagonal.

    Modes are a hundredth of the distance between them: smooth densities would hide their width.
    """
    names = [name.replace("theta_", "θ") for name in model.prior.names]
    size = len(names)
    every = np.concatenate(list(draws.values()))
    room = 0.06 * np.ptp(every, axis=0)
    views = np.column_stack([every.min(axis=0) - room, every.max(axis=0) + room])
    figure = new_figure(8.4, 8.0)
    axes = figure.subplots(size, size, squeeze=False, sharex="col")
    for row, column in np.ndindex(size, size):
        panel: Axes = axes.item(row, column)
        panel.set_visible(row >= column)
        if row == column:
            bins = np.linspace(views[row, 0], views[row, 1], 90).tolist()
            for color, theta in zip(SERIES, draws.values(), strict=False):
                panel.hist(theta[:, row], bins, density=True, histtype="step", color=color)
            panel.set_yticks([])
        elif row > column:
            for color, theta in zip(SERIES, draws.values(), strict=False):
                few = theta[:: max(1, len(theta) // 700)]
                panel.plot(*few[:, [column, row]].T, ".", ms=2.2, mew=0, alpha=0.6, color=color)
            panel.set_ylim(views[row, 0], views[row, 1])
        panel.set_xlim(views[column, 0], views[column, 1])
        if row == size - 1:
            panel.set_xlabel(names[column])
        if column == 0 and row > 0:
            panel.set_ylabel(names[row])
    add_head(figure, "Four-story benchmark, roof alone", _handles(draws))
    return figure


@styled
def mode_densities(model: StudyModel, case: Case, draws: dict[str, Floats]) -> Figure:
    """Density of every parameter inside every mode, in units of the exact deviations."""
    names = [name.replace("theta_", "θ") for name in model.prior.names]
    shares = {label: case_modes(case, theta) for label, theta in draws.items()}
    figure = new_figure(8.4, 1.6 * len(case.solutions) + 0.4)
    axes = figure.subplots(len(case.solutions), len(names), squeeze=False)
    for mode, column in np.ndindex(*axes.shape):
        panel: Axes = axes.item(mode, column)
        centre, sd = float(case.solutions[mode, column]), float(case.sd[mode, column])
        view = (centre - 6.0 * sd, centre + 6.0 * sd)
        for color, dashes, (label, theta) in zip(SERIES, DASHES, draws.items(), strict=False):
            own = theta[shares[label].member == mode, column]
            if len(own) > 10:
                density = density_1d(own, view)
                panel.plot(density.x, density.value, color=color, linestyle=dashes)
        panel.axvline(centre, **KNOWN)
        panel.set(xlim=view, yticks=[])
        panel.locator_params(axis="x", nbins=3)
        if mode == len(case.solutions) - 1:
            panel.set_xlabel(names[column])
        if column == 0:
            weights = ", ".join(f"{share.weight[mode]:.2f}" for share in shares.values())
            panel.set_ylabel(f"mode {mode + 1}\n{weights}")
    note = "Dotted: the equivalent solution; at the left the share of each posterior in the mode"
    add_head(figure, "Inside the modes", _handles(draws), note=note)
    return figure


def _handles(draws: dict[str, Floats]) -> list[Line2D]:
    return [
        Line2D([], [], color=color, linestyle=dashes, linewidth=1.8, label=label)
        for color, dashes, label in zip(SERIES, DASHES, draws, strict=False)
    ]


def draw_benchmark(folder: Path, problem: Shear4dof, draws: dict[str, Floats]) -> tuple[Path, ...]:
    """Write the four pictures; `draws` are posteriors by their labels, the last the best."""
    model, case = problem.model, problem.case
    figures = {
        "latent_space": latent_space(problem),
        "posterior": posterior_pairs(model, draws),
        "modes": mode_densities(model, case, draws),
        "predicted": _predicted(model, case, list(draws.values())[-1]),
    }
    return tuple(
        save_figure(figure, folder / f"shear4dof_{name}.png") for name, figure in figures.items()
    )


def _predicted(model: StudyModel, case: Case, theta: Floats) -> Figure:
    """Responses of all floors by draws (n, p), with what the roof measured."""
    predicted = roof_log_frf(model, theta[:: max(1, len(theta) // 400)])
    seen = on_all_floors(case.observation, model.building.floors)
    return frf_fit(
        response_curves(predicted, seen),
        title="Measured at the roof alone: response of the other floors",
    )
