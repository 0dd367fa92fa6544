"""What is inferred: one named vector with its priors and one map to standard normal coordinates."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.building.document import Building, factor_ranges
from femupdate.dynamics.snapshots import ReductionTarget
from femupdate.dynamics.system import parameters_of
from femupdate.effects.effect import Placed
from femupdate.errors import brief

Kind = Literal["stiffness", "effect", "damping"]


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One number that is inferred, or known where its bounds are one.

    Attributes:
        name: as in "theta_1".
        kind: a stiffness factor, a parameter of an effect, or the damping ratio.
        neutral: value at which it changes nothing.
        centre, scale: mean and standard deviation of a normal prior within the bounds; uniform
            where the scale is infinite.
    """

    name: str
    kind: Kind
    lower: float
    upper: float
    neutral: float = 1.0
    centre: float = 0.0
    scale: float = math.inf

    def __post_init__(self) -> None:
        if not self.upper >= self.lower:
            raise ValueError(f"{self.name}: the upper bound {self.upper:g} is below the lower one")

    @property
    def free(self) -> bool:
        """Whether it is inferred: a parameter of zero width is known."""
        return self.upper > self.lower

    @property
    def called(self) -> str:
        """For the user."""
        return "the damping ratio" if self.kind == "damping" else self.name

    @property
    def key(self) -> str:
        """Table of the building file that says its limits; empty of an effect's."""
        return {"stiffness": "[prior.theta]", "damping": "[prior.zeta]"}.get(self.kind, "")

    def widened(self) -> "Parameter":
        """A factor or damping ratio with room for three times less and more, where it is free."""
        if not self.free or self.kind == "effect":
            return self
        most = 0.9 if self.kind == "damping" else math.inf
        return replace(self, lower=self.lower / 3.0, upper=min(3.0 * self.upper, most))


@dataclass(frozen=True)
class Values:
    """Parameters by their kinds.

    Attributes:
        theta: (n, p) stiffness factors.
        zeta: (n,) damping ratios; (0,) where no damping ratio is among the parameters.
        sizes: (n, q) parameters of effects.
    """

    theta: Tensor
    zeta: Tensor
    sizes: Tensor

    @property
    def of_structure(self) -> Tensor:
        """(n, p + q) stiffness factors and parameters of effects."""
        return torch.cat([self.theta, self.sizes], dim=1)


