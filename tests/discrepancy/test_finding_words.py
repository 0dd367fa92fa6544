"""A finding in words: effect, place and size with its unit."""

import pytest

from femupdate.discrepancy.diagnose import Finding
from femupdate.effects.effect import Placed
from femupdate.effects.registry import CATALOGUE


def in_words(name, place, size, sd):
    placed = Placed(CATALOGUE[name], place)
    return Finding(placed, None, None, None, 1.0, size, sd).in_words


@pytest.mark.parametrize(
    ("finding", "words"),
    [
        (
            ("wall_stiffness", "all", 0.125, 0.0086),
            "Stiffness of the walls throughout: change of the walls' stiffness 12.5 % +- 0.86 %",
        ),
        (
            ("added_mass", "3F", -0.0976, 0.0033),
            "Added mass at 3F: share of the floor's mass -9.76 % +- 0.33 %",
        ),
        (
            ("channel_delay", "RF", 0.0021, 0.0001),
            "Delay of a channel at RF: delay against the base 0.0021 s +- 0.0001 s",
        ),
        (("swapped_channels", "2F,3F", 1.0, 0.0), "Swapped channels at 2F and 3F"),
        (
            ("damping_law", "rayleigh", 0.5, 0.1),
            "Damping law (rayleigh): share of the other law 50 % +- 10 %",
        ),
        (
            ("base_sway", "base", 0.1, 0.01),
            "Base sway at the base: sway over static roof displacement 10 % +- 1 %",
        ),
    ],
)
def test_a_finding_is_told_with_its_unit(finding, words):
    assert in_words(*finding) == words
