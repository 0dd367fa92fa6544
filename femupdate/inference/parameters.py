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
from femupdate.building.document import Building
from femupdate.building.parameters import factor_ranges
from femupdate.dynamics.snapshots import ReductionTarget
from femupdate.dynamics.system import parameters_of
from femupdate.effects.effect import Placed

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

    entries: tuple[Parameter, ...]
    device: torch.device | str = "cpu"

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

    def to(self, device: torch.device | str) -> "Parameters":
        """The same on another device."""
        return replace(self, device=device)

    def split(self, values: Tensor) -> Values:
        """Parameters (n, p) by their kinds."""
        zeta = values[:, self.columns("damping")].flatten()
        return Values(values[:, self.columns("stiffness")], zeta, values[:, self.columns("effect")])

    def sample(self, count: int, generator: torch.Generator) -> Tensor:
        """Draw (count, p) from the prior."""
        unit = torch.rand(
            count, self.size, generator=generator, dtype=torch.float64, device=self.device
        )
        return self.from_unit(unit)

    def from_unit(self, unit: Tensor) -> Tensor:
        """Map the unit cube (n, d) to the parameters (n, p), evenly in probability."""
        free, normal = self._free, self._normal
        inside_limits = free.lower + (free.upper - free.lower) * unit
        if normal.columns:
            share = normal.low + (normal.high - normal.low) * unit[..., normal.columns]
            # At a limit far out a share may round to one.
            scaled = torch.special.ndtri(share.clamp(1e-300, 1.0 - 1e-16))
            inside = normal.centre + normal.scale * scaled
            inside_limits = inside_limits.clone()
            inside_limits[..., normal.columns] = inside.clamp(normal.lower, normal.upper)
        if self.size == len(self.entries):
            return inside_limits
        values = self.lower.expand(*unit.shape[:-1], -1).clone()
        values[..., free.columns] = inside_limits
        return values

    def to_unit(self, values: Tensor) -> Tensor:
        """Map the parameters (n, p) to the unit cube (n, d)."""
        free, normal = self._free, self._normal
        inside_limits = values[..., free.columns]
        unit = (inside_limits - free.lower) / (free.upper - free.lower)
        scaled = (inside_limits[..., normal.columns] - normal.centre) / normal.scale
        share = (torch.special.ndtr(scaled) - normal.low) / (normal.high - normal.low)
        unit[..., normal.columns] = share
        return unit

    def from_normal(self, xi: Tensor) -> Tensor:
        """Map standard normal coordinates (n, d) to the parameters (n, p)."""
        return self.from_unit(torch.special.ndtr(xi))

    def to_normal(self, values: Tensor) -> Tensor:
        """Map the parameters to standard normal coordinates; bounds go to +-infinity."""
        return torch.special.ndtri(self.to_unit(values))

    def log_density_normal(self, xi: Tensor) -> Tensor:
        """Log prior density (n,) of standard normal coordinates, up to a constant."""
        return -0.5 * (xi**2).sum(-1)

    def log_density(self, values: Tensor) -> Tensor:
        """Log prior density (n,) of the free ones among parameters (n, p), inside the bounds."""
        free, normal = self._free, self._normal
        flat = -(free.upper - free.lower).log().repeat(len(values), 1)
        scaled = (values[:, free.columns][:, normal.columns] - normal.centre) / normal.scale
        density = -0.5 * scaled**2 - 0.5 * math.log(2.0 * math.pi) - normal.scale.log()
        flat[:, normal.columns] = density - (normal.high - normal.low).log()
        return flat.sum(-1)

    @cached_property
    def steps(self) -> "LogSteps":
        """The free ones as a fit steps through them."""
        return LogSteps.of(self)

    @cached_property
    def _free(self) -> "_Free":
        """The free parameters among all."""
        chosen = [k for k, entry in enumerate(self.entries) if entry.free]
        ends = (self._column([getattr(self.entries[k], end) for k in chosen]) for end in _ENDS)
        return _Free(chosen, *ends)

    @cached_property
    def _normal(self) -> "_Normal":
        """Those with a normal prior among the free ones."""
        free = [entry for entry in self.entries if entry.free]
        chosen = [k for k, entry in enumerate(free) if math.isfinite(entry.scale)]
        lower, upper, centre, scale = (
            self._column([getattr(free[k], name) for k in chosen])
            for name in (*_ENDS, "centre", "scale")
        )
        low, high = (torch.special.ndtr((end - centre) / scale) for end in (lower, upper))
        return _Normal(chosen, lower, upper, centre, scale, low, high)

    def _column(self, values: Sequence[float]) -> Tensor:
        return torch.tensor(values, dtype=torch.float64, device=self.device)


