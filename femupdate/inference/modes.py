"""Which separate modes the draws of a posterior lie in, found without knowing them.

A mixture of Gaussians is fitted; components belong to one mode unless the density between them dips
deeply (merging of components by the ridge between them, after Hennig 2010, Adv. Data Anal.
Classif. 4, 3). Of a sheet that bends in many dimensions the Gaussians are separate where the draws
are not: modes are told apart only where the draws themselves dip along Fisher's discriminant.
"""

import math
from itertools import combinations

import torch
from torch import Tensor

from femupdate.inference.importance import GaussianMixture, fit_mixture
from femupdate.seeds import torch_generator

_PLACES = 21  # points between two groups at which the density is looked at


def separate_modes(x: Tensor) -> Tensor:
    """Return the mode (n,) of every draw of x (n, p), 0 for the heaviest.

    Args:
        x: in coordinates of comparable size, float64.
    """
    generator = torch_generator(0, x.device)
    some = x[torch.randperm(len(x), generator=generator, device=x.device)[:4000]]
    distinct = len(torch.unique(some[:, 0]))
    components = max(1, min(8, distinct // (10 * (x.shape[1] + 1))))
    # Of few draws one fit may join two modes.
    fits = [
        fit_mixture(some, components, generator, iterations=100)
        for _ in range(1 if len(some) > 1000 else 6)
    ]
    mixture = max(fits, key=lambda fit: float(fit.log_density(some).mean()))
    group = torch.tensor(_joined(mixture), device=x.device)
    member = group[mixture.component_log_density(x).argmax(dim=1)]
    return _numbered(x, _seen_apart(x, member))


def _joined(mixture: GaussianMixture) -> list[int]:
    """The group of every component."""
    count = len(mixture.mean)
    peak = mixture.log_density(mixture.mean).tolist()
    share = torch.linspace(0.0, 1.0, _PLACES, dtype=mixture.mean.dtype, device=mixture.mean.device)
    saddles = []
    for one, other in combinations(range(count), 2):
        path = torch.lerp(mixture.mean[one], mixture.mean[other], share[:, None])
        saddles.append((float(mixture.log_density(path).min()), one, other))
    group = list(range(count))
    for saddle, one, other in sorted(saddles, reverse=True):
        a, b = group[one], group[other]
        if a != b and saddle > min(peak[a], peak[b]) + math.log(0.1):
            group = [a if g == b else g for g in group]
            peak[a] = max(peak[a], peak[b])
    return group


def _seen_apart(x: Tensor, member: Tensor) -> Tensor:
    """Groups (n,) with those joined between which the draws do not dip."""
    labels = torch.unique(member).tolist()
    for one, other in combinations(labels, 2):
        first, second = x[member == one], x[member == other]
        if min(len(first), len(second)) > 1 and not _dips(first, second):
            return _seen_apart(x, torch.where(member == other, one, member))
    return member


def _dips(first: Tensor, second: Tensor) -> bool:
    """Whether few draws of two groups lie between them, along Fisher's linear discriminant."""
    inside = torch.atleast_2d(torch.cov(first.T) + torch.cov(second.T))
    inside = inside + 1e-9 * inside.diagonal().mean() * torch.eye(len(inside)).to(inside)
    direction = torch.linalg.solve(inside, second.mean(0) - first.mean(0))
    low, high = first @ direction, second @ direction
    width = 0.3 * min(float(low.std()), float(high.std())) + 1e-12
    ends = (float(low.mean()), float(high.mean()))
    places = torch.linspace(*ends, _PLACES, dtype=low.dtype, device=low.device)
    offset = (places[:, None] - torch.cat([low, high])) / width
    density = torch.exp(-0.5 * offset.square()).mean(1)
    least = int(density.argmin())
    peaks = min(density[: least + 1].max(), density[least:].max())
    return bool(density[least] < 0.5 * peaks)


def _numbered(x: Tensor, member: Tensor) -> Tensor:
    """Modes by weight, the smallest ones given to their neighbours."""
    labels, counts = torch.unique(member, return_counts=True)
    labels = labels[counts.argsort(descending=True)]
    least = min(max(0.01 * len(x), 20), int(counts.max()))
    kept = labels[: int((counts >= least).sum())]
    centre = torch.stack([x[member == label].mean(dim=0) for label in kept])
    number = torch.cdist(x, centre).argmin(dim=1)
    for place, label in enumerate(kept):
        number[member == label] = place
    return number
