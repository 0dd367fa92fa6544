"""Stiffness factors by story and kind of member."""

import copy
import tomllib

import numpy as np
import pytest

from femupdate.building import from_document, mesh_building, stiffness_factors
from femupdate.fe import assemble
from femupdate.inference import theta_prior
from tests.building.frames import SMALL

BY_KIND = {"by": ["story", "kind"]}


@pytest.fixture
def document():
    return tomllib.loads(SMALL)


def building(document, **changes):
    return from_document(copy.deepcopy(document) | changes)


def test_names_by_story_and_kind(document):
    """The wall along C only weighs, and the one along P stands in the lower story alone."""
    document["walls"][0]["stories"] = ["low"]
    prior = theta_prior(building(document, parameters=BY_KIND))
    kinds = ("columns", "beams", "slabs")
    assert prior.names == (
        *("low walls", "low columns", "low beams", "low slabs"),
        *(f"high {kind}" for kind in kinds),
    )


def test_the_prior_of_a_story_is_that_of_all_its_members(document):
    document["prior"]["stories"] = {"high": {"lower": 0.5, "upper": 1.5}}
    prior = theta_prior(building(document, parameters=BY_KIND))
    assert prior.lower.tolist() == pytest.approx([1 / 3] * 4 + [0.5] * 4)
    assert prior.upper.tolist() == pytest.approx([3.0] * 4 + [1.5] * 4)


def test_the_members_of_a_story_add_up_to_the_story(document):
    stories = assemble(mesh_building(building(document)).model)
    made = building(document, parameters=BY_KIND)
    members = assemble(mesh_building(made).model)
    factors = stiffness_factors(made)
    assert members.parameters == len(factors) == 8
    for story, term in enumerate(stories.stiffness_terms):
        own = [members.stiffness_terms[k] for k, one in enumerate(factors) if one.story == story]
        assert abs(sum(own) - term).max() < 1e-12 * abs(term).max()
    assert abs(members.mass - stories.mass).max() == 0.0


def test_a_factor_is_that_of_youngs_modulus_of_its_members(document):
    document["materials"]["soft"] = document["materials"]["concrete"] | {"youngs_modulus": "10 GPa"}
    for section in document["sections"].values():
        section["material"] = "concrete"
    for part in (*document["walls"], *document["slabs"]):
        part["material"] = "concrete"
    made = building(document, parameters=BY_KIND)
    theta = [10 / 25 if one.kind == "columns" else 1.0 for one in stiffness_factors(made)]
    found = assemble(mesh_building(made).model).stiffness(np.array(theta))
    document["sections"]["column"]["material"] = "soft"
    expected = assemble(mesh_building(building(document)).model).stiffness(np.ones(2))
    assert abs(found - expected).max() < 1e-12 * abs(expected).max()
