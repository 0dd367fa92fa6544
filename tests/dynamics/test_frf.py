"""FRFs against direct solutions of the equations of motion."""

import numpy as np
import pytest
import torch
from femupdate.benchmarks.modal_frf import complex_frf, log_frf

from femupdate.dynamics import ConstantDamping, RayleighDamping, System
from tests.chains import Chain, rayleigh
from tests.helpers import tensor

FREQUENCY = np.linspace(0.0, 20.0, 57)
# Equal masses m and springs theta_i 1000 m, one roof curve for all four (Katafygiotis and Lam 2002,
# as the four-story benchmark prints them, five digits).
EQUIVALENT = [
    [1.0, 1.0, 1.0, 1.0],
    [1.72206, 0.63637, 1.30144, 0.70116],
    [2.0, 1.0, 0.5, 1.0],
    [2.63969, 0.64718, 0.81280, 0.72018],
]


@pytest.mark.parametrize("zeta", [0.0, 0.005, 0.02, 0.3, None])
def test_damping_against_a_direct_solution(chain, thetas, zeta):
    """Of a ratio for all modes, and Rayleigh's, which takes no ratio."""
    law, ratio, damped = ConstantDamping(), zeta, {"zeta": zeta}
    if zeta is None:
        law, ratio = RayleighDamping(0.02, (1.0, 20.0)), 9.9
        damped = {"proportional": rayleigh(0.02, 1.0, 20.0)}
    data = System(chain.reduced()).modal_data(tensor(thetas))
    found = complex_frf(data, tensor(FREQUENCY), law, tensor([ratio] * 3))
    for row, theta in enumerate(thetas):
        expected = chain.at(theta, **damped).frf(FREQUENCY)
        # Near a resonance without damping the solution itself loses five digits.
        np.testing.assert_allclose(found[row], expected, rtol=1e-8, atol=1e-8)


def test_the_four_solutions_of_the_benchmark_have_one_roof_curve():
    equal = Chain(np.ones(4), np.full(4, 1000.0))
    frequency = 0.02 * np.arange(1, 1025)
    data = System(equal.reduced()).modal_data(tensor(EQUIVALENT))
    found = log_frf(data, tensor(frequency), RayleighDamping(0.02, (1.0, 20.0)), torch.zeros(4))
    roof, low = found[:, 3], found[:, 0]
    # Half a unit of the fifth printed digit, 5e-6 of 2.6, moves the curve by up to 2e-4 near peaks.
    np.testing.assert_allclose(roof, roof[:1].expand(4, -1), atol=2e-4)
    # The exact pair agrees to rounding, and the lowest floor tells all four apart.
    np.testing.assert_allclose(roof[2], roof[0], atol=1e-10)
    apart = (low[:, None] - low[None]).abs().amax(-1) + 9.0 * torch.eye(4)
    assert float(apart.min()) > 0.2


@pytest.mark.parametrize("batch", [1, 2, 3, 50])
def test_batches_equal_one_by_one(chain, batch):
    theta = tensor(np.random.default_rng(0).uniform(0.4, 2.5, (5, 4)))
    zeta = tensor(np.linspace(0.01, 0.05, 5))
    system, law = System(chain.reduced()), ConstantDamping()
    data = system.modal_data(theta)
    parts = list(system.log_frf_batches(data, theta, zeta, tensor(FREQUENCY), batch=batch))
    assert [len(part) for part in parts[:-1]] == [batch] * (len(parts) - 1)
    joined = torch.cat(parts)
    for row in range(5):
        one = log_frf(data[row : row + 1], tensor(FREQUENCY), law, zeta[row : row + 1])
        np.testing.assert_allclose(joined[row], one[0], atol=1e-12)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
def test_a_gpu_gives_the_same(tall_chain):
    theta = tensor(np.random.default_rng(3).uniform(0.4, 2.5, (6, 30)))
    frequency, zeta = tensor(FREQUENCY[1:]), tensor([0.02] * 6)
    solved = System(tall_chain.reduced()).modal_data(theta)
    here = log_frf(solved, frequency, ConstantDamping(), zeta)
    there = log_frf(solved.to("cuda"), frequency, ConstantDamping(), zeta).cpu()
    torch.testing.assert_close(there, here, rtol=0.0, atol=1e-8)
