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
