"""Effects hidden in data that a hand-written chain made: which one is named, where, how large."""

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

from femupdate.study import Study
from femupdate.workflow import ObservationSource, diagnose_study, open_study
from tests.chains import Chain, rayleigh
from tests.sticks import shear_stick

GRID = 0.2 * np.arange(1, 103)
FLOORS = ("2F", "3F", "RF")
THETA, SD = np.array([0.7, 1.3, 0.9]), 0.05

RAYLEIGH = rayleigh(0.02, 1.0, 20.0)
HEIGHTS = np.arange(1.0, 4.0)
NOMINAL = Chain(np.ones(3), np.full(3, 1000.0), proportional=RAYLEIGH, heights=HEIGHTS, zeta=0.02)
CHAIN = NOMINAL.but(springs=1000.0 * THETA)
# Two stories have fewer effects to fit: where nothing but the verdict is asked for.
LOW = CHAIN.but(masses=np.ones(2), springs=1000.0 * THETA[:2], heights=HEIGHTS[:2])


def with_mass(size, floor=1, chain=CHAIN):
    masses = np.ones(3)
    masses[floor] += size
    return chain.but(masses=masses)


def write(path, frf, seed=3, sd=SD):
    """An FRF table as users write it, with independent errors of the stated size."""
    error = sd * np.random.default_rng(seed).standard_normal((2, *frf.shape))
    seen = frf * np.exp(error[0] + 1j * error[1])
    floors = FLOORS if len(frf) == 3 else FLOORS[::2]
    names = [f"{f}_{part}" for f in floors for part in ("re", "im")]
    parts = np.stack([seen.real, seen.imag], axis=1).reshape(-1, seen.shape[1])
    if not np.iscomplexobj(frf):  # sizes alone
        names, parts = list(floors), np.abs(seen)
    head = ",".join(["frequency_hz", *names, *(f"{f}_sd" for f in floors)])
    rows = [
        ",".join(f"{v:.9g}" for v in (f, *column, *[sd] * len(floors)))
        for f, column in zip(GRID, parts.T, strict=True)
    ]
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("diagnose")
    (folder / "stick.toml").write_text(shear_stick())
    made = Study(folder / "study")
    open_study(made, str(folder / "stick.toml"))
    return made


@pytest.fixture
def diagnosed(study, tmp_path):
    """A function: the report on an FRF (3, k)."""

    def run(frf, building=None, seed=3, **options):
        home = study if building is None else Study(tmp_path / "own")
        source = ObservationSource(write(tmp_path / "frf.csv", frf, seed))
        return diagnose_study(home, open_study(home, building), source, **options)

    return run


@pytest.fixture(scope="module")
def heavier(study):
    """The report on the data of a heavier floor, in a study of its own."""
    home = Study(shutil.copytree(study.folder, study.folder.with_name("heavier")))
    source = ObservationSource(write(home.path("frf.csv"), NAMED["added_mass@3F"][0]))
    return diagnose_study(home, open_study(home), source)


def test_nothing_is_found_where_nothing_is_missing(diagnosed):
    report = diagnosed(CHAIN.frf(GRID))
    found = report.diagnosis
    assert found.verdict == "none"
    assert found.p_value > 0.01
    np.testing.assert_allclose(found.base.theta()[0], THETA, rtol=0.02)
    assert report.as_dict()["where"] == []
    assert report.screen == ()


NAMED = {
    "added_mass@3F": (with_mass(0.15).frf(GRID), 0.15),
    "channel_delay@RF": (
        CHAIN.frf(GRID) * np.exp(-2j * np.pi * GRID * np.array([[0], [0], [0.003]])),
        0.003,
    ),
}


@pytest.mark.parametrize("label", NAMED)
def test_a_hidden_effect_is_named_with_its_place_and_size(diagnosed, heavier, label):
    frf, size = NAMED[label]
    report = heavier if label == "added_mass@3F" else diagnosed(frf)
    found = report.diagnosis
    assert found.verdict == "named"
    assert found.leading.placed.label == label
    assert found.leading.tested.certified
    assert found.leading.changes.matters(0.01, 0.02)
    assert found.left.size < 0.02
    assert found.twins == ()
    assert found.leading.placed.place in found.sentence
    assert abs(found.leading.size - size) < 3.0 * found.leading.size_sd
    # With the effect the factors are the true ones again.
    theta, sd = found.leading.fitted.theta()
    assert (np.abs(theta - THETA) < 4.0 * sd).all()
    assert report.as_dict()["where"]


@pytest.mark.parametrize(
    ("theta", "place", "size", "seed"),
    [
        # Masses and gains that are known to a per cent or so move a fit without it far away.
        ((1.12, 1.1, 0.91), "2F", 0.7, 5),
        # An appendage as heavy as any may be stands for it from where the search begins.
        ((0.877, 0.756, 0.961), "RF", 0.39, 12),
    ],
)
def test_a_large_mass_is_named_though_the_search_begins_far_from_it(
    study, tmp_path, theta, place, size, seed
):
    masses = 1.0 + size * (np.array(FLOORS) == place)
    chain = NOMINAL.but(springs=1000.0 * np.array(theta), masses=masses)
    source = ObservationSource(write(tmp_path / "frf.csv", chain.frf(GRID), seed, sd=0.02))
    found = diagnose_study(study, open_study(study), source).diagnosis
    assert found.verdict == "named"
    assert found.leading.placed.label == f"added_mass@{place}"
    assert abs(found.leading.size - size) < 3.0 * found.leading.size_sd


