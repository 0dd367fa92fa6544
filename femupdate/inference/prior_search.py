"""Starts for a search of a posterior's maxima, from the prior alone."""

from collections.abc import Callable

import torch
from torch import Tensor
from torch.quasirandom import SobolEngine

from femupdate.inference.parameters import Parameters
from femupdate.inference.thresholds import PRIOR_SEARCH
from femupdate.seeds import Seed, torch_generator


def best_of_prior(
    prior: Parameters, log_likelihood: Callable[[Tensor], Tensor], seed: Seed
) -> tuple[Tensor, int]:
    """Parameters (s, p) that are likely and apart from one another, and how many were tried.

    Args:
        prior: of the parameters.
        log_likelihood: (n,) of parameters (n, p).
        seed: of the points that are tried.
    """
    count = min(PRIOR_SEARCH.probes * prior.size, PRIOR_SEARCH.most_probes)
    scramble = int(torch.randint(2**31, (1,), generator=torch_generator(seed)))
    unit = SobolEngine(prior.size, scramble=True, seed=scramble).draw(count, dtype=torch.float64)
    unit = unit.clamp(1e-6, 1.0 - 1e-6)
    parameters = prior.from_unit(unit)
    value = log_likelihood(parameters).nan_to_num(nan=-torch.inf)
    chosen: list[int] = []
    for row in torch.argsort(value, descending=True).tolist():
        if len(chosen) == PRIOR_SEARCH.starts * prior.size:
            break
        away = (unit[chosen] - unit[row]).norm(dim=1)
        if bool((away > PRIOR_SEARCH.apart * prior.size**0.5).all()):
            chosen.append(row)
    return parameters[chosen], count