_ENDS = ("lower", "upper")


@dataclass(frozen=True)
class _Free:
    """Columns among all parameters, and bounds (d,)."""

    columns: list[int]
    lower: Tensor
    upper: Tensor


@dataclass(frozen=True)
class _Normal:
    """Columns among the free parameters, bounds, centre and scale of normal priors, and the
    normal's probability below either end."""

    columns: list[int]
    lower: Tensor
    upper: Tensor
    centre: Tensor
    scale: Tensor
    low: Tensor
    high: Tensor


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

    @staticmethod
    def of(parameters: Parameters) -> "LogSteps":
        """Those of parameters with their own priors."""
        free, normal = parameters._free, parameters._normal
        lower, upper, scaled = free.lower.log(), free.upper.log(), torch.zeros_like(free.lower)
        lower[normal.columns] = (normal.lower - normal.centre) / normal.scale
        upper[normal.columns] = (normal.upper - normal.centre) / normal.scale
        scaled[normal.columns] = 1.0
        return LogSteps(parameters, lower, upper, torch.zeros_like(scaled), torch.diag(scaled))

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

    @property
    def centres(self) -> Tensor:
        """(q,) means of the priors of the effects' parameters."""
        return self.parameters._normal.centre

    @property
    def scales(self) -> Tensor:
        """(q,) standard deviations of these."""
        return self.parameters._normal.scale

    @property
    def has_zeta(self) -> bool:
        """Whether the damping ratio is an unknown."""
        return self.first_size > self.stories

    def values(self, z: Tensor) -> Tensor:
        """All parameters (n, p) of unknowns z (n, d)."""
        free, normal = self.parameters._free, self.parameters._normal
        searched = z.exp()
        searched[:, normal.columns] = normal.centre + normal.scale * z[:, normal.columns]
        values = self.parameters.lower.expand(len(z), -1).clone()
        values[:, free.columns] = searched
        return values

    def split(self, z: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """theta (n, p), zeta (n,), sizes (n, q) of unknowns z (n, d)."""
        found = self.parameters.split(self.values(z))
        return found.theta, found.zeta, found.sizes

    def sizes(self, values: Sequence[float] | Floats) -> Tensor:
        """Unknowns (q,) of the effects' parameters (q,)."""
        normal = self.parameters._normal
        known = torch.as_tensor(np.asarray(values, dtype=np.float64))
        return (known - normal.centre) / normal.scale

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
    """The prior of the stiffness factors, one a story or one a story and kind of member."""
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


def size_names(placed: Sequence[Placed]) -> tuple[str, ...]:
    """Names of the parameters of effects, such as `added_mass@3F.size`."""
    return tuple(f"{listed.label}.{p.name}" for listed in placed for p in listed.effect.parameters)


def effect_parameters(placed: Sequence[Placed], *, searched: bool = False) -> Parameters:
    """The effects' parameters with the priors of the catalogue.

    Within what is likely; or, where they are `searched` for, as far as they can be.
    """
    pairs = zip(size_names(placed), parameters_of(placed), strict=True)
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


# Share by which a mesh misjudges the size of any effect; trials: .001 to .09.
_OF_A_MESH = 0.03


def own_errors(placed: Sequence[Placed], building: Building) -> Floats:
    """(q,) share of every parameter of effects by which the effects themselves may err."""
    of_all = 0.0 if building.kind == "shear" else _OF_A_MESH
    of_each = np.array(
        [listed.effect.own_error for listed in placed for _ in listed.effect.parameters]
    )
    return np.hypot(of_each, of_all)
