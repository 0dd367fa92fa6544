"""r-hat of chains that ran apart, against arviz and by hand."""

import numpy as np
import pytest

from femupdate.inference import r_hat


@pytest.mark.parametrize("chains", [2, 4])
@pytest.mark.parametrize("draws", [40, 51])
def test_it_is_that_of_arviz(chains, draws):
    """Chains of other centres, spreads and tails; an odd number of draws among them."""
    az = pytest.importorskip("arviz")
    rng = np.random.default_rng(chains + draws)
    values = rng.standard_normal((chains, draws, 3))
    values[0, :, 1] += 0.7
    values[-1, :, 2] = 3.0 * rng.standard_t(2, draws)
    expected = [float(az.rhat(np.ascontiguousarray(values[..., k]))) for k in range(3)]
    np.testing.assert_allclose(r_hat(values), expected, rtol=1e-10)


def test_chains_of_one_mean_and_two_spreads_differ():
    rng = np.random.default_rng(0)
    chains = rng.standard_normal((2, 500, 1)) * np.array([1.0, 4.0])[:, None, None]
    assert r_hat(chains)[0] > 1.1
    assert r_hat(chains[:1].repeat(2, axis=0) + 1e-9 * rng.random(chains.shape))[0] < 1.02


def test_a_chain_that_drifts_is_found_by_its_halves():
    rng = np.random.default_rng(1)
    drift = np.linspace(-1.5, 1.5, 400)[None, :, None] + rng.standard_normal((2, 400, 1))
    assert r_hat(drift)[0] > 1.2
