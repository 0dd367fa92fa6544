"""What holds for every effect of the catalogue."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from femupdate.effects import CATALOGUE, Terms

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


STRUCTURAL = (
    "added_mass@RF",
    "base_sway@base",
    "foundation_rocking@base",
    "story_damper@2F",
    "tuned_appendage@RF",
    "damping_law@rayleigh",
    "table_pitch@base",
)


@settings(max_examples=15, deadline=None)
@given(
    labels=st.lists(st.sampled_from(STRUCTURAL), max_size=3, unique=True),
    count=st.integers(1, 40),
    seed=st.integers(0, 2**31),
)
def test_a_batch_is_its_single_evaluations(stick, labels, count, seed):
    system = stick.system(*labels)
    rng = np.random.default_rng(seed)
    parameters = [p for one in system.placed for p in one.effect.parameters]
    sizes = np.array([[p.neutral + p.scale * rng.random() for p in parameters]] * count)
    sizes = torch.from_numpy(sizes.reshape(count, len(parameters)))
    theta = torch.from_numpy(rng.uniform(0.4, 2.5, (count, 4)))
    zeta = torch.from_numpy(rng.uniform(0.01, 0.05, count))
    grid = torch.from_numpy(stick.frequency_hz)
    together = system.frf(theta, zeta, sizes, grid)
    rows = [slice(k, k + 1) for k in range(count)]
    single = [system.frf(theta[k], zeta[k], sizes[k], grid) for k in rows]
    # Which modes are summed and which interpolated is decided for a batch: to 1e-9.
    torch.testing.assert_close(together, torch.cat(single), rtol=1e-7, atol=1e-9)


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
