"""Weights: effective size, increments, resampling."""

import numpy as np
import pytest
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from femupdate.inference.importance import effective_sample_size, next_increment, systematic_rows

gains = st.lists(st.one_of(st.floats(-1e4, 1e4), st.just(-np.inf)), min_size=2, max_size=60).filter(
    lambda values: max(values) > -np.inf
)


def test_effective_sample_size_by_hand():
    weight = torch.tensor([0.5, 0.25, 0.25, 0.0], dtype=torch.float64)
    assert effective_sample_size(weight.log() + 700.0) == pytest.approx(1.0 / 0.375, rel=1e-12)
    assert effective_sample_size(torch.zeros(17)) == pytest.approx(17.0)
    assert effective_sample_size(torch.tensor([0.0, -torch.inf, -torch.inf])) == pytest.approx(1.0)


@settings(deadline=None)
@given(values=gains, most=st.floats(1e-6, 1.0), share=st.floats(0.1, 0.95))
def test_the_increment_keeps_the_effective_size_it_promises(values, most, share):
    gain = torch.tensor(values, dtype=torch.float64)
    step = next_increment(gain, most, share)
    assert 0.0 < step <= max(most, 1e-12)
    possible = int(torch.isfinite(gain).sum())
    if step > 1e-12:
        assert effective_sample_size(step * gain) >= share * len(gain) * (1.0 - 1e-9)
    else:  # even the smallest step loses too many: they were impossible from the start
        assert effective_sample_size(1e-11 * gain) < share * len(gain)
    # It is the largest such step, to a thousandth.
    assume(step < most)
    assert effective_sample_size(1.002 * step * gain) < share * len(gain) * (1.0 + 1e-9)
    assert possible >= 1


weights = st.lists(st.one_of(st.just(0.0), st.floats(1e-6, 1.0)), min_size=1, max_size=40).filter(
    lambda values: sum(values) > 0
)


@settings(deadline=None)
@given(values=weights, seed=st.integers(0, 2**31))
def test_every_row_comes_floor_or_ceil_of_its_share(values, seed):
    weight = torch.tensor(values, dtype=torch.float64)
    weight = weight / weight.sum()
    rows = systematic_rows(weight, torch.Generator().manual_seed(seed))
    assert len(rows) == len(weight)
    counts = np.bincount(rows.numpy(), minlength=len(weight))
    share = len(weight) * weight.numpy()
    assert (counts >= np.floor(share - 1e-9)).all()
    assert (counts <= np.ceil(share + 1e-9)).all()
    assert (counts[weight.numpy() == 0.0] == 0).all()
    assert (np.diff(rows.numpy()) >= 0).all()


def test_resampling_is_unbiased():
    weight = torch.tensor([0.03, 0.4, 0.0, 0.22, 0.35], dtype=torch.float64)
    generator, tries = torch.Generator().manual_seed(4), 4000
    rows = torch.cat([systematic_rows(weight, generator) for _ in range(tries)])
    mean = np.bincount(rows.numpy(), minlength=5) / tries
    # A count of floor or ceil has a variance of at most 1/4: five standard errors.
    np.testing.assert_allclose(mean, 5.0 * weight, atol=5.0 * 0.5 / tries**0.5)
