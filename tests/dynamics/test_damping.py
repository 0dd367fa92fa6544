"""Damping laws against their definitions."""

from dataclasses import replace

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import eigh

from femupdate import reduce
from femupdate.building import (
    from_document,
    load_building,
    mechanics_hash,
    shear_operators,
    to_document,
)
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


def test_the_law_of_a_building_file():
    """Equal ratios at both anchors: a0 = 2 zeta w1 w2 / (w1 + w2), a1 = 2 zeta / (w1 + w2)."""
    law = damping_law(load_building("shear_4dof"))
    a0, a1 = 0.04 * 2 * np.pi * 20 / 21, 0.04 / (2 * np.pi * 21)
    omega = 2 * torch.pi * torch.tensor([[4.0, 30.0, 1.0, 20.0]], dtype=torch.float64)
    found = law.ratio(omega, torch.full((1,), torch.nan))
    np.testing.assert_allclose(found, a0 / (2 * omega) + a1 * omega / 2, rtol=1e-12)
    np.testing.assert_allclose(found[0, 2:], 0.02, rtol=1e-12)
    assert isinstance(damping_law(load_building("six_story_wall_frame")), ConstantDamping)


def test_each_mode_has_its_own_ratio_by_its_frequency(tmp_path):
    """FRFs by matrices: C = M Phi diag(2 zeta omega) Phi^T M, with ratios of the file's modes."""
    document = to_document(load_building("shear_3dof"))
    plain = reduce(tmp_path, "shear_3dof").system
    theta = torch.ones(1, 3, dtype=torch.float64)
    none, zeta = torch.zeros(1, 0, dtype=torch.float64), torch.tensor([0.02], dtype=torch.float64)
    modes_hz = plain.modes(theta, none).frequency_hz[0].tolist()
    ratios = [0.01, 0.05, 0.03]
    document["damping"] = {
        "law": "modes",
        "ratio": 0.01,
        "ratios": ratios,
        "anchors": [f"{hz} Hz" for hz in modes_hz],
    }
    building = from_document(document)
    law = damping_law(building)
    hz = np.geomspace(0.1, 100.0, 50)
    omega = torch.from_numpy(2.0 * np.pi * hz)[None]
    expected = 2.0 * np.interp(np.log(hz), np.log(modes_hz), ratios)  # zeta is twice the file's
    np.testing.assert_allclose(law.ratio(omega, zeta)[0], expected, rtol=1e-9)
    assert building.damping.lowest == 1.0
    assert mechanics_hash(building) != mechanics_hash(load_building("shear_3dof"))
    terms, M = shear_operators(building)
    K = terms.sum(axis=0)
    squared, modes = eigh(K, M)
    C = M @ modes @ np.diag(2.0 * np.array(ratios) * np.sqrt(squared)) @ modes.T @ M
    grid = np.linspace(0.5, 12.0, 40)
    exact = [
        1.0 + w**2 * np.linalg.solve(K + 1j * w * C - w**2 * M, M.sum(axis=1))
        for w in 2.0 * np.pi * grid
    ]
    found = replace(plain, law=law).frf(theta, 0.5 * zeta, none, torch.from_numpy(grid))
    np.testing.assert_allclose(found[0].numpy().T, exact, rtol=1e-9)
