"""Tests reach a room of the library by its public names, those of its `__all__`."""

import importlib

import pytest

from tests import house

ROOMS = (
    *("building", "dynamics", "effects", "fe"),
    *("measurement", "simulation", "surrogate", "workflow"),
)
# Parts of a room that are tested by themselves, as nothing public shows how exact they are.
INNER = {
    "femupdate.building.lattice",
    "femupdate.building.entry",
    "femupdate.building.sections",
    "femupdate.effects.catalogue",
    "femupdate.effects.structure",
    "femupdate.fe.elements",
}


@pytest.mark.parametrize("room", ROOMS)
def test_every_public_name_is_there(room):
    package = importlib.import_module(f"femupdate.{room}")
    assert all(getattr(package, name) is not None for name in package.__all__)


@pytest.mark.parametrize("room", ROOMS)
def test_tests_use_public_names(room):
    package = importlib.import_module(f"femupdate.{room}")
    wrong = {
        f"{path.relative_to(house.ROOT)}: {module}.{name}"
        for path, text in house.read("tests").items()
        for module, name in house.imported_names(text)
        if module.startswith(f"femupdate.{room}.")
        and module not in INNER
        and f"{module}.{name}" not in INNER
        and name in package.__all__
    }
    assert not wrong
