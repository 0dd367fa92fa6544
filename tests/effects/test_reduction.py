"""A reduced frame with effects against the same frame with nothing left out."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.linalg import eigh

from femupdate.building import from_document
from femupdate.dynamics import (
    ConstantDamping,
    ReductionTarget,
    System,
    equations_at,
    local_structure,
    reduce_structure,
    reduced_on,
)
from femupdate.dynamics.local_basis import KnownModes, nearby_shapes
from femupdate.dynamics.snapshots import TOP
from femupdate.effects import CATALOGUE, Placed, structure_of
from femupdate.errors import StructureError
from femupdate.fe import factorize, modes_below

GRID = np.linspace(0.2, 30.0, 150)
ZETA = 0.02
HERE = np.array([0.7, 1.8])


@pytest.fixture(scope="module")
def structure(frame_document):
    return structure_of(from_document({**frame_document, "mesh": {"size": 2.0}}))


@pytest.fixture(scope="module")
def exact(structure):
    K, M = structure.stiffness(np.ones(2)).toarray(), structure.mass.toarray()
    return reduced_on(structure, eigh(K, M)[1])


@pytest.fixture(scope="module")
def target():
    bounds = np.full(2, 1 / 3), np.full(2, 3.0)
    return ReductionTarget(*bounds, GRID, ZETA, 0.01, samples=16)


@pytest.fixture(scope="module")
def local(structure, target):
    return local_structure(structure, HERE, target, size=110)


def log_frf(reduced, placed, values, theta):
    terms = reduced.terms(placed)
    system = System(reduced.model, ConstantDamping(), (placed,), (terms,))
    tensors = [torch.from_numpy(np.atleast_2d(v)) for v in (theta, values)]
    zeta = torch.full((len(tensors[0]),), ZETA, dtype=torch.float64)
    sizes = tensors[1].expand(len(zeta), -1)
    return system.frf(tensors[0], zeta, sizes, torch.from_numpy(GRID)).abs().log().numpy()


def nearby(exact, name):
    """Story factors (3, p) beside HERE, and an effect of some size at each of its places."""
    effect = CATALOGUE[name]
    theta = HERE * np.exp(np.random.default_rng(3).uniform(-0.15, 0.15, (3, 2)))
    values = np.array([p.neutral for p in effect.parameters])
    for first in effect.parameters[:1]:
        values[0] += 0.7 * (first.scale if first.upper > first.neutral else -first.scale)
    return [(theta, Placed(effect, place), values) for place in effect.places(exact.structure)]


@pytest.mark.parametrize("name", [n for n, e in CATALOGUE.items() if not e.instrument])
def test_local_basis_follows_the_full_model_nearby(local, exact, name):
    """Half as many shapes, at story factors beside those that it is made for."""
    for theta, placed, values in nearby(exact, name):
        error = log_frf(local, placed, values, theta) - log_frf(exact, placed, values, theta)
        assert np.sqrt((error**2).mean()) < 0.015
        assert np.abs(error).max() < 0.2


@pytest.mark.parametrize("name", ["added_mass", "brace", "cracked_beams"])
def test_changed_equations_are_projected_by_what_has_changed(structure, name):
    """As by the full matrices: of masses, of springs between many nodes, and of members."""
    effect = CATALOGUE[name]
    terms = effect.terms(structure, effect.places(structure)[0])
    before = equations_at(structure, HERE)
    modes = modes_below(structure.operators, HERE, GRID[-1])
    known = KnownModes.of(before, modes, factorize(before.stiffness))
    changed = equations_at(structure, 1.1 * HERE, ((terms, 0.3),))
    stiffness, mass, *changes = known.of_changed(changed)
    shapes, springs = known.shapes, changed.springs
    pulled = np.diag(springs.stiffness) @ (springs.rows @ shapes)
    whole = shapes.T @ (changed.stiffness @ shapes) + (springs.rows @ shapes).T @ pulled
    np.testing.assert_allclose(stiffness, whole, atol=1e-9 * np.abs(whole).max())
    np.testing.assert_allclose(mass, shapes.T @ (changed.mass @ shapes), atol=1e-9)
    for kind, (rows, times) in zip(("stiffness", "mass"), changes, strict=True):
        found = np.zeros_like(shapes)
        found[rows] = times
        expected = (getattr(changed, kind) - getattr(before, kind)) @ shapes
        np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(whole).max())


def test_shapes_of_a_changed_model_come_from_the_modes_of_another(structure, exact, target):
    """They hold its responses, which the modes themselves do not."""
    modes = modes_below(structure.operators, HERE, TOP * GRID[-1])
    before, theta = equations_at(structure, HERE), HERE * np.array([0.8, 1.25])
    known = KnownModes.of(before, modes, factorize(before.stiffness))
    changed = equations_at(structure, theta)
    shapes = nearby_shapes(changed, np.eye(3)[0], structure.floor_rows, known, target)
    assert shapes.shape[1] < modes.shapes.shape[1]
    placed, none = Placed(CATALOGUE["added_mass"], "RF"), np.zeros(1)

    def error(basis):
        root = np.linalg.cholesky(basis.T @ (structure.mass @ basis))
        reduced = reduced_on(structure, np.linalg.solve(root, basis.T).T)
        both = [log_frf(one, placed, none, theta) for one in (reduced, exact)]
        return np.sqrt(((both[0] - both[1]) ** 2).mean())

    assert error(shapes / np.linalg.norm(shapes, axis=0)) < min(0.035, 0.2 * error(modes.shapes))


def test_a_basis_serves_its_neighbourhood_alone(local, exact):
    """Far from the theta that it is taken for it errs more."""
    placed, values = Placed(CATALOGUE["added_mass"], "RF"), np.array([0.05])

    def error(theta):
        both = [log_frf(r, placed, values, theta) for r in (local, exact)]
        return np.sqrt(((both[0] - both[1]) ** 2).mean())

    assert error(HERE) < 0.01
    assert error(HERE[::-1].copy()) > 2.0 * error(HERE)


@pytest.mark.parametrize(
    "labels", [("cracked_beams@low",), ("foundation_rocking@base", "added_mass@2F")]
)
def test_basis_over_a_box_follows_the_full_model(structure, exact, target, labels):
    """At story factors and sizes, up to the ends of their priors, that the basis has not seen."""
    placed = tuple(
        Placed(CATALOGUE[name], place) for name, place in (one.split("@") for one in labels)
    )
    likely = np.array([p.likely for one in placed for p in one.effect.parameters])
    lower = np.concatenate([target.lower, likely[:, 0]])
    upper = np.concatenate([target.upper, likely[:, 1]])
    box = replace(target, lower=lower, upper=upper)
    found = reduce_structure(structure, box, placed)
    assert found.reduced.model.size < 0.5 * exact.model.size
    assert found.checks == 29
    assert found.rms_error <= target.tolerance
    samples = torch.from_numpy(
        lower + (upper - lower) * np.random.default_rng(5).random((4, len(lower)))
    )
    zeta, grid = torch.full((4,), ZETA, dtype=torch.float64), torch.from_numpy(GRID)
    frf = [
        System(one.model, ConstantDamping(), placed, tuple(one.terms(p) for p in placed)).frf(
            samples[:, :2], zeta, samples[:, 2:], grid
        )
        for one in (found.reduced, exact)
    ]
    error = (frf[0].abs().log() - frf[1].abs().log()).numpy()
    # Certified rms over the box, at the worst of four samples.
    assert np.sqrt((error**2).mean(axis=(1, 2))).max() < 3.0 * target.tolerance


def test_a_box_that_no_basis_serves_is_refused_in_a_sentence(structure, target):
    placed = (Placed(CATALOGUE["cracked_beams"], "low"),)
    lower, upper = np.append(target.lower, -0.9), np.append(target.upper, 0.0)
    few = replace(target, lower=lower, upper=upper, tolerance=1e-14, samples=1)
    with pytest.raises(StructureError, match=r"cracked_beams@low .* calibrate with --exact"):
        reduce_structure(structure, few, placed)


def test_a_basis_holds_what_gives_at_the_point_of_a_damper(structure, exact, target):
    """The shapes of the structure alone are not enough there."""
    placed, size = Placed(CATALOGUE["story_damper"], "RF/C-Q"), 0.2
    present = [((placed, size),)]
    known = local_structure(structure, HERE, target, size=60, present=present)
    plain = local_structure(structure, HERE, target, size=60, present=[()])
    truth = log_frf(exact, placed, [size], HERE)
    errors = [log_frf(one, placed, [size], HERE) - truth for one in (known, plain)]
    rms = [float(np.sqrt((error**2).mean())) for error in errors]
    assert rms[0] < 0.005
    assert rms[0] < 0.5 * rms[1]


@pytest.mark.parametrize("size", [0.3, 1.0])
def test_a_basis_about_a_brace_serves_it(structure, exact, target, size):
    """Also one as stiff as the building, whose modes the basis does not start from."""
    placed = Placed(CATALOGUE["brace"], "ground-2F")
    near = local_structure(structure, HERE, target, present=[((placed, size),)])
    value = np.array([size])
    error = log_frf(near, placed, value, HERE) - log_frf(exact, placed, value, HERE)
    assert np.sqrt((error**2).mean()) < 0.005
