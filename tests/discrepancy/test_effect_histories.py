"""Histories with effects against the recurrence without them, and against other building files."""

import numpy as np
import pytest
import torch
from scipy.linalg import eigh

from femupdate.building import load_building
from femupdate.dynamics import (
    ConstantDamping,
    ResponseHistories,
    System,
    floor_histories,
    reduced_on,
    transformed_sensors,
)
from femupdate.dynamics.history import transformed_outputs
from femupdate.effects import structure_of
from tests.discrepancy.posed import building_of, place, reduced_of

MASSES, SPRINGS = np.array([3.0, 2.0, 1.5]), np.array([9e3, 5e3, 4e3])
THETA, ZETA, STEP = np.array([[0.8, 1.4, 1.1]]), 0.05, 0.005
TIME = np.arange(0.0, 15.0, STEP)
# Wave packets: rest before and after, and nothing near the Nyquist frequency, where the straight
# lines between samples that the recurrence assumes are no longer the record.
RECORD = sum(
    a * np.exp(-(((TIME - t) / w) ** 2)) * np.sin(2 * np.pi * f * TIME + p)
    for a, t, w, f, p in ((2.0, 3.0, 0.7, 2.2, 0.3), (1.0, 6.0, 1.0, 6.0, 1.0))
)


def system_of(reduced, placed=()):
    terms = tuple(reduced.terms(p) for p in placed)
    return System(reduced.model, ConstantDamping(), tuple(placed), terms)


def parameters(theta, sizes=()):
    return np.hstack([theta, np.array([sizes], dtype=float).reshape(1, -1)])


def respond(system, theta, sizes=()):
    return floor_histories(system, parameters(theta, sizes), ZETA, RECORD, STEP)


def sample(system, theta, sizes=()):
    both = torch.from_numpy(parameters(theta, sizes))
    factors, own = system.split(both)
    return factors, torch.tensor([ZETA], dtype=torch.float64), own


def transformed(system, theta, sizes=()):
    """The same by the Fourier transform."""
    found = transformed_outputs(system, sample(system, theta, sizes), RECORD, STEP)
    floors, stories = len(system.floors), len(system.model.story_mass)
    parts = np.split(found[None], [floors, floors + stories], axis=1)
    return ResponseHistories(STEP, system.floors, *parts)


def seen_by_sensors(system, theta, sizes):
    return transformed_sensors(system, sample(system, theta, sizes), RECORD, STEP)


def same(found, reference):
    """Floors, shear and drift within a thousandth of their peaks."""
    assert found.floors == reference.floors
    assert found.time_step == reference.time_step
    for name in ("floor_acceleration", "story_shear", "story_drift"):
        own, other = getattr(found, name), getattr(reference, name)
        assert own.shape == other.shape
        peak = np.abs(other).max(axis=2, keepdims=True)
        assert (peak > 0.0).all()
        np.testing.assert_allclose(own / peak, other / peak, atol=1e-3, err_msg=name)


@pytest.fixture(scope="module")
def stick():
    return reduced_of(building_of(MASSES, SPRINGS))


def test_without_effects_like_the_recurrence(stick):
    same(transformed(system_of(stick), THETA), respond(system_of(stick), THETA))


@pytest.mark.parametrize(
    ("label", "size"),
    [
        ("added_mass@3F", 0.3),
        ("foundation_rocking@base", 0.4),
        ("base_sway@base", 0.2),
        ("damping_law@rayleigh", 0.5),
    ],
)
def test_mode_by_mode_and_transformed_are_one(stick, label, size):
    """Real modes, on a rigid base and on a flexible one: two methods, one motion."""
    system = system_of(stick, place(label))
    same(transformed(system, THETA, (size,)), respond(system, THETA, (size,)))


def test_a_frame_without_effects_like_the_recurrence(cabin_file):
    """Shear and drift of a frame have rows of their own."""
    structure = structure_of(load_building(cabin_file))
    theta = np.array([[0.8, 1.3]])
    mass = structure.mass.toarray()
    basis = eigh(structure.stiffness(theta[0]).toarray(), mass)[1][:, :40]
    reduced = reduced_on(structure, basis)
    same(transformed(system_of(reduced), theta), respond(system_of(reduced), theta))


def test_added_mass_like_a_building_with_that_mass(stick):
    """Inertia above a story includes it: its shear is that of the heavier building."""
    heavier = reduced_of(building_of(MASSES * [1.0, 1.3, 1.0], SPRINGS))
    reference = respond(system_of(heavier), THETA)
    found = respond(system_of(stick, place("added_mass@3F")), THETA, (0.3,))
    same(found, reference)
    # The shear of the first story is the inertia of all floors, by Newton.
    inertia = (MASSES * [1.0, 1.3, 1.0]) @ found.floor_acceleration[0]
    peak = np.abs(inertia).max()
    np.testing.assert_allclose(np.abs(found.story_shear[0, 0]), np.abs(inertia), atol=1e-3 * peak)


def test_instruments_show_only_where_they_are_asked_for(stick):
    """A gain of 5 % and a delay of four samples on one channel; nothing moves differently."""
    plain = respond(system_of(stick), THETA)
    wrong = system_of(stick, place("channel_gain@3F", "channel_delay@3F"))
    sizes = (0.05, 4 * STEP)
    same(respond(wrong, THETA, sizes), plain)
    seen = seen_by_sensors(wrong, THETA, sizes)[None]
    expected = plain.floor_acceleration.copy()
    expected[0, 1, 4:] = 1.05 * plain.floor_acceleration[0, 1, :-4]
    expected[0, 1, :4] = 0.0
    np.testing.assert_allclose(seen, expected, atol=1e-3 * np.abs(expected).max())


def test_instruments_between_structural_effects_keep_their_sizes_apart(stick):
    """The gain stands before the mass in the list: each must find its own number."""
    mixed = system_of(stick, place("channel_gain@RF", "added_mass@3F"))
    alone = respond(system_of(stick, place("added_mass@3F")), THETA, (0.3,))
    same(respond(mixed, THETA, (0.5, 0.3)), alone)
    seen = seen_by_sensors(mixed, THETA, (0.5, 0.3))
    real = alone.floor_acceleration[0]
    moves = (np.abs(real) > 0.01 * np.abs(real).max()).all(axis=0)  # at rest there is no ratio
    ratio = seen[:, moves] / real[:, moves]
    np.testing.assert_allclose(np.median(ratio, axis=1), [1.0, 1.0, 1.5], rtol=1e-3)
