"""What an effect changes that an engineer would notice: natural frequencies and responses."""

from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.discrepancy.fit import Fit
from femupdate.discrepancy.problem import Problem


@dataclass(frozen=True)
class Consequence:
    """Largest changes by an effect of its fitted size.

    Attributes:
        frequency: of a natural frequency in the measured band, all else as it is, as a share.
        response: of |H| of a floor (rms over the band, as a share of |H|), against the model
            without the effect as it is fitted; of an instrument, what it adds to the readings.
    """

    frequency: float
    response: float

    def matters(self, frequency: float, response: float) -> bool:
        """Whether either change is at least as large as given."""
        return self.frequency >= frequency or self.response >= response


def consequence(problem: Problem, base: Fit, fitted: Fit) -> Consequence:
    """What the last effect of a fit changes, beside the model without it as it is fitted."""
    placed, where = fitted.placed[-1], fitted.coordinates
    if placed.exchange:
        return Consequence(0.0, 1.0)
    theta, zeta, sizes = where.split(fitted.z[None], problem.fixed_zeta)
    count = len(placed.effect.parameters)
    without = sizes.clone()
    without[:, -count:] = where.neutral[-count:]
    both = [(theta, zeta, one) for one in (sizes, without)]
    frf = [problem.predicted(fitted.system, *one)[0, list(problem.rows)] for one in both]
    valid = torch.isfinite(problem.sd)
    if placed.effect.instrument:
        change = torch.where(valid, (frf[0] / frf[1] - 1.0).abs() ** 2, 0.0)
        response = float((change.sum(1) / valid.sum(1).clamp_min(1)).sqrt().max())
        return Consequence(0.0, response)
    plain = problem.predicted(base.system, *base.split)[0, list(problem.rows)].abs()
    change = torch.where(valid, (frf[0].abs() - plain) ** 2, 0.0).sum(1)
    whole = torch.where(valid, plain**2, 0.0).sum(1).clamp_min(1e-300)
    moved = max(
        _moved(problem, fitted, both, level) for level in {block.level for block in problem.blocks}
    )
    return Consequence(moved, float((change / whole).sqrt().max()))


def _moved(
    problem: Problem, fitted: Fit, both: list[tuple[Tensor, Tensor, Tensor]], level: float
) -> float:
    """Largest change of a natural frequency up to the top of the band, at one level of motion."""
    found = []
    for theta, zeta, sizes in both:
        own = fitted.system.at_level(theta, zeta, sizes, level)[0]
        frequency = fitted.system.modes(own, sizes).frequency_hz[0]
        found.append(frequency[torch.isfinite(frequency)])
    count = min(len(found[0]), len(found[1]))
    first, second = (one.sort().values[:count] for one in found)
    seen = (second > 0.0) & (second <= float(problem.frequency_hz.max()))
    return float((first[seen] / second[seen] - 1.0).abs().max()) if seen.any() else 0.0
