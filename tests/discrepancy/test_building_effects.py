"""Effects in building files: what is refused, and that what is written is read back."""

import json
from pathlib import Path

import numpy as np
import pytest
from safetensors import safe_open

from femupdate.building import load_building, mechanics_hash, save_building
from femupdate.effects import building_effects, check_places, with_effect
from femupdate.errors import BuildingError
from tests.discrepancy.posed import building_of, place, reduced_of

MODELS = Path(__file__).parents[2] / "models"
MASS = {"name": "added_mass", "place": "3F", "parameters": {"size": 0.1}}


def listed(*effects):
    return building_of([3, 2, 1], [9e3, 5e3, 4e3], effects=list(effects))


def test_effects_in_the_order_of_the_file_with_neutral_values_where_it_says_none():
    tank = {"name": "tuned_appendage", "place": "RF", "parameters": {"size": 0.02}}
    swapped = {"name": "swapped_channels", "place": "2F,3F"}
    found = building_effects(listed(MASS, swapped, tank))
    assert [one.label for one in found.placed] == [
        "added_mass@3F",
        "swapped_channels@2F,3F",
        "tuned_appendage@RF",
    ]
    assert found.values == (0.1, 0.02, 1.0, 0.02)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"name": "ghost"}, ["effects[1].name", "'ghost'", "added_mass"]),
        ({"place": "3F"}, ["effects[1]", "added_mass at 3F", "twice"]),
        ({"parameters": {"weight": 0.1}}, ["effects[1].parameters.weight", "size"]),
        ({"parameters": {"size": -0.9}}, ["effects[1].parameters.size", "-0.9", "-0.5 to 1"]),
    ],
    ids=["effect", "twice", "parameter", "value"],
)
def test_an_impossible_effect_is_refused_in_one_sentence_with_its_key(change, words):
    with pytest.raises(BuildingError) as refused:
        building_effects(listed(MASS, {**MASS, "place": "RF", **change}))
    sentence = str(refused.value)
    assert "\n" not in sentence
    assert sentence.startswith("chain: ")
    for word in words:
        assert word in sentence


@pytest.mark.parametrize(
    "effect",
    [
        {"name": "added_mass", "place": "9F"},
        {"name": "cracked_beams", "place": "all"},  # a stick has no beams
        {"name": "swapped_channels", "place": "2F"},
    ],
)
def test_an_impossible_place_is_refused_in_one_sentence_with_its_key(effect):
    building = listed(MASS, effect)
    with pytest.raises(BuildingError, match=r"^chain: effects\[1\]\.place: ") as refused:
        check_places(reduced_of(building).structure, building_effects(building))
    assert effect["place"] in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_building_with_effects_comes_back_from_its_file(tmp_path):
    plain = listed()
    mass, tank = place("added_mass@3F", "tuned_appendage@RF")
    repaired = with_effect(plain, mass, np.array([0.1234567]))
    repaired = with_effect(repaired, tank, np.array([0.02, 3.4, 0.05]))
    save_building(repaired, tmp_path / "repaired.toml")
    again = load_building(tmp_path / "repaired.toml")
    assert again.effects == repaired.effects
    assert mechanics_hash(again) == mechanics_hash(repaired)
    found = building_effects(again)
    assert [one.label for one in found.placed] == [mass.label, tank.label]
    np.testing.assert_allclose(found.values, (0.1234567, 0.02, 3.4, 0.05), rtol=1e-5)
    assert plain.effects == ()


@pytest.mark.parametrize("name", ["shear_4dof", "six_story_wall_frame"])
def test_buildings_without_effects_keep_the_hash_their_surrogates_were_trained_under(name):
    with safe_open(MODELS / f"{name}.safetensors", "pt") as file:
        trained = json.loads(file.metadata()["femupdate"])
    assert mechanics_hash(load_building(name)) == trained["mechanics_hash"]
