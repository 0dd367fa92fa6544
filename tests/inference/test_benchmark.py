"""The four-story benchmark, roof alone: a posterior with four modes that is known exactly.

Its numbers come from long runs over the exact likelihood, which costs microseconds here.
"""

import numpy as np
import pytest
import torch
from femupdate.benchmarks.modal_frf import log_frf
from scipy.stats import norm

from femupdate.building import load_building, shear_operators
from femupdate.dynamics.damping import RayleighDamping
from femupdate.dynamics.reduced import reduce_lumped
from femupdate.dynamics.system import System
from femupdate.inference.frf_data import AT_ITS_WORD, base_logs
from femupdate.inference.likelihood import likelihood_of
from femupdate.inference.parameters import Parameter, Parameters
from femupdate.inference.smc import TemperedSmc
from femupdate.measurement.observation import Observation

MODES = np.array(
    [
        [1.0, 1.0, 1.0, 1.0],
        [1.72206, 0.63637, 1.30144, 0.70116],
        [2.0, 1.0, 0.5, 1.0],
        [2.63969, 0.64718, 0.81280, 0.72018],
    ]
)
SD = np.array(
    [
        [0.0071, 0.0058, 0.0045, 0.0067],
        [0.0073, 0.0052, 0.0048, 0.0022],
        [0.0269, 0.0114, 0.0036, 0.0028],
        [0.0117, 0.0046, 0.0043, 0.0037],
    ]
)
WEIGHT = np.array([0.337, 0.132, 0.346, 0.185])
LOG_EVIDENCE = -580.90
PRIOR = Parameters.uniform([f"theta_{k}" for k in range(1, 5)], [0.33] * 4, [3.0] * 4)
ZETA = 0.02
KNOWN = Parameters((Parameter(name="zeta", kind="damping", lower=ZETA, upper=ZETA),))


def damped(theta):
    """Parameters (n, 5) of factors (n, 4)."""
    return torch.from_numpy(np.column_stack([theta, np.full(len(theta), ZETA)]))


@pytest.fixture(scope="module")
def likelihood():
    building = load_building("shear_4dof")
    lumped = shear_operators(building)
    model = reduce_lumped(lumped.stiffness_terms, lumped.mass, lumped.floors)
    law = RayleighDamping(building.damping.ratio, building.damping.anchors)
    frequency = building.frequency_grid.frequencies_hz()
    assert (frequency.size, frequency[0], frequency[-1]) == pytest.approx((1024, 0.02, 20.48))
    truth = System(model).modal_data(torch.ones(1, 4))
    clean = log_frf(truth, torch.from_numpy(frequency), law, torch.zeros(1))[0, 3].numpy()
    noise = norm.rvs(size=1024, random_state=101) * 0.2
    shape = (1, 1024)
    observation = Observation(
        frequency, ("RF",), (clean + noise)[None], np.full(shape, 0.2), np.ones(shape, dtype=bool)
    )
    system = System(model, law)
    data = base_logs(observation, system, believed=AT_ITS_WORD)
    assert building.damping.ratio == ZETA
    return likelihood_of((data,), system, PRIOR + KNOWN)


def test_the_four_modes_fit_equally_well(likelihood):
    misfit = likelihood.raw(damped(MODES)).square().sum(1)
    # Chi-square with 1024 degrees of freedom, sd 45; five printed digits of theta move the peaks.
    assert float(misfit[0]) == pytest.approx(1024.0, abs=4 * 45.0)
    np.testing.assert_allclose(misfit, misfit[0], atol=0.5)
    away = damped(MODES + 6.0 * SD)
    assert bool((likelihood(away) < likelihood(damped(MODES)) - 5.0).all())


@pytest.mark.slow
def test_posterior_and_evidence_are_the_exact_ones(likelihood):
    result = TemperedSmc(likelihood.prior, likelihood).run(2000, 1)
    theta = result.theta[:, :4].numpy()
    mode = np.abs((theta[:, None] - MODES) / SD).max(-1).argmin(1)
    # Over runs of this size the log evidence spreads by .06, a mode's weight by .007 to .016, and
    # 250 to 700 particles give a standard deviation to 3 to 5 %.
    assert result.log_evidence == pytest.approx(LOG_EVIDENCE, abs=0.3)
    np.testing.assert_allclose(np.bincount(mode, minlength=4) / 2000, WEIGHT, atol=0.05)
    for k in range(4):
        np.testing.assert_allclose(theta[mode == k].std(0), SD[k], rtol=0.15)
    assert result.invalid == 0
    assert result.levels[-1].acceptance[0] > 0.5
