"""How much a building differs from event to event: by default, or learned of several runs.

The logarithm of the stiffness (or damping) in run r is the mean's plus a_r, normal with a standard
deviation tau. Estimates m_r of it err by e_r. Given tau the mean is normal with the precision
sum 1 / (e_r^2 + tau^2), and the density of tau follows in closed form (the one-way random effects
of Gelman et al. 2013, Bayesian Data Analysis, section 5.4). Few runs say little of tau: its prior
is about what other buildings did.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Floats, Integers
from femupdate.seeds import Seed
from femupdate.units import percent

QUANTITIES = ("stiffness", "damping")


@dataclass(frozen=True, kw_only=True, eq=False)
class EventScatter:
    """How much a building differs from event to event; one value, or one for every draw (n,).

    Attributes:
        stiffness, damping: standard deviations of the logarithms of all stiffness factors together
            and of the damping ratio. A hotel in quakes of 7 to 90 gal: frequencies 2.8 %; an
            overpass: factors 6 %.
        stiffer, damped: by which their means over events lie above the calibrated ones, ln.
    """

    stiffness: float | Floats = 0.05
    damping: float | Floats = 0.2
    stiffer: float | Floats = 0.0
    damped: float | Floats = 0.0

    def next_event(
        self, theta: Tensor, zeta: Tensor, box: tuple[Tensor, Tensor], seed: Seed
    ) -> tuple[Tensor, Tensor]:
        """Factors (n, p) and damping ratios (n,) of another event, factors within their box."""
        away = np.random.default_rng(seed).standard_normal((2, len(theta)))
        stiffer = torch.from_numpy(self.stiffer + self.stiffness * away[0]).to(theta)
        damped = torch.from_numpy(self.damped + self.damping * away[1]).to(theta)
        moved = theta * torch.exp(stiffer)[:, None]
        inside = torch.minimum(torch.maximum(moved, box[0].to(theta)), box[1].to(theta))
        return inside, (zeta * torch.exp(damped)).clamp_max(0.99)


DEFAULT = EventScatter()


@dataclass(frozen=True, eq=False)
class LearnedScatter:
    """What several runs say of the scatter between events, at every draw of their posterior.

    Attributes:
        sd: (chains, draws, 2) of ln stiffness and ln damping between events.
        shift: (chains, draws, 2) by which the mean over events lies above the draw.
        runs: how many it was learned of.
    """

    sd: Floats
    shift: Floats
    runs: int

    def of(self, rows: Integers) -> EventScatter:
        """For some draws (n,)."""
        sd, shift = (each.reshape(-1, 2)[rows] for each in (self.sd, self.shift))
        return EventScatter(
            stiffness=sd[:, 0], damping=sd[:, 1], stiffer=shift[:, 0], damped=shift[:, 1]
        )

    def sentence(self) -> str:
        """For the user."""
        low, middle, high = np.quantile(self.sd.reshape(-1, 2), [0.05, 0.5, 0.95], axis=0)
        said = [
            f"{name} scatters by {percent(middle[k], 1)} "
            f"(90 %: {percent(low[k], 1)} to {percent(high[k], 1)})"
            for k, name in enumerate(QUANTITIES)
        ]
        return f"Between the {self.runs} runs {' and '.join(said)}; predictions allow for it."


def learned_scatter(
    estimates: Floats, errors: Floats, shape: tuple[int, int], seed: Seed
) -> LearnedScatter:
    """Draws of the scatter between runs, and of the mean over events.

    Args:
        estimates: (r, 2) ln stiffness and ln damping of every run, over what all are explained by.
        errors: (r, 2) their standard deviations; infinite where a run says nothing.
        shape: chains and draws of the posterior.
    """
    rng, count = np.random.default_rng(seed), shape[0] * shape[1]
    defaults = DEFAULT.stiffness, DEFAULT.damping
    columns = [
        _drawn(estimates[:, k], errors[:, k], float(defaults[k]), count, rng) for k in (0, 1)
    ]
    sd, shift = (np.stack([column[k] for column in columns], axis=-1) for k in (0, 1))
    return LearnedScatter(sd.reshape(*shape, 2), shift.reshape(*shape, 2), len(estimates))


def sd_density(estimates: Floats, errors: Floats, default: float) -> tuple[Floats, Floats]:
    """Standard deviations (g,) between events, and their probabilities (g,).

    Args:
        estimates: (r,) of every run.
        errors: (r,) their standard deviations.
        default: median of the prior, which is normal in ln.
    """
    tau = default * np.geomspace(0.05, 20.0, 241)
    mean, variance = _means(estimates, errors, tau)
    spread = errors**2 + tau[:, None] ** 2
    squares = ((estimates - mean[:, None]) ** 2 / spread).sum(axis=1)
    log = 0.5 * np.log(variance) - 0.5 * np.log(spread).sum(axis=1) - 0.5 * squares
    # A third to three times of the default are nothing unusual (one standard deviation).
    log -= 0.5 * np.log(tau / default) ** 2
    weight = np.exp(log - log.max())
    return tau, weight / weight.sum()


def _means(estimates: Floats, errors: Floats, tau: Floats) -> tuple[Floats, Floats]:
    """Mean over events and its variance, (g,) each, at standard deviations (g,)."""
    precision = 1.0 / (errors**2 + tau[:, None] ** 2)
    variance = 1.0 / precision.sum(axis=1)
    return variance * (precision @ estimates), variance


def _drawn(
    estimates: Floats, errors: Floats, default: float, count: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Standard deviations between events (n,), and the mean over events (n,) above the draws."""
    known = np.isfinite(errors)
    if known.sum() < 2:
        return np.full(count, default), np.zeros(count)
    estimates, errors = estimates[known], errors[known]
    tau, weight = sd_density(estimates, errors, default)
    sd = tau[rng.choice(len(tau), count, p=weight)]
    mean, variance = _means(estimates, errors, sd)
    # The draws know the mean as if all events were one.
    start, least = _means(estimates, errors, np.zeros(1))
    beyond = np.sqrt(np.maximum(variance - least, 0.0))
    return sd, mean - start + beyond * rng.standard_normal(count)


def scatter_as_group(scatter: LearnedScatter | None, draws: Mapping[str, Any]) -> dict[str, Any]:
    """The netCDF group of a posterior's scatter, none where there is none."""
    import xarray as xr

    if scatter is None:
        return {}
    dims = ("chain", "draw", "quantity")
    content = {"sd": (dims, scatter.sd), "shift": (dims, scatter.shift)}
    coords = {**draws, "quantity": list(QUANTITIES)}
    return {"/event_scatter": xr.Dataset(content, coords=coords, attrs={"runs": scatter.runs})}


def scatter_from_group(tree: Any) -> LearnedScatter | None:
    """What `scatter_as_group` wrote, from the tree of a posterior."""
    if "event_scatter" not in tree.children:
        return None
    group = tree["event_scatter"].to_dataset()
    return LearnedScatter(group["sd"].values, group["shift"].values, int(group.attrs["runs"]))
