"""Changes between two posteriors: against brute force, false alarms, and what is seen."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from femupdate.inference.change import NAMED, NONE, SCALE, changes

COUNT = 4


def states(rng, sd, shift):
    """Draws of two posteriors of ln theta whose centres err as their covariances say."""
    mixing = rng.normal(size=(COUNT, COUNT))
    root = np.linalg.cholesky(sd**2 * (np.eye(COUNT) + 0.5 * mixing @ mixing.T / COUNT))
    centres = (root @ rng.normal(size=COUNT), root @ rng.normal(size=COUNT) + shift)
    return [centre + rng.normal(size=(500, COUNT)) @ root.T for centre in centres]


def test_probabilities_follow_from_bayes_theorem():
    """Two factors; the evidence of every set straight from the normal density."""
    rng = np.random.default_rng(1)
    before = rng.normal(size=(300, 2)) @ np.array([[0.02, 0.01], [0.0, 0.03]])
    after = rng.normal(size=(400, 2)) * 0.02 + [0.0, -0.09]
    shift = after.mean(axis=0) - before.mean(axis=0)
    covariance = np.cov(before.T) + np.cov(after.T)
    one = 1.0 - NONE**0.5
    spreads = {(): np.zeros((2, 2)), (0,): np.diag([1, 0]), (1,): np.diag([0, 1])}
    spreads |= {(0, 1): np.eye(2), "alike": np.ones((2, 2))}
    prior = {(): (1 - one) ** 2, (0, 1): one**2}
    weight = {
        key: prior.get(key, one * (1 - one))
        * multivariate_normal(cov=covariance + SCALE**2 * spread).pdf(shift)
        for key, spread in spreads.items()
    }
    total = sum(weight.values())
    found = changes(before, after)
    assert found.none == pytest.approx(weight[()] / total)
    assert found.alike == pytest.approx(weight["alike"] / total)
    second = (weight[(1,)] + weight[(0, 1)] + weight["alike"]) / total
    assert found.probability[1] == pytest.approx(second)


@pytest.mark.parametrize("sd", [0.003, 0.03])
def test_fifty_pairs_without_a_change_raise_at_most_two_alarms(sd):
    rng = np.random.default_rng(2)
    alarms = sum((changes(*states(rng, sd, 0.0)).probability >= NAMED).any() for _ in range(50))
    assert alarms <= 2


def test_a_story_softened_by_a_tenth_is_named_and_measured():
    rng = np.random.default_rng(3)
    shift = np.log([1.0, 0.9, 1.0, 1.0])
    found = [changes(*states(rng, 0.005, shift)) for _ in range(50)]
    assert sum(list(one.probability >= NAMED) == [False, True, False, False] for one in found) >= 47
    errors = np.array([(one.size[1] - shift[1]) / one.size_sd[1] for one in found])
    assert abs(errors.mean()) < 0.5
    assert 0.7 < errors.std() < 1.3


def test_what_is_visible_is_named_and_less_is_not():
    rng = np.random.default_rng(4)
    before = rng.normal(size=(4000, COUNT)) * 0.01
    before -= before.mean(axis=0)
    visible = changes(before, before).visible
    for factor, named in ((1.1, True), (0.8, False)):
        shifted = before + np.eye(COUNT)[2] * factor * visible[2]
        assert (changes(before, shifted).probability[2] >= NAMED) == named
