"""Every figure of the shipped buildings says whether it is published or assumed."""

import re
from importlib.resources import files

import pytest

from femupdate.building.files import load_building
from femupdate.building.provenance import (
    disputed_keys,
    figure_keys,
    idle_entries,
    provenance_of,
    uncovered_keys,
)

NAMES = ("shear_3dof", "shear_4dof", "six_story_wall_frame")


@pytest.mark.parametrize("name", NAMES)
def test_every_figure_is_covered_exactly_once(name):
    building = load_building(name)
    assert len(figure_keys(building)) > 15
    assert uncovered_keys(building) == ()
    assert disputed_keys(building) == ()
    assert idle_entries(building) == ()
    assert building.provenance.source


@pytest.mark.parametrize(
    ("key", "origin"),
    [
        ("materials.concrete.youngs_modulus", "published"),
        ("materials.concrete.density", "assumed"),
        ("walls[3].along", "published"),
        ("walls[3].thickness", "assumed"),
        ("stories[5].height", "assumed"),
        ("prior.zeta.upper", "published"),
        ("frequency_grid.count", "published"),
        ("frequency_grid.step", "assumed"),
        ("name", None),
        ("stories[0].name", None),
        ("nowhere", None),
    ],
)
def test_origin_of_a_figure_of_the_six_story_building(key, origin):
    assert provenance_of(load_building("six_story_wall_frame"), key) == origin


def test_the_longest_entry_decides_and_gaps_show():
    building = load_building("six_story_wall_frame")
    origins = building.provenance.model_copy(
        update={"published": ("walls[1]",), "assumed": ("walls", "wall", "slabs[*].thickness")}
    )
    changed = building.model_copy(update={"provenance": origins})
    assert provenance_of(changed, "walls[1].thickness") == "published"
    assert provenance_of(changed, "walls[0].thickness") == "assumed"
    assert "mesh.size" in uncovered_keys(changed)
    assert "slabs[0].x" in uncovered_keys(changed)
    assert "slabs[0].thickness" not in uncovered_keys(changed)
    assert "walls[1].role" in disputed_keys(changed)
    assert idle_entries(changed) == ("wall",)


@pytest.mark.parametrize("name", NAMES)
def test_comments_in_the_file_agree_with_its_lists(name):
    """Behind every entry stands the word that the provenance lists give for its key."""
    building = load_building(name)
    text = files("femupdate.models").joinpath(f"{name}.toml").read_text(encoding="utf-8")
    table, counts, checked = "", {}, set()
    for line in text.partition("\n[provenance]")[0].splitlines():
        if match := re.match(r"\[\[(.+)\]\]", line):
            counts[match[1]] = counts.get(match[1], -1) + 1
            table = f"{match[1]}[{counts[match[1]]}]."
        elif match := re.match(r"\[(.+?)\]", line):
            table = match[1] + "."
        elif match := re.match(r"([\w-]+) = .*?# (published|assumed)", line):
            checked.add(table + match[1])
            assert provenance_of(building, table + match[1]) == match[2], line
    assert checked == set(figure_keys(building))