def test_a_mass_comes_with_what_looks_the_same(heavier):
    (told,) = (note for note in heavier.notes if "ratios of masses" in note)
    percents = re.search(r"all other floors ([\d.]+) % lighter", told)
    assert float(percents[1]) == pytest.approx(100.0 * (1.0 - 1.0 / 1.15), abs=1.0)
    light = 1.0 / 1.15
    alike = CHAIN.but(masses=np.array([light, 1.0, light]), springs=light * 1000.0 * THETA)
    np.testing.assert_allclose(alike.frf(GRID), with_mass(0.15).frf(GRID), rtol=1e-9)


def test_the_damping_law_is_named_where_the_model_has_another(diagnosed, tmp_path):
    """Constant in the model, Rayleigh in truth, anchored at f1 and 6 f1 of the nominal chain."""
    constant = '[prior.zeta]\nlower = 0.005\nupper = 0.1\n\n[damping]\nlaw = "constant"\n'
    building = tmp_path / "constant.toml"
    building.write_text(shear_stick(constant + "ratio = 0.03\n\n"))
    first = NOMINAL.modes[0][0] / (2.0 * np.pi)
    damped = CHAIN.but(proportional=rayleigh(0.03, first, 6.0 * first))
    found = diagnosed(damped.frf(GRID), str(building)).diagnosis
    assert found.verdict == "named"
    assert found.leading.placed.label == "damping_law@rayleigh"
    assert abs(found.leading.size - 1.0) < 3.0 * found.leading.size_sd
    assert found.leading.fitted.zeta == pytest.approx(0.03, rel=0.05)


def test_what_is_not_in_the_catalogue_leaves_something_unexplained(diagnosed, tmp_path):
    """The resonance of a bracket under one sensor."""
    building = tmp_path / "low.toml"
    building.write_text(shear_stick(stories=2))
    frf = LOW.frf(GRID)
    frf[1] /= 1.0 - (GRID / 13.0) ** 2 + 0.05j
    report = diagnosed(frf, str(building))
    found = report.diagnosis
    assert found.verdict == "unknown"
    assert found.left.size > 0.02
    assert found.p_value < 1e-6
    assert report.as_dict()["where"]
    for words in ("still off by", "of the misfit and may only stand in for the cause"):
        assert words in found.sentence
    worst = max(found.residuals, key=lambda cell: cell.excess)
    assert worst.floor == "RF"
    assert worst.band_hz[1] > 10.0


def test_a_delay_shows_in_nothing_but_the_phase(diagnosed):
    found = diagnosed(np.abs(NAMED["channel_delay@RF"][0])).diagnosis
    assert found.verdict == "none"
    assert not any(one.placed.effect.needs_phase for one in found.scores)


def test_an_effect_that_the_building_lists_is_not_looked_for_again(diagnosed, tmp_path):
    """The file says 15 %, the truth is 15 %: nothing is left."""
    listed = '\n[[effects]]\nname = "added_mass"\nplace = "3F"\n[effects.parameters]\nsize = 0.15\n'
    building = tmp_path / "listed.toml"
    building.write_text(shear_stick(effects=listed))
    found = diagnosed(NAMED["added_mass@3F"][0], str(building)).diagnosis
    assert found.verdict == "none"
    assert found.p_value > 0.01
    (size,), (sd,) = found.base.sizes()
    assert abs(size - 0.15) < 3.0 * sd
    assert "added_mass@3F" not in {one.placed.label for one in found.scores}


def test_the_report_has_the_promised_keys_and_its_file(heavier):
    told = heavier.as_dict()
    assert heavier.limits == ()
    assert "(share of the floor's mass" in told["effects"][0]["size_in_words"]
    # As if the catalogue were complete.
    assert "probability" not in told["effects"][0]
    assert {"floor", "band_hz", "excess", "data"} == set(told["where"][0])
    assert 0.5 < told["effects"][0]["absorbed_by_theta"] < 1.0
    assert told["effects"][0]["added_mass_kg"] is None  # masses of that building are nominal
    kept = json.loads(heavier.path.read_text())
    assert kept["verdict"] == "named"
    assert kept["effects"][0]["name"] == "added_mass"
    assert heavier.path.name == "diagnosis.json"


def test_a_factor_that_ends_at_its_limit_is_told(diagnosed, study, tmp_path):
    """theta_2 is 1.3, which a narrow prior just leaves out."""
    narrow = tmp_path / "narrow.toml"
    text = study.path("building.toml").read_text()
    narrow.write_text(re.sub(r"(\[prior.theta\][^\[]*upper = )[\d.]+", r"\g<1>1.29", text))
    report = diagnosed(CHAIN.frf(GRID), str(narrow))
    (told,) = report.limits
    assert told.startswith("Without effects theta_2 (1.29) ends at the prior's limit")
    assert report.as_dict()["screen"][0] == told


def test_the_verdict_is_told_first_and_the_evidence_in_a_table(heavier):
    lines = "\n".join(heavier.lines(True)).splitlines()
    assert lines[0].startswith("Verdict: named. ")
    assert "added_mass@3F" not in "\n".join(heavier.lines())
    (row, *_) = [words for words in map(str.split, lines) if words[:1] == ["added_mass@3F"]]
    assert float(row[1]) > 6.0  # the log evidence that a name needs


def test_six_notes_of_a_diagnosis_are_printed_the_decisive_first(heavier):
    many = replace(heavier, limits=("at its limit",), screen=tuple(f"note {k}" for k in range(8)))
    printed = [line for line in many.lines() if line.startswith("  - ")]
    assert len(many.notes) > 8
    assert printed[0] == "  - at its limit"
    assert printed[1:6] == [f"  - {note}" for note in many.notes[1:6]]
    assert printed[6:] == [f"  - {len(many.notes) - 6} more notes: diagnosis.json in the study"]
    assert many.as_dict()["screen"] == list(many.limits + many.screen)
