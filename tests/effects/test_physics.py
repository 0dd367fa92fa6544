"""Effects in closed form, and against building files in which the same thing is written."""

import copy

import numpy as np
import pytest
import torch

from femupdate.building import from_document
from femupdate.dynamics import ConstantDamping, System, reduced_on
from femupdate.effects import CATALOGUE, DrawnBuilding, Placed, building_effects, structure_of
from tests.documents import stick
from tests.effects.equations import frame_of

ZETA = 0.04
GRID = np.linspace(0.2, 9.0, 45)
MASS, SPRING, HEIGHT = 2000.0, 1.8e6, 3.2
OMEGA = (SPRING / MASS) ** 0.5


def single(mass=MASS, height=HEIGHT):
    """One mass on one spring."""
    return stick([mass], [SPRING], [height], ratio=ZETA)


def frf(document, effects=(), zeta=ZETA, theta=None, frequency_hz=GRID):
    """(f, k) of a shear building with effects (name, place, parameters)."""
    structure = structure_of(from_document(document))
    reduced = reduced_on(structure, np.diag(structure.points.mass**-0.5))
    placed = tuple(Placed(CATALOGUE[name], place) for name, place, _ in effects)
    terms = tuple(reduced.terms(one) for one in placed)
    system = System(reduced.model, ConstantDamping(), placed, terms)
    values = [v for _, _, own in effects for v in own]
    theta = [1.0] * len(structure.floors) if theta is None else theta
    tensors = [torch.tensor([v], dtype=torch.float64) for v in (theta, zeta, values)]
    return system.frf(*tensors, torch.from_numpy(frequency_hz))[0].numpy()


def one_mass(omega, zeta, share=1.0):
    """1 + share w^2 / (omega^2 - w^2 + 2 i zeta omega w): of one mass on one spring."""
    w = 2.0 * np.pi * GRID
    return 1.0 + share * w**2 / (omega**2 - w**2 + 2j * zeta * omega * w)


def test_sway_is_two_springs_in_series():
    """Size s: the ground's spring is k / s, as much softer as sway is smaller than drift."""
    size = 0.3
    series = (1.0 / (1.0 + size)) ** 0.5 * OMEGA
    np.testing.assert_allclose(
        frf(single(), [("base_sway", "base", [size])])[0], one_mass(series, ZETA), rtol=1e-10
    )


def test_rocking_of_a_stick():
    """m h^2 turns on the ground's spring: flexibilities 1/k and h^2/k_r add up."""
    size = 0.25
    softer = OMEGA / (1.0 + size) ** 0.5
    np.testing.assert_allclose(
        frf(single(), [("foundation_rocking", "base", [size])])[0],
        one_mass(softer, ZETA),
        rtol=1e-10,
    )


def test_added_mass_is_a_heavier_building():
    document = single()
    document["stories"][0]["mass"] = 1.3 * MASS
    np.testing.assert_allclose(
        frf(single(), [("added_mass", "RF", [0.3])]), frf(document), rtol=1e-10
    )


@pytest.mark.parametrize(("tuning", "own"), [(0.7, 0.02), (1.0, 0.08), (1.6, 0.005)])
def test_appendage_is_den_hartogs_absorber(tuning, own):
    """Amplitude of the main mass under a moving ground (Den Hartog, Mechanical Vibrations, 1956,
    section 3.3: force P0 = m y'' on both masses)."""
    mu, nu = 0.15, tuning * OMEGA
    w = 2.0 * np.pi * GRID
    link = nu**2 + 2j * own * nu * w
    main = OMEGA**2 + 2j * ZETA * OMEGA * w
    # Ground acceleration 1: relative to it (main + mu link - w^2) x - mu link v = -1 and
    # link (v - x) - w^2 v = -1.
    determinant = (main + mu * link - w**2) * (link - w**2) - mu * link**2
    x = -((link - w**2) + mu * link) / determinant
    ours = frf(single(), [("tuned_appendage", "RF", [mu, tuning, own])])
    np.testing.assert_allclose(ours[0], 1.0 - w**2 * x, rtol=1e-10)


