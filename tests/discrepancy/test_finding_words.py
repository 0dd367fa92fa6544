"""A finding in words: effect, place and size with its unit."""

from types import SimpleNamespace

import pytest
import torch

from femupdate.discrepancy.diagnose import Finding
from femupdate.effects import CATALOGUE, Placed


def fitted(unit_mass=None, nominal=False):
    """The little of a fit that words ask for: mass of an effect of unit size, kg."""
    mass = None if unit_mass is None else SimpleNamespace(rigid=unit_mass * torch.eye(2))
    structure = SimpleNamespace(building=SimpleNamespace(forces_are_relative=nominal))
    return SimpleNamespace(
        likelihood=SimpleNamespace(reduced=SimpleNamespace(structure=structure)),
        system=SimpleNamespace(terms=(SimpleNamespace(mass=mass),)),
    )


def in_words(name, place, size, sd, model=None):
    placed = Placed(CATALOGUE[name], place)
    return Finding(placed, None, model or fitted(), None, None, None, size, sd).in_words


@pytest.mark.parametrize(
    ("unit_mass", "nominal", "told"),
    [
        (21900.0, False, "(± 0.33 %; 2.14 t)"),
        (3.5, False, "(± 0.33 %; 0.342 kg)"),
        (21900.0, True, "(± 0.33 %)"),
    ],
    ids=["building", "model on a bench", "nominal masses"],
)
def test_added_mass_is_told_in_its_own_unit_too(unit_mass, nominal, told):
    words = in_words("added_mass", "3F", 0.0976, 0.0033, fitted(unit_mass, nominal))
    assert words == f"3F carries 9.76 % more mass than modelled {told}"


@pytest.mark.parametrize(
    ("finding", "words"),
    [
        (
            ("wall_stiffness", "all", 0.125, 0.0086),
            "The walls are 12.5 % stiffer than modelled in all stories (± 0.86 %)",
        ),
        (
            ("added_mass", "3F", -0.0976, 0.0033),
            "3F carries 9.76 % less mass than modelled (± 0.33 %)",
        ),
        (
            ("channel_delay", "RF", 0.0021, 0.0001),
            "RF is 2.1 ms late (± 0.1 ms)",
        ),
        (("swapped_channels", "2F,3F", 1.0, 0.0), "The channels of 2F and 3F are exchanged"),
        (
            ("damping_law", "rayleigh", 0.5, 0.1),
            "Damping follows Rayleigh's law by 50 % (± 10 %)",
        ),
        (
            ("base_sway", "base", 0.1, 0.01),
            "The base sways by 10 % of the roof's static displacement (± 1 %)",
        ),
        (
            ("wall_stiffness", "S2", -0.25, 0.02),
            "The walls are 25 % softer than modelled in S2 (± 2 %)",
        ),
        (
            ("brace", "ground-3F", 0.3, 0.01),
            "A brace between the ground and 3F has 30 % of the building's stiffness (± 1 %)",
        ),
        (
            ("non_structural_walls", "X1/S2", 0.2, 0.03),
            "The non-structural walls on line X1 in S2 have 20 % of their elastic stiffness "
            "(± 3 %)",
        ),
    ],
)
def test_a_finding_is_told_with_its_unit(finding, words):
    assert in_words(*finding) == words
