"""Every figure of the shipped buildings says whether it is published or assumed."""

import re
from importlib.resources import files

import pytest

from femupdate.building.document import to_document
from femupdate.building.files import load_building
from femupdate.building.provenance import covers, entries_for, is_figure, provenance_of

NAMES = ("shear_3dof", "shear_4dof", "six_story_wall_frame")


def leaves(value, path=""):
    """Dotted keys of all values of a document; a list of plain values counts as one."""
    if isinstance(value, dict):
        for name, item in value.items():
            yield from leaves(item, f"{path}.{name}" if path else name)
    elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
        for number, item in enumerate(value):
            yield from leaves(item, f"{path}[{number}]")
    else:
        yield path


def figure_keys(building):
    return [key for key in leaves(to_document(building)) if is_figure(key)]


def covered(building, times):
    """Keys of the figures that so many entries cover; for 2, two or more."""
    counts = {key: len(entries_for(building, key)) for key in figure_keys(building)}
    return [key for key, count in counts.items() if min(count, 2) == times]


def idle_entries(building):
    entries = (*building.provenance.published, *building.provenance.assumed)
    keys = figure_keys(building)
    return [entry for entry in entries if not any(covers(entry, key) for key in keys)]


@pytest.mark.parametrize("name", NAMES)
def test_every_figure_is_covered_exactly_once(name):
    building = load_building(name)
    assert len(figure_keys(building)) > 15
    assert covered(building, 0) == []
    assert covered(building, 2) == []
    assert idle_entries(building) == []
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
    assert "mesh.size" in covered(changed, 0)
    assert "slabs[0].x" in covered(changed, 0)
    assert "slabs[0].thickness" not in covered(changed, 0)
    assert "walls[1].role" in covered(changed, 2)
    assert idle_entries(changed) == ["wall"]


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
