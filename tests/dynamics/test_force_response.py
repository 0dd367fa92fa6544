"""Responses to a force: against dense equations of motion, with dampers, and of a full frame."""

import numpy as np
import pytest
import torch

from femupdate.building import load_building, shear_operators
from femupdate.dynamics import RayleighDamping, System, lumped, reduce_structure, rest_flexibility
from femupdate.effects import structure_of
from femupdate.fe import factorize
from femupdate.inference import reduction_target
from tests.sticks import accelerance

THETA = np.array([1.3, 0.8, 1.1, 0.7])
FREQUENCY = np.linspace(0.3, 15.0, 40)


@pytest.fixture(scope="module")
def stick():
    return lumped(structure_of(load_building("shear_4dof")))


def direct(stiffness, mass, damping, forced):
    """Accelerance (4, 40) by solving the equations at every frequency."""
    omega = 2.0 * np.pi * FREQUENCY
    load = np.eye(len(mass))[forced]
    curves = [
        -(w**2) * np.linalg.solve(stiffness + 1j * w * damping - w**2 * mass, load) for w in omega
    ]
    return np.array(curves).T


@pytest.mark.parametrize("forced", [0, 2, 3])
def test_a_stick_is_that_of_its_equations(stick, forced):
    terms, mass = shear_operators(load_building("shear_4dof"))
    stiffness = np.einsum("p,pij->ij", THETA, terms)
    law = RayleighDamping(0.02, (1.0, 20.0))
    damping = law.mass_coefficient * mass + law.stiffness_coefficient * stiffness
    exact = direct(stiffness, mass, damping, forced)
    found = accelerance(
        System(stick.model, law),
        torch.from_numpy(THETA)[None],
        torch.zeros(1, dtype=torch.float64),
        torch.from_numpy(FREQUENCY),
        forced,
    )[0]
    np.testing.assert_allclose(found, exact, rtol=1e-9)
    # Above all modes the floor moves as if it were free: the mass line.
    above = torch.tensor([3000.0], dtype=torch.float64)
    arguments = (torch.from_numpy(THETA)[None], torch.zeros(1, dtype=torch.float64), above, forced)
    high = accelerance(System(stick.model, RayleighDamping(1e-6, (1.0, 20.0))), *arguments)
    assert float(high[0, forced, 0].real) == pytest.approx(1.0 / mass[forced, forced], rel=1e-3)


def test_a_reduced_frame_with_its_rest_is_the_full_one(cabin_file):
    """Statically to a thousandth where the force acts, where the basis alone lacks a tenth."""
    building = load_building(cabin_file)
    structure, target = structure_of(building), reduction_target(building)
    model = reduce_structure(structure, target).model
    rest = rest_flexibility(structure, model, target.lower, target.upper)
    assert rest.error < 0.2 * rest.lacked
    theta = np.sqrt(target.lower * target.upper) * np.array([1.2, 0.9])
    stiffness = structure.stiffness_constant
    for factor, term in zip(theta, structure.stiffness_terms, strict=True):
        stiffness = stiffness + factor * term
    known = 0.3 * float(target.frequency_hz[0])
    dynamic = (stiffness - (2 * np.pi * known) ** 2 * structure.mass).tocsc()
    load = np.ascontiguousarray(structure.floor_rows[0])
    full = structure.floor_rows @ factorize(dynamic).apply(load)
    arguments = (
        System(model),
        torch.from_numpy(theta)[None],
        torch.zeros(1, dtype=torch.float64),
        torch.tensor([known], dtype=torch.float64),
        0,
    )
    with_rest, without = (
        accelerance(*arguments, one)[0, :, 0].real.numpy() / -((2 * np.pi * known) ** 2)
        for one in (rest, None)
    )
    away = np.abs(without / full - 1.0).max()
    assert np.abs(with_rest / full - 1.0).max() < max(0.2 * away, 1e-6)
