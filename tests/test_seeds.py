"""Streams of random numbers that share nothing."""

import numpy as np
import torch

from femupdate.seeds import spawn, torch_generator


def numbers(seed):
    return tuple(torch.rand(3, generator=torch_generator(seed)).tolist())


def test_streams_differ_from_one_another_and_from_those_of_other_seeds():
    """Seeds up to 1,100 and their first runs: 1009 seed + k met the stream of another seed."""
    streams = [
        stream for seed in range(1100) for stream in (seed, *spawn(seed, 3), *spawn(seed + 1, 1))
    ]
    drawn = {numbers(stream) for stream in streams}
    # The first stream of a seed is listed twice, as that of a seed and as its successor's.
    assert len(drawn) == 1100 * 4 + 1


def test_spawning_again_gives_the_same_streams():
    parent = spawn(3, 1)[0]
    first, again = spawn(parent, 2), spawn(parent, 3)[:2]
    assert [numbers(one) for one in first] == [numbers(one) for one in again]
    one, other = (np.random.default_rng(part).random(4) for part in (first[0], again[0]))
    np.testing.assert_array_equal(one, other)
