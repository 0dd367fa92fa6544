"""What an effect changes that an engineer would notice: natural frequencies and responses."""

from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.discrepancy.fit import Fit
from femupdate.inference.likelihood import Likelihood


@dataclass(frozen=True)
class Consequence:
    """Largest changes by an effect of its fitted size.

    Attributes:
        frequency: of a natural frequency in the measured band, all else as it is, as a share.
        response: of what a floor reads (rms over the band or the modes, as a share of it), against
            the model without the effect as it is fitted; of an instrument, what it adds.
    """

    frequency: float
    response: float

    def matters(self, frequency: float, response: float) -> bool:
        """Whether either change is at least as large as given."""
        return self.frequency >= frequency or self.response >= response


def consequence(problem: Likelihood, base: Fit, fitted: Fit) -> Consequence:
    """What the last effect of a fit changes, beside the model without it as it is fitted."""
    placed, where = fitted.placed[-1], fitted.steps
    if placed.exchange:
        return Consequence(0.0, 1.0)
    theta, zeta, sizes = fitted.split
    count = len(placed.effect.parameters)
    without = sizes.clone()
    without[:, -count:] = where.centres[-count:]
    both = [(theta, zeta, one) for one in (sizes, without)]
    instrument = placed.effect.instrument
    system, known = (fitted.system, both[1]) if instrument else (base.system, base.split)
    response = max(
        data.changed(
            data.predicted(system, *known), data.predicted(fitted.system, *both[0]), instrument
        )
        for data in problem.data
    )
    if instrument:
        return Consequence(0.0, response)
    moved = max(_moved(problem, fitted, both, level) for level in problem.levels)
    return Consequence(moved, response)


def _moved(
    problem: Likelihood, fitted: Fit, both: list[tuple[Tensor, Tensor, Tensor]], level: float
) -> float:
    """Largest change of a natural frequency up to the top of the band, at one level of motion."""
    found = []
    for theta, zeta, sizes in both:
        own = fitted.system.at_level(theta, zeta, sizes, level)[0]
        frequency = fitted.system.modes(own, sizes).frequency_hz[0]
        found.append(frequency[torch.isfinite(frequency)])
    count = min(len(found[0]), len(found[1]))
    first, second = (one.sort().values[:count] for one in found)
    seen = (second > 0.0) & (second <= problem.top_hz)
    return float((first[seen] / second[seen] - 1.0).abs().max()) if seen.any() else 0.0
