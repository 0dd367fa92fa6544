"""A finding in words: effect, place and size with its unit."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from femupdate.discrepancy import Finding
from femupdate.discrepancy.diagnose import diagnose
from femupdate.discrepancy.findings import grouped
from femupdate.discrepancy.fit import extended, fit
from femupdate.effects import CATALOGUE, Placed
from tests.chains import Chain
from tests.discrepancy.posed import building_of, observe, place, pose


def fitted(placed, unit_mass=None, nominal=False):
    """The little of a fit that words ask for: mass of an effect of unit size, kg."""
    mass = None if unit_mass is None else SimpleNamespace(rigid=unit_mass * torch.eye(2))
    return SimpleNamespace(
        placed=(placed,),
        likelihood=SimpleNamespace(building=SimpleNamespace(forces_are_relative=nominal)),
        system=SimpleNamespace(terms=(SimpleNamespace(mass=mass),)),
    )


def in_words(name, place, size, sd, **model):
    placed = Placed(CATALOGUE[name], place)
    return Finding(None, fitted(placed, **model), 0.0, None, None, size, sd).in_words


@pytest.mark.parametrize(
    ("unit_mass", "nominal", "told"),
    [
        (21900.0, False, "(± 0.33 %; 2.14 t)"),
        (3.5, False, "(± 0.33 %; 0.342 kg)"),
        (21900.0, True, "(± 0.33 %)"),
        (1e-11, False, "(± 0.33 %)"),
    ],
    ids=["building", "model on a bench", "nominal masses", "masses that only move"],
)
def test_added_mass_is_told_in_its_own_unit_too(unit_mass, nominal, told):
    words = in_words("added_mass", "3F", 0.0976, 0.0033, unit_mass=unit_mass, nominal=nominal)
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
        (("channel_delay", "RF", 0.0021, 0.0001), "RF is 2.1 ms late (± 0.1 ms)"),
        (
            ("added_mass", "2F to 4F", 0.1, 0.01),
            "Each of 2F to 4F carries 10 % more mass than modelled (± 1 %)",
        ),
        (("swapped_channels", "2F,3F", 1.0, 0.0), "The channels of 2F and 3F are exchanged"),
        (("damping_law", "rayleigh", 0.5, 0.1), "Damping follows Rayleigh's law by 50 % (± 10 %)"),
        (
            ("damping_law", "proportional", -0.155, 0.02),
            "Damping falls with frequency: by 15.5 % against a law proportional to frequency "
            "(± 2 %)",
        ),
        (
            ("wall_stiffness", "S2", -0.25, 0.02),
            "The walls are 25 % softer than modelled in S2 (± 2 %)",
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


def test_shares_are_told_at_the_fitted_factors():
    """A dashpot's damping ratio, against a chain of the fitted stories by hand; a brace's share."""
    masses, springs, theta = np.ones(2), np.full(2, 600.0), np.array([0.6, 1.5])
    chain = Chain(masses, springs * theta, zeta=0.03)
    grid = 0.2 * np.arange(1, 41)
    seen = observe(("2F", "RF"), grid, chain.frf(grid), 0.02, 1)
    problem = pose(building_of(masses, springs), seen)
    plain = Chain(masses, springs)
    rate = 20.0
    for label, in_file, told in (
        ("story_damper@RF", *(_first_ratio(one, rate) for one in (plain, chain))),
        ("brace@ground-RF", *(0.1 * one.static_roof for one in (plain, chain))),
        ("base_sway@base", *(0.005 / one.static_roof for one in (plain, chain))),
    ):
        placed = place(label)
        base = fit(problem, (), torch.from_numpy(np.log([*theta, 0.03])), 0)
        fitted = fit(problem, placed, extended(problem, base, placed, [in_file]), 0)
        found = Finding(None, fitted, 0.0, None, None, *fitted.last_size)
        assert found.told[0] == pytest.approx(told, rel=0.01), label
    # A dashpot beside a mass, on which the ratio that it adds depends.
    heavy = Chain(masses * [1.0, 1.5], springs * theta)
    placed = place("story_damper@RF", "added_mass@RF")
    unit = problem.with_effects(placed).system.terms[0].constants[0]
    both = fit(problem, placed, extended(problem, base, placed, [rate / unit, 0.5]), 0)
    beside = found.within(both, 0)
    assert beside.placed.label == "story_damper@RF"
    # That the factors are uncertain counts, as draws of chains by hand scatter.
    drawn = np.random.default_rng(1).multivariate_normal(
        both.z.numpy(), 0.01 * both.covariance().numpy(), 400
    )
    values = both.steps.split(torch.from_numpy(drawn))
    ratios = [
        _first_ratio(Chain(masses + np.array([0.0, mass]), springs * factors), unit * size)
        for factors, (size, mass) in zip(values[0].numpy(), values[2].numpy(), strict=True)
    ]
    by_draws = 10.0 * np.std(ratios)
    # 400 draws tell a standard deviation to 3.5 %.
    assert beside.told == (
        pytest.approx(_first_ratio(heavy, rate), rel=1e-6),
        pytest.approx(by_draws, rel=0.15),
    )
    assert by_draws > 1.2 * beside.told[0] * beside.size_sd / beside.size


def _first_ratio(chain, rate):
    """Damping ratio that a dashpot in the second story adds to the first mode."""
    omega, shapes = chain.modes
    return rate * (shapes[1, 0] - shapes[0, 0]) ** 2 / (2.0 * omega[0])


def test_what_cannot_be_seen_is_told_by_effect():
    floors = (*(f"{k}F" for k in range(2, 19)), "RF")
    structure = SimpleNamespace(floors=floors, building=SimpleNamespace(story_names=("S1", "S2")))
    labels = [f"added_mass@{floor}" for floor in floors[-2::-1]]
    labels += ["cracked_beams@S2", "channel_gain@4F", "channel_gain@RF", "cracked_beams@all"]
    told = set(grouped(labels, structure).split("; "))
    assert told == {"added_mass@2F to 18F", "channel_gain@4F, RF", "cracked_beams@all, S2"}


def test_a_diagnosis_says_what_would_decide():
    """One floor of two: its gain and that of the base do the same to it."""
    grid = 0.2 * np.arange(1, 61)
    chain = Chain(np.ones(2), np.array([900.0, 700.0]), zeta=0.03)
    seen = observe(("RF",), grid, 1.06 * chain.frf(grid)[1:], 0.02, 3)
    found = diagnose(pose(building_of(np.ones(2), np.full(2, 800.0)), seen))
    labels = {found.leading.placed.label, *found.twins}
    assert found.verdict == "indistinguishable"
    assert {"base_gain@base", "channel_gain@RF"} <= labels
    said = " ".join(found.would_decide)
    assert "base_gain@base is settled by two sensors side by side" in said
