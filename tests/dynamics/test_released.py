"""A base that forces move: against dense equations of the free whole, and a full frame."""

import numpy as np
import pytest
import torch
from scipy.linalg import eigh

from femupdate.building import from_document
from femupdate.dynamics import System, lumped
from femupdate.effects import structure_of
from femupdate.errors import BuildingError
from femupdate.inference.mode_data import modes_as_read
from tests.documents import stick
from tests.sticks import accelerance

MASS, SPRING, HEIGHT = np.array([4.0, 3.0, 2.0]), np.array([9e3, 7e3, 5e3]), 0.5
PLATE = 6.0
THETA = np.array([1.2, 0.8, 1.1])
LEVELS = HEIGHT * np.arange(1, 4)


def document(base, **more):
    prior = {"theta": {"lower": 0.3, "upper": 3.0}, "zeta": {"lower": 0.005, "upper": 0.05}}
    known = {"supports": {"base": base, **more}, "prior": prior}
    return stick(MASS, SPRING, [HEIGHT] * len(MASS), grid=(0.5, 30), **known)


def free_equations(rocks):
    """K and M in absolute motion of the base, its rotation where it rocks, and the floors."""
    drift = np.eye(3) - np.eye(3, k=-1)
    fixed = np.einsum("p,pi,pj->ij", THETA * SPRING, drift, drift)
    relative = np.column_stack([-np.ones(3), *([-LEVELS] if rocks else []), np.eye(3)])
    mass = np.diag([PLATE, *([0.0] if rocks else []), *MASS])
    return relative.T @ fixed @ relative, mass


@pytest.mark.parametrize(("base", "rocks"), [("slides", False), ("free", True)])
@pytest.mark.parametrize("forced", [0, 2])
def test_a_free_stick_is_that_of_its_equations(base, rocks, forced):
    model = lumped(structure_of(from_document(document(base, mass=PLATE)))).model
    stiffness, mass = free_equations(rocks)
    first = 1 + rocks
    frequency = np.array([0.8, 3.0, 7.3, 20.0])
    load = np.eye(first + 3)[first + forced]
    exact = [
        -(w**2) * np.linalg.solve(stiffness - w**2 * mass, load)[first:]
        for w in 2.0 * np.pi * frequency
    ]
    found = accelerance(
        System(model),
        torch.from_numpy(THETA)[None],
        torch.zeros(1, dtype=torch.float64),
        torch.from_numpy(frequency),
        forced,
    )[0]
    # The springs that hold the whole have a thousandth of the first frequency, of 4 Hz.
    np.testing.assert_allclose(found.real.numpy(), np.array(exact).T, rtol=2e-4, atol=1e-7)


def test_modes_of_a_free_stick():
    model = lumped(structure_of(from_document(document("slides", mass=PLATE)))).model
    stiffness, mass = free_equations(rocks=False)
    exact = np.sqrt(eigh(stiffness, mass, eigvals_only=True)[1:])
    none = torch.zeros(1, 0, dtype=torch.float64)
    zeta = torch.full((1,), 0.02, dtype=torch.float64)
    shown = modes_as_read(System(model), torch.from_numpy(THETA)[None], zeta, none)
    np.testing.assert_allclose(shown[0, 0, 1:4].exp().numpy(), exact, rtol=1e-5)


def test_motion_of_the_base_is_that_of_what_moves():
    held, free = (
        System(lumped(structure_of(from_document(document(base)))).model)
        for base in ("fixed", "slides")
    )
    known = (
        torch.from_numpy(THETA)[None],
        torch.full((1,), 0.02, dtype=torch.float64),
        torch.zeros(1, 0, dtype=torch.float64),
        torch.linspace(0.5, 15.0, 20, dtype=torch.float64),
    )
    torch.testing.assert_close(held.frf(*known), free.frf(*known), rtol=0.0, atol=0.0)


@pytest.mark.parametrize(
    ("supports", "said"),
    [
        ({"base": "springs"}, 'a stick is "fixed"'),
        ({"base": "fixed", "mass": 3.0}, 'needs base = "slides"'),
    ],
)
def test_what_a_stick_cannot_stand_on(supports, said):
    with pytest.raises(BuildingError, match=said):
        from_document(document(supports.pop("base"), **supports))
