"""Independent random streams from one seed.

Runs, second tries and stages that must not share random numbers each take a spawned stream
(`numpy.random.SeedSequence`); sums of a seed and a counter would meet the streams of other seeds.
"""

import numpy as np
import torch
from numpy.random import SeedSequence

from femupdate.arrays import Floats

Seed = int | SeedSequence
"""A seed as the user gives it, or a stream spawned from one."""


def spawn(seed: Seed, count: int) -> list[SeedSequence]:
    """`count` independent streams; the same ones whenever they are asked for."""
    parent = SeedSequence(seed) if isinstance(seed, int) else seed
    # `SeedSequence.spawn` counts its calls; a copy starts at the first stream each time.
    return SeedSequence(parent.entropy, spawn_key=parent.spawn_key).spawn(count)


# A training and its data set have one seed.
DATA_SET, TRAINING = 0, 1


def stream(seed: int, *number: int) -> SeedSequence:
    """The stream of a number, or of a number below another one, without those before it."""
    return SeedSequence(seed, spawn_key=number)


def even_points(count: int, size: int, seed: int) -> Floats:
    """Points (count, size) spread evenly over the unit cube: the first of a Sobol sequence."""
    # The statistics of scipy take a second to be imported, which few commands need.
    from scipy.stats import qmc

    sobol = qmc.Sobol(size, seed=np.random.default_rng(seed))
    # The sequence is balanced over powers of two only.
    return np.asarray(sobol.random_base2((count - 1).bit_length())[:count])


def torch_generator(seed: Seed, device: torch.device | str = "cpu") -> torch.Generator:
    """A generator at the start of a stream."""
    state = seed if isinstance(seed, int) else int(seed.generate_state(1, np.uint64)[0])
    return torch.Generator(device=device).manual_seed(state)