@dataclass(frozen=True)
class Parameters:
    """Independent parameters with their priors.

        >>> import femupdate, torch
        >>> parameters = femupdate.Parameters.uniform(["theta_1", "theta_2"], [0.5, 0.5], [2, 2])
        >>> parameters.names, parameters.sample(100, torch.Generator()).shape
        (('theta_1', 'theta_2'), torch.Size([100, 2]))

    Samplers work in the standard normal coordinates xi (n, d) of the d free parameters, in which
    every point is inside the bounds and the prior density is exp(-|xi|^2 / 2). Vectors of all p
    parameters are (n, p), known ones among them.

    Attributes:
        entries: the parameters in their order.
    """

    __repr__ = brief

    entries: tuple[Parameter, ...]

    @staticmethod
    def uniform(
        names: Sequence[str],
        lower: Sequence[float] | Tensor,
        upper: Sequence[float] | Tensor,
        kind: Kind = "stiffness",
    ) -> "Parameters":
        """Uniform parameters of one kind on a box."""
        bounds = zip(names, _plain(lower), _plain(upper), strict=True)
        return Parameters(
            tuple(Parameter(name=n, kind=kind, lower=a, upper=b) for n, a, b in bounds)
        )

    def __add__(self, other: "Parameters") -> "Parameters":
        """These and more behind them."""
        return replace(self, entries=(*self.entries, *other.entries))

    @property
    def names(self) -> tuple[str, ...]:
        """p names."""
        return tuple(entry.name for entry in self.entries)

    @cached_property
    def size(self) -> int:
        """Number of free parameters d."""
        return sum(entry.free for entry in self.entries)

    @cached_property
    def lower(self) -> Tensor:
        """(p,) float64."""
        return self._column([entry.lower for entry in self.entries])

    @cached_property
    def upper(self) -> Tensor:
        """(p,) float64."""
        return self._column([entry.upper for entry in self.entries])

    def columns(self, *kinds: Kind) -> list[int]:
        """Places of those of some kinds."""
        return [k for k, entry in enumerate(self.entries) if entry.kind in kinds]

    def of(self, *kinds: Kind) -> "Parameters":
        """Those of some kinds."""
        return replace(self, entries=tuple(self.entries[k] for k in self.columns(*kinds)))

    def split(self, values: Tensor) -> Values:
        """Parameters (n, p) by their kinds."""
        zeta = values[:, self.columns("damping")].flatten()
        return Values(values[:, self.columns("stiffness")], zeta, values[:, self.columns("effect")])

    def sample(self, count: int, generator: torch.Generator) -> Tensor:
        """Draw (count, p) from the prior."""
        return self.from_unit(
            torch.rand(count, self.size, generator=generator, dtype=torch.float64)
        )

    def from_unit(self, unit: Tensor) -> Tensor:
        """Map the unit cube (n, d) to the parameters (n, p), evenly in probability."""
        lower, upper = self._ends
        free = lower + (upper - lower) * unit
        if self._normal:
            low, high = self._tails
            share = low + (high - low) * unit[..., self._normal]
            # At a limit far out a share may round to one.
            scaled = torch.special.ndtri(share.clamp(1e-300, 1.0 - 1e-16))
            inside = self.centres + self.scales * scaled
            inside = inside.clamp(lower[self._normal], upper[self._normal])
            free = free.index_copy(-1, torch.tensor(self._normal), inside)
        if self.size == len(self.entries):
            return free
        values = self.lower.expand(*unit.shape[:-1], -1).clone()
        values[..., self._free] = free
        return values

    def to_unit(self, values: Tensor) -> Tensor:
        """Map the parameters (n, p) to the unit cube (n, d)."""
        (lower, upper), (low, high) = self._ends, self._tails
        free = values[..., self._free]
        unit = (free - lower) / (upper - lower)
        scaled = (free[..., self._normal] - self.centres) / self.scales
        unit[..., self._normal] = (torch.special.ndtr(scaled) - low) / (high - low)
        return unit

    def from_normal(self, xi: Tensor) -> Tensor:
        """Map standard normal coordinates (n, d) to the parameters (n, p)."""
        return self.from_unit(torch.special.ndtr(xi))

    def to_normal(self, values: Tensor) -> Tensor:
        """Map the parameters to standard normal coordinates; bounds go to +-infinity."""
        return torch.special.ndtri(self.to_unit(values))

    def log_density_normal(self, xi: Tensor) -> Tensor:
        """Log prior density (n,) of standard normal coordinates (n, d)."""
        return -0.5 * (xi**2 + math.log(2.0 * math.pi)).sum(-1)

    def log_density(self, values: Tensor) -> Tensor:
        """Log prior density (n,) of the free ones among parameters (n, p), inside the bounds."""
        (lower, upper), (low, high) = self._ends, self._tails
        flat = -(upper - lower).log().repeat(len(values), 1)
        scaled = (values[:, self._free][:, self._normal] - self.centres) / self.scales
        density = -0.5 * scaled**2 - 0.5 * math.log(2.0 * math.pi) - self.scales.log()
        flat[:, self._normal] = density - (high - low).log()
        return flat.sum(-1)

    def to_logs(self, values: Tensor) -> Tensor:
        """Logs (n, d) of factors, of damping, and of 1 + a share; other parameters as they are.

        What a heavier floor does a stiffer story undoes: in logs, along a straight line.
        """
        logged, shift = self._logs
        free = values[..., self._free]
        return torch.where(logged, torch.where(logged, free + shift, 1.0).log(), free)

    def from_logs(self, logs: Tensor) -> tuple[Tensor, Tensor]:
        """Parameters (n, p) of these, and the log prior density (n,) over them.

        Points beyond a bound are impossible; their parameters are at it.
        """
        (lower, upper), (logged, shift) = self._ends, self._logs
        free = torch.where(logged, torch.where(logged, logs, 0.0).exp() - shift, logs)
        values = self.lower.expand(len(logs), -1).clone()
        values[:, self._free] = torch.minimum(torch.maximum(free, lower), upper)
        slope = torch.where(logged, logs, 0.0).sum(-1)
        inside = ((free >= lower) & (free <= upper)).all(-1)
        return values, torch.where(inside, self.log_density(values) + slope, -torch.inf)

    @cached_property
    def steps(self) -> "LogSteps":
        """The free ones as a fit steps through them."""
        lower, upper = self._ends
        ends = torch.stack([lower.log(), upper.log()])
        ends[:, self._normal] = (self._ends[:, self._normal] - self.centres) / self.scales
        mean, precision = torch.zeros_like(lower), torch.zeros_like(lower)
        precision[self._normal] = 1.0
        return LogSteps(self, ends[0], ends[1], mean, torch.diag(precision))

    @cached_property
    def centres(self) -> Tensor:
        """(q,) means of the normal priors of free parameters."""
        return self._column([entry.centre for entry in self._bells])

    @cached_property
    def scales(self) -> Tensor:
        """(q,) standard deviations of these."""
        return self._column([entry.scale for entry in self._bells])

    @cached_property
    def _free(self) -> list[int]:
        """Places of the free parameters among all."""
        return [k for k, entry in enumerate(self.entries) if entry.free]

    @cached_property
    def _normal(self) -> list[int]:
        """Places of those with a normal prior among the free ones."""
        scales = [self.entries[k].scale for k in self._free]
        return [place for place, scale in enumerate(scales) if math.isfinite(scale)]

    @property
    def _bells(self) -> list[Parameter]:
        return [self.entries[self._free[place]] for place in self._normal]

    @cached_property
    def _logs(self) -> tuple[Tensor, Tensor]:
        """(d,) whether the logarithm is taken, and what is added before."""
        free = [self.entries[k] for k in self._free]
        shares = [entry.lower > -1.0 and entry.scale < 1.0 for entry in free]
        positive = [entry.lower > 0.0 and not math.isfinite(entry.scale) for entry in free]
        logged = [a or b for a, b in zip(shares, positive, strict=True)]
        return torch.tensor(logged), self._column([float(a) for a in shares])

    @cached_property
    def _ends(self) -> Tensor:
        """(2, d) bounds of the free parameters."""
        return torch.stack([self.lower[self._free], self.upper[self._free]])

    @cached_property
    def _tails(self) -> Tensor:
        """(2, q) probability of the normal priors below either bound."""
        return torch.special.ndtr((self._ends[:, self._normal] - self.centres) / self.scales)

    def _column(self, values: Sequence[float]) -> Tensor:
        return torch.tensor(values, dtype=torch.float64)


