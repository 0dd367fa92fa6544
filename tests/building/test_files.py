"""Building files: found, read, written, hashed."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from femupdate.building import (
    EffectEntry,
    FrameBuilding,
    building_text,
    load_building,
    mechanics_hash,
    save_building,
    shipped_buildings,
)
from femupdate.building.entry import format_quantity
from femupdate.building.sections import rectangle_torsion_constant
from femupdate.errors import BuildingError
from femupdate.units import parse_quantity
from tests.building.frames import SMALL

NAMES = ("shear_3dof", "shear_4dof", "six_story_wall_frame")


def test_the_three_models_are_shipped():
    assert set(NAMES) <= set(shipped_buildings())


@pytest.mark.parametrize("name", NAMES)
def test_saved_building_loads_back_equal(name, tmp_path):
    building = load_building(name)
    path = save_building(building, tmp_path / "copy.toml")
    again = load_building(path)
    assert again == building
    assert mechanics_hash(again) == mechanics_hash(building)
    assert [entry.name for entry in tmp_path.iterdir()] == ["copy.toml"]  # no partial file left


def test_frame_with_every_optional_entry_loads_back_equal(tmp_path):
    text = SMALL.replace('points = ["P-B", "Q-B"]', 'points = "P-B"').replace(
        'direction = "x"', 'direction = "y"'
    )
    text += (
        '\n[sensors.floors]\nRF = ["A-P", "Q-C"]\n[prior.stories.high]\nlower = 0.5\nupper = 0.7\n'
    )
    text += '\n[sections.odd]\nshape = "figures"\narea = "12345 mm2"\nshear_area_y = "1e-2 m2"\n'
    text += 'shear_area_z = "0.01 m2"\ninertia_y = "3e7 mm4"\ninertia_z = "0.1 m4"\n'
    text += 'torsion_constant = "7.7e-5 m4"\n'
    path = tmp_path / "odd.toml"
    path.write_text('description = """two\nlines "quoted" \\\\ and é"""\n' + text, encoding="utf-8")
    building = load_building(path)
    assert isinstance(building, FrameBuilding)
    assert building.description == 'two\nlines "quoted" \\ and é'
    assert building.prior.theta_of("high").upper == 0.7
    assert building.prior.theta_of("low").lower == pytest.approx(1 / 3, rel=1e-15)
    assert building.sections["odd"].figures().inertia_y == pytest.approx(3e-5, rel=1e-15)
    assert load_building(save_building(building, tmp_path / "again.toml")) == building


def test_a_new_effect_leaves_the_text_and_its_comments(tmp_path):
    text = building_text("two_story_openings")[1]
    repaired = load_building("two_story_openings").model_copy(
        update={"effects": (EffectEntry(name="added_mass", place="RF", parameters={"size": 0.1}),)}
    )
    saved = save_building(repaired, tmp_path / "repaired.toml")
    lines = saved.read_text(encoding="utf-8").splitlines()
    own = Counter(line for line in text.splitlines() if line)
    assert own - Counter(lines) == Counter()
    new = ["[[effects]]", 'name = "added_mass"', 'place = "RF"', "[effects.parameters]"]
    assert Counter(line for line in lines if line) - own == Counter([*new, "size = 0.1"])
    assert load_building(saved) == repaired
    twice = repaired.model_copy(
        update={
            "description": "two\nlines",
            "effects": (*repaired.effects, EffectEntry(name="p_delta", place="all")),
        }
    )
    again = load_building(save_building(twice, tmp_path / "twice.toml"))
    assert again == twice
    assert "# " in again.source


def test_missing_file_lists_shipped_names_and_the_nearest():
    with pytest.raises(BuildingError) as error:
        load_building("six_story_wall_fram")
    assert all(name in str(error.value) for name in NAMES)
    assert "did you mean 'six_story_wall_frame'?" in str(error.value)


def test_units_are_of_another_programs_model():
    with pytest.raises(BuildingError, match=r"units belong to another program's model.*; leave"):
        load_building("shear_4dof", "N,mm")


def test_file_that_is_not_toml_names_the_line(tmp_path):
    path = tmp_path / "broken.toml"
    path.write_text('name = "x"\nkind = frame\n', encoding="utf-8")
    with pytest.raises(BuildingError, match=r"broken\.toml: this is not valid TOML.*line 2"):
        load_building(path)


def test_file_that_is_not_text_is_refused(tmp_path):
    path = tmp_path / "binary.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BuildingError, match="not UTF-8"):
        load_building(path)


@pytest.mark.parametrize(
    ("old", "new", "changes"),
    [
        ('name = "small"', 'name = "other"\ntitle = "T"', False),
        ("ratio = 0.02", "ratio = 0.03", False),  # zeta has a prior: predictions alone use it
        ("count = 300", "count = 299", True),
        ("lower = 0.01", "lower = 0.012", True),
        ('thickness = "100 mm"', 'thickness = "101 mm"', True),
        ('direction = "x"', 'direction = "y"', True),
    ],
)
def test_what_changes_the_mechanics_hash(tmp_path, old, new, changes):
    paths = tmp_path / "a.toml", tmp_path / "b.toml"
    paths[0].write_text(SMALL, encoding="utf-8")
    paths[1].write_text(SMALL.replace(old, new), encoding="utf-8")
    first, second = (load_building(path) for path in paths)
    assert (mechanics_hash(first) != mechanics_hash(second)) == changes


KINDS = ("length", "area", "inertia", "mass", "stress", "density", "stiffness", "frequency")


@given(value=st.floats(1e-12, 1e15), kind=st.sampled_from(KINDS))
def test_written_quantity_reads_back_exactly(value, kind):
    assert parse_quantity(format_quantity(value, kind), kind) == value


@pytest.mark.parametrize(
    ("value", "kind", "text"),
    [
        (0.18, "length", "0.18 m"),
        (0.045, "length", "45 mm"),
        (24.4e9, "stress", "24.4 kN/mm2"),
        (1000.0, "stiffness per mass", "1000 1/s2"),
        (3.0, "length", "3 m"),
    ],
)
def test_written_quantity_is_short(value, kind, text):
    assert format_quantity(value, kind) == text


# Timoshenko and Goodier 1951, article 94, table of k1 (sides a >= b, J = k1 a b^3): the table is
# printed with three or four digits.
@pytest.mark.parametrize(
    ("ratio", "factor", "digits"),
    [(1.0, 0.1406, 4), (1.5, 0.196, 3), (2.0, 0.229, 3), (3.0, 0.263, 3), (10.0, 0.312, 3)],
)
def test_torsion_constant_of_rectangles(ratio, factor, digits):
    constant = rectangle_torsion_constant(0.2 * ratio, 0.2)
    assert constant / (0.2 * ratio * 0.2**3) == pytest.approx(factor, abs=0.6 * 10.0**-digits)
    assert rectangle_torsion_constant(0.2, 0.2 * ratio) == pytest.approx(constant, rel=1e-14)


def test_torsion_constant_of_a_thin_strip():
    # b/a -> 0: a b^3 / 3 (1 - 0.630 b / a), the same source.
    assert rectangle_torsion_constant(1.0, 0.001) == pytest.approx(
        1e-9 / 3 * (1 - 0.6302e-3), rel=1e-6
    )
    assert np.isfinite(rectangle_torsion_constant(1e3, 1e-6))
