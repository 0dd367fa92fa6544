"""Scores of a prediction against their definitions."""

from types import SimpleNamespace

import numpy as np
import pytest

from femupdate.dynamics import compare


def test_scores_of_a_band_are_those_of_its_draws():
    """The score E|X - y| - E|X - X'| / 2 by a hundred thousand pairs of normal draws."""
    rng = np.random.default_rng(0)
    mean, sd, truth = (rng.normal(size=(1, 30)), np.full((1, 30), 0.7), rng.normal(size=(1, 30)))
    peaks = np.linspace(0.0, 10.0, 101)[:, None]
    band = SimpleNamespace(
        floors=("RF",), acceleration_mean=mean, acceleration_sd=sd, peak_acceleration=peaks
    )
    found = compare(band, mean, truth)["RF"]
    one, other = (mean + sd * rng.standard_normal((100_000, 30)) for _ in range(2))
    each = np.abs(one - truth).mean(axis=0) - 0.5 * np.abs(one - other).mean(axis=0)
    rms = np.sqrt((truth**2).mean())
    assert found["score"] == pytest.approx(each.mean() / rms, rel=0.01)
    assert found["within_band"] == np.mean(np.abs(mean - truth) <= 1.4)
    assert found["peak_within"] == (0.5 <= np.abs(truth).max() <= 9.5)
