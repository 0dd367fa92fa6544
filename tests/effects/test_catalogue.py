"""What holds for every effect of the catalogue."""

import math

import numpy as np
import pytest

from femupdate.building import from_document
from femupdate.effects import CATALOGUE, DrawnBuilding, Terms, building_effects, structure_of

EFFECTS = pytest.mark.parametrize("effect", CATALOGUE.values(), ids=list(CATALOGUE))


def neutral(effect):
    """Parameters without the effect."""
    return [p.neutral for p in effect.parameters]


@EFFECTS
def test_says_what_it_is(effect):
    assert effect.name in CATALOGUE
    assert effect.title.strip()
    assert effect.sentence.endswith(".")
    assert len(effect.sentence.split()) > 6


@EFFECTS
def test_has_parameters_with_a_prior(effect):
    names = [p.name for p in effect.parameters]
    assert len(set(names)) == len(names)
    assert bool(names) or effect.instrument or effect.correction
    assert names[:1] in ([], ["size"])
    for p in effect.parameters:
        assert 0.0 < p.scale < math.inf
        assert p.lower <= p.neutral <= p.upper
        assert p.lower < p.upper
        assert p.unit
        assert p.text


@EFFECTS
def test_places_are_unique_and_have_terms(effect, case):
    places = effect.places(case.structure)
    assert len(set(places)) == len(places)
    for place in places:
        assert place.strip() == place != ""
        assert isinstance(effect.terms(case.structure, place), Terms)


def test_the_frame_has_a_place_for_every_effect(frame):
    assert all(effect.places(frame.structure) for effect in CATALOGUE.values())


@EFFECTS
def test_neutral_size_changes_nothing(effect, case):
    plain = case.frf(zeta=0.03)
    for place in effect.places(case.structure):
        if effect.parameters:
            ours = case.frf(f"{effect.name}@{place}", sizes=neutral(effect), zeta=0.03)
            # Rounding of 4e-12 in a frequency shows 34 times as large at its peak (2 Q).
            np.testing.assert_allclose(ours, plain, rtol=1e-9, atol=1e-12)


@EFFECTS
def test_a_usual_size_changes_something(effect, case):
    if effect.needs_levels:
        pytest.skip("one level shows nothing of it; see the tests of second records")
    plain = case.frf(zeta=0.03)
    for place in effect.places(case.structure):
        sizes = neutral(effect)
        for k, p in enumerate(effect.parameters[:1]):
            sizes[k] += p.scale if p.upper > p.neutral else -p.scale
        ours = case.frf(f"{effect.name}@{place}", sizes=sizes, zeta=0.03)
        assert np.abs(np.log(ours / plain)).max() > 1e-4
        if not effect.needs_phase:
            assert np.abs(np.log(np.abs(ours / plain))).max() > 1e-4


@EFFECTS
@pytest.mark.parametrize("side", ["lower", "upper"])
def test_limits_give_finite_responses(effect, case, side):
    for place in effect.places(case.structure):
        sizes = [getattr(p, side) for p in effect.parameters]
        assert np.isfinite(sizes).all()
        ours = case.frf(f"{effect.name}@{place}", sizes=sizes, zeta=0.03)
        assert np.isfinite(ours).all()


@EFFECTS
def test_says_with_figures_what_is_there(effect, case):
    """Every place in whole words, each different from the others."""
    size = effect.parameters[0].scale if effect.parameters else 1.0
    said = [effect.said(place, size) for place in effect.places(case.structure)]
    assert len(set(said)) == len(said)
    for clause in said:
        assert clause[0].isupper() or clause[0].isdigit()
        assert not clause.endswith(".")
        assert not {"all", "throughout", "floors"} & {clause.split()[-1]}
    assert len({effect.where(place) for place in effect.places(case.structure)}) == len(said)


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
