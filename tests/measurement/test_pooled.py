"""Several runs as one observation, and whether they agree: by hand, and by simulated noise."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kstest

from femupdate.measurement import (
    Observation,
    agreement,
    differences,
    independent_share,
    pooled,
    select_floors,
)

FLOORS = ("2F", "3F", "RF")
FREQUENCY = 0.1 * np.arange(1, 101)


def run(rng, floors=FLOORS, holes=0.2, **others):
    """Random values, noise and gaps; NaN in half of the gaps."""
    shape = (len(floors), FREQUENCY.size)
    valid = rng.random(shape) >= holes
    nothing = ~valid & (rng.random(shape) < 0.5)
    return Observation(
        FREQUENCY,
        floors,
        np.where(nothing, np.nan, rng.normal(size=shape)),
        np.where(nothing, np.nan, rng.uniform(0.05, 0.5, shape)),
        valid,
        **others,
    )


def log_likelihood(observation, predicted, floors=FLOORS):
    """As the data-space likelihood has it, point by point; `predicted` of all floors."""
    rows = [floors.index(name) for name in observation.floors]
    whitened = (observation.log_frf - predicted[rows]) / observation.noise_sd
    squares = (whitened[observation.valid] ** 2).sum()
    if observation.scatter is not None:
        squares += observation.scatter[observation.valid].sum()
    return -0.5 * independent_share(observation) * squares


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([1, 2, 3, 5]), st.booleans(), st.booleans())
def test_its_likelihood_is_the_product_of_theirs(seed, count, histories, floors_differ):
    """Whatever the noise, gaps, floors and resolutions: at several random models."""
    rng = np.random.default_rng(seed)
    runs = []
    for _ in range(count):
        chosen = [name for name in FLOORS if not floors_differ or rng.random() < 0.6] or ["3F"]
        width = rng.choice([None, 0.05, 0.15, 0.4])
        coherence = rng.random((len(chosen), 100)) if histories and rng.random() < 0.7 else None
        runs.append(
            run(rng, tuple(chosen), rng.uniform(0, 0.9), resolution_hz=width, coherence=coherence)
        )
    together = pooled(runs, FLOORS)
    for predicted in rng.normal(size=(3, 3, 100)):
        expected = sum(log_likelihood(one, predicted) for one in runs)
        assert log_likelihood(together, predicted) == pytest.approx(expected, rel=1e-10)


def test_two_runs_by_hand():
    """Means 1 and 2 with noise .1 and .2: precision 125, mean 1.2, scatter 1 / (.1^2 + .2^2)."""
    shape = (1, 100)
    whole = np.ones(shape, dtype=bool)
    one = Observation(FREQUENCY, ("RF",), np.full(shape, 1.0), np.full(shape, 0.1), whole)
    other = replace(one, log_frf=np.full(shape, 2.0), noise_sd=np.full(shape, 0.2), source="b.csv")
    other = replace(other, valid=FREQUENCY[None] > 2.0)
    both = pooled([replace(one, source="a.csv"), other], FLOORS)
    seen = FREQUENCY > 2.0
    np.testing.assert_allclose(both.log_frf[0], np.where(seen, 1.2, 1.0))
    np.testing.assert_allclose(both.noise_sd[0], np.where(seen, 125**-0.5, 0.1))
    np.testing.assert_allclose(both.scatter[0], np.where(seen, 1 / 0.05, 0.0), atol=1e-12)
    assert both.valid.all()
    assert both.floors == ("RF",)
    assert both.source == "a.csv, b.csv"
    assert both.resolution_hz is None


def test_floors_come_bottom_to_top_and_a_floor_of_one_run_is_its_own():
    rng = np.random.default_rng(0)
    upper, lower = run(rng, ("3F", "RF")), run(rng, ("2F", "3F"))
    both = pooled([upper, lower], FLOORS)
    assert both.floors == FLOORS
    for whole, name in ((upper, "RF"), (lower, "2F")):
        found, own = (select_floors(each, [name]) for each in (both, whole))
        np.testing.assert_allclose(found.log_frf, own.log_frf, rtol=1e-12)
        np.testing.assert_allclose(found.noise_sd, own.noise_sd, rtol=1e-12)
        np.testing.assert_array_equal(found.valid, own.valid)
    middle = select_floors(both, ["3F"])
    np.testing.assert_array_equal(middle.valid, upper.valid[:1] | lower.valid[1:])


def test_resolutions_keep_the_second_moment_of_the_windows():
    """.1 and .3 Hz, as sure of a point: sqrt of the mean square; a table has no width."""
    rng = np.random.default_rng(2)
    sd, coherence = np.full((3, 100), 0.1), rng.random((3, 100))
    fine = replace(run(rng, holes=0.0), noise_sd=sd, resolution_hz=0.1, coherence=coherence)
    # Noise of a third of the variance makes up for the third of the points that err alone.
    coarse = replace(fine, resolution_hz=0.3, noise_sd=sd / 3**0.5, coherence=coherence**2)
    both = pooled([fine, coarse], FLOORS)
    assert both.resolution_hz == pytest.approx(0.05**0.5)
    np.testing.assert_allclose(both.coherence, (coherence + coherence**2) / 2)
    assert pooled([fine, fine], FLOORS).resolution_hz == pytest.approx(0.1)
    alone = sd / independent_share(fine) ** 0.5
    table = replace(fine, resolution_hz=None, coherence=None, noise_sd=alone)
    assert pooled([fine, table], FLOORS).resolution_hz == pytest.approx(0.1 / 2**0.5)
    assert pooled([table, table], FLOORS).coherence is None


def test_one_run_stays_as_it_is():
    one = run(np.random.default_rng(3))
    assert pooled([one], FLOORS) is one


def measured(rng, truth, sd=0.1, source="a.csv"):
    """A truth (3, 100) with noise."""
    values = truth + sd * rng.normal(size=truth.shape)
    everywhere = np.ones(truth.shape, dtype=bool)
    return Observation(
        FREQUENCY, FLOORS, values, np.full(truth.shape, sd), everywhere, source=source
    )


def test_differences_of_runs_that_agree_are_chi_square():
    rng, truth = np.random.default_rng(4), np.random.default_rng(5).normal(size=(3, 100))
    runs = [[measured(rng, truth, sd) for sd in (0.1, 0.2)] for _ in range(60)]
    levels, ratios, *_ = zip(
        *(one for pair in runs for one in differences(pair, FLOORS)), strict=True
    )
    assert kstest(levels, "uniform").pvalue > 0.01
    assert np.mean(np.square(ratios)) == pytest.approx(1.0, abs=0.04)
    # One in a thousand: none of sixty but once in seventeen.
    told = [agreement(pair, FLOORS) for pair in runs]
    assert sum("They agree: their differences are " in text for text in told) >= 59


def test_a_run_that_differs_is_named_with_floor_and_band():
    """The second of three, at the roof from 3 to 5 Hz, by three times the noise."""
    rng, truth = np.random.default_rng(6), np.zeros((3, 100))
    moved = truth.copy()
    moved[2, (FREQUENCY > 3.0) & (FREQUENCY < 5.0)] = 0.3
    runs = [
        measured(rng, values, source=name)
        for values, name in ((truth, "a.csv"), (moved, "b.csv"), (truth, "c.csv"))
    ]
    told = agreement(runs, FLOORS)
    assert "They do not agree: b.csv differs from a.csv, c.csv at RF" in told
    low, high = map(float, re.search(r"at RF, (\S+) to (\S+) Hz", told).groups())
    assert low < 5.0
    assert high > 3.0
    assert int(re.search(r"([+-]\d+) % on average", told)[1]) > 10
    assert "each at its level" in told
