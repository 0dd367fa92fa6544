"""The tutorial tells of every effect in the catalogue, as the catalogue has it."""

from pathlib import Path

import pytest

from femupdate.effects.registry import CATALOGUE

PAGE = Path(__file__).parents[2] / "docs" / "missing-effects.md"


@pytest.fixture(scope="module")
def rows():
    """Cells of the catalogue's table by the name of the effect."""
    lines = [line for line in PAGE.read_text().splitlines() if line.startswith("| `")]
    cells = [line.replace(r"\|", "/").strip("| ").split(" | ") for line in lines]
    return {own[0].strip("`"): own for own in cells}


def test_every_effect_has_its_row(rows):
    assert set(rows) == set(CATALOGUE)


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_row_says_what_the_catalogue_says(rows, name):
    effect, (_, _, parameters, sentence, confused, settled) = CATALOGUE[name], rows[name]
    assert sentence.startswith(effect.sentence.replace("|", "/"))
    for one in effect.parameters:
        assert f"{one.text} ({one.unit}): {one.scale:g}, {one.lower:g} to {one.upper:g}" in (
            parameters
        )
    assert all(f"`{other}`" in confused for other in effect.confused_with)
    assert settled == effect.settled_by


def test_pictures_are_there_and_small():
    names = [
        line.split("(")[1].rstrip(")") for line in PAGE.read_text().splitlines() if "](pict" in line
    ]
    assert len(names) == 4
    for name in names:
        assert 5_000 < (PAGE.parent / name).stat().st_size < 300_000