def lightened(document):
    """No material weighs: all mass is that of the floors."""
    changed = copy.deepcopy(document)
    changed["materials"]["concrete"]["density"] = 1e-6
    changed["walls"] = changed["walls"][:1]
    return changed


def test_added_mass_is_a_building_file_with_a_heavier_floor(frame_document):
    light = lightened(frame_document)
    heavy = copy.deepcopy(light)
    heavy["floor_mass"][1]["total"] *= 1.4
    theta = np.ones(2)
    structure = structure_of(from_document(light))
    added = CATALOGUE["added_mass"].terms(structure, "RF").mass
    plain, exact = (frame_of(from_document(d), theta) for d in (light, heavy))
    np.testing.assert_allclose(
        plain.M + 0.4 * added.matrix.toarray(), exact.M, atol=1e-6 * np.abs(exact.M).max()
    )
    np.testing.assert_allclose(plain.force + 0.4 * added.force[:, :2], exact.force, atol=1e-2)
    np.testing.assert_allclose(
        plain.rigid_mass + 0.4 * added.rigid[:2, :2], exact.rigid_mass, rtol=1e-6
    )


def test_wall_stiffness_is_a_building_file_with_another_concrete(frame_document):
    other = copy.deepcopy(frame_document)
    other["materials"]["cracked"] = {**other["materials"]["concrete"], "youngs_modulus": 15e9}
    for part in ("slabs", "walls"):
        for entry in other[part]:
            entry["material"] = "concrete"
    for section in other["sections"].values():
        section["material"] = "concrete"
    other["walls"][0]["material"] = "cracked"
    theta = np.array([0.8, 1.3])
    structure = structure_of(from_document(frame_document))
    terms = CATALOGUE["wall_stiffness"].terms(structure, "all").stiffness
    ours = structure.stiffness(theta) + sum(-0.4 * theta[k] * matrix for k, matrix, _ in terms)
    exact = frame_of(from_document(other), theta).K
    np.testing.assert_allclose(ours.toarray(), exact, atol=1e-12 * np.abs(exact).max())


def test_all_kinds_of_members_together_are_their_stories(frame_document):
    building = from_document(frame_document | {"tolerances": {"members": 0.1}})
    structure, theta, size = structure_of(building), np.array([0.8, 1.3]), 0.07
    varying = building_effects(building).placed
    assert [placed.place for placed in varying] == ["wall", "column", "beam", "slab"]
    terms = [placed.effect.terms(structure, placed.place).stiffness for placed in varying]
    drawn = DrawnBuilding(structure)
    assert all(any(placed.effect.glyphs(drawn, placed.place)) for placed in varying)
    added = sum(size * theta[k] * matrix for kind in terms for k, matrix, _ in kind)
    ours, exact = structure.stiffness(theta) + added, structure.stiffness((1.0 + size) * theta)
    np.testing.assert_allclose(ours.toarray(), exact.toarray(), atol=1e-12 * abs(exact).max())


def test_rigid_motions_of_a_free_frame_cost_no_energy(frame):
    """The base's translations and rotation strain nothing, in an unsupported mesh."""
    from dataclasses import replace

    from femupdate.fe import assemble

    model = replace(frame.mesh.model, fixed=np.zeros_like(frame.mesh.model.fixed))
    free = assemble(model)
    K = free.stiffness(np.ones(2))
    held = assemble(frame.mesh.model).free
    shapes = np.zeros((free.dof, 3))
    shapes[held] = frame.structure.rigid_shapes
    base = frame.mesh.base_nodes
    nodes = frame.mesh.model.nodes
    middle = 0.5 * (nodes[:, 0].min() + nodes[:, 0].max())
    # The base itself: it turns about y, and its nodes go up and down.
    shapes[6 * base, 0] = shapes[6 * base + 1, 2] = 1.0
    shapes[6 * base + 2, 1] = middle - nodes[base, 0]
    shapes[6 * base + 4, 1] = 1.0
    np.testing.assert_allclose(K @ shapes, 0.0, atol=1e-8 * abs(K).max())
