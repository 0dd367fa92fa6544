"""The data set: the same samples by the same seed, whatever the pieces in which it is solved."""

import torch

from femupdate.surrogate import compute_dataset
from tests.helpers import Recorded

PLAN = {"samples": 2600, "modes": 2, "top_hz": 12.8}


def same(one, other):
    return torch.equal(one.theta, other.theta) and all(
        torch.equal(getattr(one.modal, name), getattr(other.modal, name))
        for name in ("omega", "effect", "residual")
    )


def test_a_seed_gives_one_data_set(model, prior):
    told = Recorded()
    one = compute_dataset(model, prior, **PLAN, seed=3, progress=told)
    assert told.counts == [1, 1]  # pieces of 2500 and of 100
    assert len(one.modal) == len(one) == 2600
    assert same(compute_dataset(model, prior, **PLAN, seed=3), one)
    assert not same(compute_dataset(model, prior, **PLAN, seed=4), one)
    last = model.modal_data(one.theta[-5:], modes=2, top_frequency_hz=12.8)
    torch.testing.assert_close(one.modal.omega[-5:].double(), last.omega, rtol=1e-6, atol=0.0)
