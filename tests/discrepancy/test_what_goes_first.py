"""What leads a diagnosis, and what a repair adds first."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from femupdate.discrepancy import DiagnosisSettings, Finding
from femupdate.discrepancy.diagnose import diagnose, with_pair
from femupdate.discrepancy.evidence import Tested as Outcome
from femupdate.discrepancy.findings import Diagnosis, in_order, rivals
from femupdate.discrepancy.fit import fit_baseline
from femupdate.discrepancy.repair import repair
from femupdate.effects import CATALOGUE, Placed
from tests.chains import Chain, rayleigh
from tests.discrepancy.posed import building_of, observe, pose

SETTINGS = DiagnosisSettings()
LATE, MASS = Placed(CATALOGUE["channel_delay"], "RF"), Placed(CATALOGUE["added_mass"], "RF")


def finding(placed, log_evidence, *log_e_values, certified=True):
    """With a size that anybody would look for, and the tests on the other half, if any."""
    changes = SimpleNamespace(matters=lambda *_: True)
    tested = Outcome(log_e_values, certified) if log_e_values else None
    fitted = SimpleNamespace(placed=(placed,), densities=(torch.tensor([4.0 * log_evidence]),))
    return Finding(None, fitted, log_evidence, changes, tested, 1.0, 0.1)


@pytest.mark.parametrize(
    ("one", "carried"),
    [
        (finding(LATE, 5.0, 24.0), True),
        (finding(LATE, 5.0, 0.2, certified=False), False),
        (finding(LATE, 5.0), False),
        (finding(LATE, 0.5, 24.0), False),
        (finding(MASS, 5.0, 24.0), False),
        (finding(MASS, 7.0, 24.0), True),
    ],
    ids=["certified", "refused", "not tested", "nothing", "structure", "structure, clear"],
)
def test_of_what_the_halves_certify_an_instrument_needs_less_evidence(one, carried):
    assert one.carried(SETTINGS) == carried


@pytest.mark.parametrize(("chi2", "named"), [(40.0, True), (998.0, False), (1200.0, False)])
def test_what_removes_nothing_of_the_misfit_beyond_the_noise_is_no_name(chi2, named):
    base = SimpleNamespace(chi2=1000.0, likelihood=SimpleNamespace(effective=100.0))
    late = finding(LATE, 12.0, 24.0)
    late.fitted.chi2 = chi2
    assert late.names(base, SETTINGS) == named


@pytest.mark.parametrize(
    ("chi2", "left", "verdict"),
    [(400.0, 0.1, "unknown"), (400.0, 0.0, "indistinguishable"), (300.0, 0.1, "indistinguishable")],
    ids=["little", "nothing is left", "enough"],
)
def test_what_removes_less_than_three_quarters_is_a_candidate(chi2, left, verdict):
    def remains():
        return SimpleNamespace(size=left, sentence="The model is off.")

    likelihood = SimpleNamespace(effective=100.0)
    base = SimpleNamespace(chi2=1000.0, likelihood=likelihood, remains=remains)
    heavy = finding(MASS, 12.0, 24.0)
    heavy.fitted.chi2, heavy.fitted.remains = chi2, remains
    found = Diagnosis(base, "indistinguishable", (heavy,), (), (), ("brace@2F-RF",), None, (), "")
    told = with_pair(found, SETTINGS)
    assert told.verdict == verdict
    if verdict == "unknown":
        assert "remove 67 % of the misfit" in told.sentence
        assert told.sentence.endswith("cause: Added mass at RF. The model is off.")


@pytest.mark.parametrize(
    ("late", "beside", "first"),
    [
        (finding(LATE, 5.0, 24.0), True, LATE),
        (finding(LATE, 5.0, 24.0), False, MASS),
        (finding(LATE, 5.0, 9.0), True, MASS),
        (finding(LATE, 5.0, 24.0, certified=False), True, MASS),
    ],
    ids=["far likelier elsewhere", "not beside it", "of little evidence", "refused"],
)
def test_a_sensor_leads_that_the_other_half_holds_far_likelier(late, beside, first):
    order = in_order((finding(MASS, 12.0, 8.7), late), SETTINGS, lambda *_: beside)
    assert order[0].placed is first


@pytest.mark.parametrize(
    ("place", "log_evidence", "rival"),
    [("S1", 12.5, True), ("S1", 11.5, False), ("S1 to S2", 12.5, False)],
)
def test_one_place_that_is_likelier_than_all_is_a_rival_of_all(place, log_evidence, rival):
    walls = CATALOGUE["wall_stiffness"]
    everywhere = finding(Placed(walls, "all"), 12.0, 24.0)
    other = finding(Placed(walls, place), log_evidence, 24.0)
    order = sorted([everywhere, other], key=lambda one: -one.log_evidence)
    order = in_order(order, SETTINGS, lambda *_: False)
    assert order[0] is everywhere
    assert rivals(order, SETTINGS, lambda *_: False) == [other] * rival


@pytest.mark.parametrize(("there", "rival"), [(23.0, True), (5.0, False)])
def test_what_is_as_likely_about_the_first_stays_its_rival(there, rival):
    """About the base other data hold it far less likely; errors of a mesh differ there."""
    other = finding(Placed(MASS.effect, "2F"), 11.5, 5.0, there)
    first = finding(MASS, 12.0, 24.0, 24.0)
    assert rivals((first, other), SETTINGS, lambda *_: False) == [other] * rival


def test_data_kept_out_add_nothing_that_is_not_clear_of_nothing():
    """A mass of 2.7 of its standard deviations beside a certain gain."""
    masses, springs, grid = np.ones(3), np.full(3, 600.0), 0.2 * np.arange(1, 61)
    heavy = Chain(masses * [1, 1.05, 1], springs * [0.8, 1.3, 1.1], zeta=0.04).frf(grid)
    seen = observe(("2F", "3F", "RF"), grid, heavy * [[1.0], [1.0], [1.25]], 0.2, 7)
    problem = pose(building_of(masses, springs), seen)

    def kept_out(_, before, after):
        return 1e3 if after.placed[-1].label == "added_mass@3F" else 0.0

    done = repair(problem, fit_baseline(problem)[0], elsewhere=kept_out)
    mass = next(one for one in done.last.findings if one.placed.label == "added_mass@3F")
    assert mass.carried(DiagnosisSettings(over_none=1.0))
    assert mass.size < 3.0 * mass.size_sd
    assert done.rounds == ()


def test_two_effects_that_others_imitate_are_told_and_repaired_together():
    """Mass and rocking: by themselves each explains less than half."""
    masses, theta, grid = np.ones(3), np.array([0.7, 1.3, 0.9]), 0.2 * np.arange(1, 103)
    law = {"law": "rayleigh", "ratio": 0.02, "anchors": [1.0, 20.0]}
    building = building_of(masses, np.full(3, 1000.0), zeta=None, damping=law)
    plain = Chain(masses, np.full(3, 1000.0), heights=np.arange(1.0, 4.0), zeta=0.02)
    spring = plain.heights.sum() * plain.heights[-1] / (0.1 * plain.static_roof)
    both = plain.at(theta, proportional=rayleigh(0.02, 1.0, 20.0), rocking=spring)
    frf = both.but(masses=masses * [1.0, 1.1, 1.0]).frf(grid)
    problem = pose(building, observe(("2F", "3F", "RF"), grid, frf, 0.01, 3))
    base = fit_baseline(problem)[0]
    among = frozenset(f"added_mass@{floor}" for floor in ("2F", "3F", "RF"))
    among |= {"foundation_rocking@base", "story_damper@3F", "tuned_appendage@RF"}
    among |= {"brace@ground-3F", "channel_gain@RF"}
    found = with_pair(diagnose(problem, base=base, among=among), SETTINGS)
    sizes = {
        "foundation_rocking@base": pytest.approx(0.1, rel=0.1),
        "added_mass@3F": pytest.approx(0.1, rel=0.1),
    }
    assert {one.placed.label: one.size for one in found.pair} == sizes
    done = repair(problem, base, found=found)
    assert {one.finding.placed.label: one.finding.size for one in done.rounds} == sizes


def test_a_floors_mass_is_told_with_the_masses_of_all_others_that_show_the_same():
    masses, theta, grid = np.ones(3), np.array([0.7, 1.3, 0.9]), 0.2 * np.arange(1, 103)
    plain = Chain(masses, 1000.0 * theta, heights=np.arange(1.0, 4.0), zeta=0.02)
    frf = plain.but(masses=masses * [1.0, 1.25, 1.0]).frf(grid)
    others = plain.but(masses=masses * [0.8, 1.0, 0.8], springs=800.0 * theta).frf(grid)
    np.testing.assert_allclose(others, frf, rtol=1e-9)
    building = building_of(masses, np.full(3, 1000.0))
    problem = pose(building, observe(("2F", "3F", "RF"), grid, frf, 0.001, 3))
    found = diagnose(problem, among=frozenset({"added_mass@3F", "channel_gain@RF"}))
    assert found.leading.placed.label == "added_mass@3F"
    assert "Much the same shows where all other floors carry 20.0 % less." in found.sentence
