"""What is known of a building's parameters before anything is measured, as its file says."""

from collections.abc import Sequence

import numpy as np
import torch

from femupdate.arrays import Floats
from femupdate.building.document import Building
from femupdate.building.parameters import factor_ranges
from femupdate.dynamics.snapshots import ReductionTarget
from femupdate.dynamics.system import parameters_of
from femupdate.effects.effect import Placed
from femupdate.inference.parameters import Parameter, Parameters


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
        damping_parameter(building).lower,
        building.reduction.tolerance,
    )


def size_names(placed: Sequence[Placed]) -> tuple[str, ...]:
    """Names of the parameters of effects, such as `added_mass@3F.size`."""
    return tuple(f"{one.label}.{p.name}" for one in placed for p in one.effect.parameters)


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
                lower=one.lower if searched else one.likely[0],
                upper=one.upper if searched else one.likely[1],
                neutral=one.neutral,
                centre=one.neutral,
                scale=one.scale,
            )
            for name, one in pairs
        )
    )


# Share by which a mesh misjudges the size of any effect; trials: .001 to .09.
_OF_A_MESH = 0.03


def own_errors(placed: Sequence[Placed], building: Building) -> Floats:
    """(q,) share of every parameter of effects by which the effects themselves may err."""
    of_all = 0.0 if building.kind == "shear" else _OF_A_MESH
    own = np.array([one.effect.own_error for one in placed for _ in one.effect.parameters])
    return np.hypot(own, of_all)