@dataclass(frozen=True, eq=False)
class LogSteps:
    """The d free parameters as a fit steps through them.

    ln of stiffness factors and of the damping ratio, which are uniform; parameters of effects from
    their centre in their prior's standard deviations.

    Attributes:
        parameters: all of them; those of effects come last.
        lower, upper: (d,) limits.
        mean: (d,) of the normal priors.
        precision: (d, d) of them, the inverse of their covariance; 0 where the prior is uniform.
    """

    parameters: Parameters
    lower: Tensor
    upper: Tensor
    mean: Tensor
    precision: Tensor

    @property
    def size(self) -> int:
        """d."""
        return len(self.lower)

    @cached_property
    def stories(self) -> int:
        """Number of free stiffness factors, which come first."""
        return self.parameters.of("stiffness").size

    @cached_property
    def first_size(self) -> int:
        """Position of the first parameter of an effect."""
        return self.parameters.of("stiffness", "damping").size

    def values(self, z: Tensor) -> Tensor:
        """All parameters (n, p) of unknowns z (n, d)."""
        known = self.parameters
        searched = z.exp()
        searched[:, known._normal] = known.centres + known.scales * z[:, known._normal]
        values = known.lower.expand(len(z), -1).clone()
        values[:, known._free] = searched
        return values

    def split(self, z: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """theta (n, p), zeta (n,), sizes (n, q) of unknowns z (n, d)."""
        found = self.parameters.split(self.values(z))
        return found.theta, found.zeta, found.sizes

    def sizes(self, values: Sequence[float] | Floats) -> Tensor:
        """Unknowns (q,) of the effects' parameters (q,)."""
        known = torch.as_tensor(np.asarray(values, dtype=np.float64))
        return (known - self.parameters.centres) / self.parameters.scales

    def inside(self, z: Tensor) -> Tensor:
        """Unknowns (..., d), those beyond a limit at it."""
        return torch.minimum(torch.maximum(z, self.lower), self.upper)

    def holding(self, values: Tensor) -> "LogSteps":
        """The same with the last unknowns held at values (h,)."""
        first = self.size - len(values)
        lower, upper, precision = self.lower.clone(), self.upper.clone(), self.precision.clone()
        lower[first:], upper[first:] = values, values
        precision[first:], precision[:, first:] = 0.0, 0.0
        return replace(self, lower=lower, upper=upper, precision=precision)

    def about(self, mean: Tensor, covariance: Tensor) -> "LogSteps":
        """The same with a normal prior of that mean (d,) and covariance (d, d)."""
        return replace(self, mean=mean, precision=torch.linalg.inv(covariance))

    def distance(self, z: Tensor) -> Tensor:
        """Squared distance of unknowns z (d,) from the normal priors' means, in their units."""
        away = z - self.mean
        return away @ self.precision @ away


def _plain(values: Sequence[float] | Tensor) -> list[float]:
    return values.tolist() if isinstance(values, Tensor) else list(values)


def theta_prior(building: Building) -> Parameters:
    """The prior of the stiffness factors, one a story."""
    ranges = factor_ranges(building)
    lower, upper = torch.tensor(list(ranges.values()), dtype=torch.float64).T
    return Parameters.uniform(tuple(ranges), lower, upper)


def damping_parameter(building: Building) -> Parameter:
    """The damping ratio: of zero width where the building knows it."""
    zeta, ratio = building.prior.zeta, building.damping.ratio
    known = zeta is None or building.damping.is_rayleigh
    low, high = (ratio, ratio) if zeta is None or known else (zeta.lower, zeta.upper)
    return Parameter(name="zeta", kind="damping", lower=low, upper=high, neutral=ratio)


def reduction_target(building: Building) -> ReductionTarget:
    """What a reduced model of a building must reproduce."""
    prior = theta_prior(building)
    return ReductionTarget(
        prior.lower.numpy(),
        prior.upper.numpy(),
        building.frequency_grid.frequencies_hz(),
        damping_parameter(building).lower * building.damping.lowest,
        building.reduction.tolerance,
    )


def effect_parameters(placed: Sequence[Placed], *, searched: bool = False) -> Parameters:
    """The effects' parameters with the priors of the catalogue.

    Within what is likely; or, where they are `searched` for, as far as they can be.
    """
    names = [f"{listed.label}.{p.name}" for listed in placed for p in listed.effect.parameters]
    pairs = zip(names, parameters_of(placed), strict=True)
    return Parameters(
        tuple(
            Parameter(
                name=name,
                kind="effect",
                lower=parameter.lower if searched else parameter.likely[0],
                upper=parameter.upper if searched else parameter.likely[1],
                neutral=parameter.neutral,
                centre=parameter.neutral,
                scale=parameter.scale,
            )
            for name, parameter in pairs
        )
    )


def own_errors(placed: Sequence[Placed], building: Building) -> Floats:
    """(q,) share of every parameter of effects by which the effects themselves may err."""
    # A mesh misjudges the size of any effect, in trials by .001 to .09.
    of_all = 0.0 if building.kind == "shear" else 0.03
    of_each = np.array(
        [listed.effect.own_error for listed in placed for _ in listed.effect.parameters]
    )
    return np.hypot(of_each, of_all)
