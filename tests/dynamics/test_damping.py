"""Damping laws against their definitions."""

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from femupdate.building import load_building
from femupdate.dynamics import ConstantDamping, RayleighDamping, damping_law


@settings(deadline=None)
@given(
    low=st.floats(0.05, 5.0),
    high=st.floats(5.1, 80.0),
    ratio=st.floats(1e-4, 0.5),
    swap=st.booleans(),
)
def test_rayleigh_damping_has_its_ratio_at_both_anchors_and_less_between(low, high, ratio, swap):
    law = RayleighDamping(ratio, (high, low) if swap else (low, high))
    omega = 2.0 * torch.pi * torch.tensor([[low, (low * high) ** 0.5, high]], dtype=torch.float64)
    found = law.ratio(omega, torch.zeros(1))[0]
    # The minimum, at the geometric mean, is 2 sqrt(r) / (1 + r) of the ratio, r = high / low.
    least = ratio * 2.0 * np.sqrt(high / low) / (1.0 + high / low)
    np.testing.assert_allclose(found, [ratio, least, ratio], rtol=1e-12)


def test_rayleigh_damping_is_that_of_a0_m_plus_a1_k(chain, tensor):
    """The diagonal of Phi^T C Phi is 2 zeta omega; off it there is nothing."""
    law = RayleighDamping(0.03, (1.0, 20.0))
    M, K = chain.matrices([0.5, 2.1, 0.8, 1.3])
    squared, modes = torch.linalg.eigh(
        tensor(np.linalg.inv(M) ** 0.5 @ K @ np.linalg.inv(M) ** 0.5)
    )
    modes = np.linalg.inv(M) ** 0.5 @ modes.numpy()
    C = law.mass_coefficient * M + law.stiffness_coefficient * K
    ratio = law.ratio(squared.sqrt()[None], torch.zeros(1))[0]
    np.testing.assert_allclose(
        modes.T @ C @ modes, np.diag(2.0 * ratio * squared.sqrt()), atol=1e-10
    )


def test_the_law_of_a_building_file():
    """Equal ratios at both anchors: a0 = 2 zeta w1 w2 / (w1 + w2), a1 = 2 zeta / (w1 + w2)."""
    law = damping_law(load_building("shear_4dof"))
    a0, a1 = 0.04 * 2 * np.pi * 20 / 21, 0.04 / (2 * np.pi * 21)
    omega = 2 * torch.pi * torch.tensor([[4.0, 30.0, 1.0, 20.0]], dtype=torch.float64)
    found = law.ratio(omega, torch.full((1,), torch.nan))
    np.testing.assert_allclose(found, a0 / (2 * omega) + a1 * omega / 2, rtol=1e-12)
    np.testing.assert_allclose(found[0, 2:], 0.02, rtol=1e-12)
    assert isinstance(damping_law(load_building("six_story_wall_frame")), ConstantDamping)


def test_constant_damping_gives_every_mode_the_ratio_of_its_sample():
    omega = torch.rand(3, 5, dtype=torch.float64)
    zeta = torch.tensor([0.01, 0.02, 0.05], dtype=torch.float64)
    found = ConstantDamping().ratio(omega, zeta)
    assert found.shape == omega.shape
    assert bool((found == zeta[:, None]).all())
