"""Effects hidden in data that a hand-written chain made: which one is named, where, how large.

The data are FRFs of the four-story benchmark, solved frequency by frequency with the effect in its
matrices, with an error of 5 % on |H| and the phase: nothing of them comes from the program. A grid
of a fifth of the benchmark's points keeps each diagnosis below a second.
"""

import importlib.util
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from femupdate.building import load_building
from femupdate.discrepancy import search
from femupdate.discrepancy.diagnose import STANDS_IN, diagnose
from femupdate.discrepancy.thresholds import DiagnosisSettings
from femupdate.report.figure import draw
from femupdate.study import Study
from femupdate.workflow.diagnose import diagnose_study
from femupdate.workflow.model import open_study
from femupdate.workflow.observed import ObservationSource
from femupdate.workflow.repair import repair_study

SHARED = Path(__file__).parents[3] / "shared" / "data"
GRID = np.arange(0.1, 20.5, 0.1)
FLOORS = ("2F", "3F", "4F", "RF")
THETA, SD = np.array([0.7, 1.3, 0.9, 1.1]), 0.05


def _load_chain():
    path = Path(__file__).parents[1] / "discrepancy" / "chain.py"
    spec = importlib.util.spec_from_file_location("workflow_chain", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


chains = _load_chain()
RAYLEIGH = chains.rayleigh(0.02, 1.0, 20.0)
HEIGHTS = np.arange(1.0, 5.0)
NOMINAL = chains.Chain(
    np.ones(4), np.full(4, 1000.0), proportional=RAYLEIGH, heights=HEIGHTS, zeta=0.02
)
CHAIN = NOMINAL.but(springs=1000.0 * THETA)
OMEGA, SHAPES = NOMINAL.modes


def with_mass(size, floor=1, chain=CHAIN):
    masses = np.ones(4)
    masses[floor] += size
    return chain.but(masses=masses)


def with_damper(size, story, chain=CHAIN):
    """The dashpot that damps the first mode of the nominal chain by `size` of critical."""
    drift = np.diff(SHAPES[:, 0], prepend=0.0)[story]
    rate = np.zeros(4)
    rate[story] = 2.0 * size * OMEGA[0] / drift**2
    return chain.but(dashpots=rate)


def on_soft_ground(rocking=None, sway=None):
    """Base motions in shares of the static roof displacement under the same acceleration."""
    roof = NOMINAL.static_roof
    spring = None if rocking is None else HEIGHTS.sum() * HEIGHTS[-1] / (rocking * roof)
    return CHAIN.but(rocking=spring, sway=None if sway is None else 4.0 / (sway * roof))


def gained(size, row):
    factor = np.ones((4, 1))
    factor[row] += size
    return CHAIN.frf(GRID) * factor


def building_text(damping=None, effects=""):
    """The benchmark's file on the grid of these data, with another damping law or with effects."""
    text = (Path(__file__).parents[2] / "models" / "shear_4dof.toml").read_text()
    grid, prior = text.index("[frequency_grid]"), text.index("[prior.theta]")
    own = f'[frequency_grid]\nstart = "0.1 Hz"\nstep = "0.1 Hz"\ncount = {GRID.size}\n\n'
    law, rest = text.index("[damping]"), text.index("[observation]")
    head, tail = text[:grid] + own + text[prior:law], text[rest : text.index("[provenance]")]
    return head + (damping or text[law:rest]) + tail + effects


def write(path, frf, seed=3, sd=SD, phase=True):
    """An FRF table as users write it, with independent errors of the stated size."""
    error = sd * np.random.default_rng(seed).standard_normal((2, *frf.shape))
    seen = frf * np.exp(error[0] + 1j * error[1])
    if phase:
        names = [f"{f}_{part}" for f in FLOORS for part in ("re", "im")]
        parts = np.stack([seen.real, seen.imag], axis=1).reshape(-1, seen.shape[1])
    else:
        names, parts = list(FLOORS), np.abs(seen)
    head = ",".join(["frequency_hz", *names, *(f"{f}_sd" for f in FLOORS)])
    rows = [
        ",".join(f"{v:.9g}" for v in (f, *column, *[sd] * 4))
        for f, column in zip(GRID, parts.T, strict=True)
    ]
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("diagnose")
    (folder / "four.toml").write_text(building_text())
    made = Study(folder / "study")
    open_study(made, str(folder / "four.toml"))
    return made


@pytest.fixture
def diagnosed(study, tmp_path):
    """A function: the report on an FRF (4, k)."""

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


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nothing_is_found_where_nothing_is_missing(diagnosed, seed):
    report = diagnosed(CHAIN.frf(GRID), seed=seed)
    found = report.diagnosis
    assert found.verdict == "none"
    assert found.p_value > 0.01
    np.testing.assert_allclose(found.base.theta()[0], THETA, rtol=0.02)
    assert report.as_dict()["where"] == []
    assert report.screen == ()


NAMED = {
    "added_mass@3F": (with_mass(0.15).frf(GRID), 0.15),
    "added_mass@RF": (with_mass(-0.1, 3).frf(GRID), -0.1),
    "foundation_rocking@base": (on_soft_ground(rocking=0.1).frf(GRID), 0.1),
    "story_damper@4F": (with_damper(0.02, 2).frf(GRID), 0.02),
    "channel_gain@4F": (gained(0.06, 2), 0.06),
    "swapped_channels@3F,4F": (CHAIN.frf(GRID)[[0, 2, 1, 3]], None),
    "reversed_channel@2F": (CHAIN.frf(GRID) * np.array([[-1], [1], [1], [1]]), None),
    "channel_delay@RF": (
        CHAIN.frf(GRID) * np.exp(-2j * np.pi * GRID * np.array([[0], [0], [0], [0.003]])),
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
    for part in found.leading.placed.place.split(","):
        # The base has its own word.
        assert part in found.sentence or (part == "base" and "foundation" in found.sentence)
    if size is not None:
        assert abs(found.leading.size - size) < 3.0 * found.leading.size_sd
    # With the effect the factors are the true ones again.
    theta, sd = found.leading.fitted.theta()
    assert (np.abs(theta - THETA) < 4.0 * sd).all()
    assert report.as_dict()["where"]


FAR_OFF = with_mass(-0.41, 1, NOMINAL.but(springs=1000.0 * np.array([1.11, 0.85, 0.9, 1.52])))


@pytest.fixture
def hidden_from_tests(monkeypatch):
    """The first steps of a fit with every effect would find it otherwise."""
    monkeypatch.setattr("femupdate.discrepancy.diagnose._worth_all", lambda *_: False)


@pytest.mark.parametrize("verdict", ["partly", "ambiguous", "unknown"])
def test_where_the_answer_is_open_an_effect_is_looked_for_from_afar(monkeypatch, verdict):
    """An answer that is certain, and leaves nothing, is kept."""
    first = SimpleNamespace(verdict="named", findings=(), scores=(), close=())
    asked = []
    monkeypatch.setattr(search, "diagnose", lambda *_: first)
    monkeypatch.setattr(search, "_run_off", lambda model, problem, base, found, *_: (0, 0, found))
    monkeypatch.setattr(search, "global_fit", lambda *_: asked.append(first.verdict))
    assert search.sought(None, None, None)[2] is first
    assert asked == []
    first.verdict = verdict
    assert search.sought(None, None, None)[2] is first
    assert asked == [verdict]


def test_an_effect_that_draws_theta_far_off_is_looked_for_from_afar(
    diagnosed, monkeypatch, hidden_from_tests
):
    near = []

    def seen(*given, **options):
        found = diagnose(*given, **options)
        near.append(found.verdict)
        return found

    monkeypatch.setattr(search, "diagnose", seen)
    found = diagnosed(FAR_OFF.frf(GRID)).diagnosis
    assert (found.verdict, found.leading.placed.label) == ("named", "added_mass@3F")
    assert abs(found.leading.size + 0.41) < 4.0 * found.leading.size_sd
    assert near[0] in ("unknown", "partly")


def test_the_damping_law_is_named_where_the_model_has_another(diagnosed, tmp_path):
    """Constant in the model, Rayleigh in truth, anchored at f1 and 6 f1 of the nominal chain."""
    constant = '[prior.zeta]\nlower = 0.005\nupper = 0.1\n\n[damping]\nlaw = "constant"\n'
    building = tmp_path / "constant.toml"
    building.write_text(building_text(constant + "ratio = 0.03\n\n"))
    first = OMEGA[0] / (2.0 * np.pi)
    rayleigh = CHAIN.but(proportional=chains.rayleigh(0.03, first, 6.0 * first))
    found = diagnosed(rayleigh.frf(GRID), str(building)).diagnosis
    assert found.verdict == "named"
    assert found.leading.placed.label == "damping_law@rayleigh"
    assert abs(found.leading.size - 1.0) < 3.0 * found.leading.size_sd
    assert found.leading.fitted.zeta == pytest.approx(0.03, rel=0.05)


def test_a_swaying_base_of_a_shear_chain_cannot_be_seen(diagnosed):
    """The base spring in series with the first story is a softer first story, exactly."""
    size = 0.1
    report = diagnosed(on_soft_ground(sway=size).frf(GRID))
    assert report.diagnosis.verdict == "none"
    assert "base_sway@base" in report.as_dict()["cannot_be_seen"]
    # 4 kg stand on the base spring: 1/k = 1/k_1 + size x roof / 4.
    in_series = 1.0 / (1.0 / THETA[0] + 1000.0 * size * NOMINAL.static_roof / 4.0)
    assert report.diagnosis.base.theta()[0][0] == pytest.approx(in_series, rel=0.01)


TOWER = (np.array([0.3, 0.3]), np.array([60.0, 60.0]), np.array([0.3, 0.3]))
OUTSIDE = {
    "distortion": CHAIN.frf(GRID) * np.exp(0.3 * ((GRID - 8.0) / 8.0) ** 3),
    "second building on the roof": CHAIN.but(tower=TOWER).frf(GRID),
    "resonance of a bracket": CHAIN.frf(GRID)
    * np.where(np.arange(4) == 1, 1.0, 0.0)[:, None]
    * (1.0 / (1.0 - (GRID / 13.0) ** 2 + 0.05j))
    + CHAIN.frf(GRID) * np.where(np.arange(4) == 1, 0.0, 1.0)[:, None],
}


@pytest.mark.parametrize("what", OUTSIDE)
def test_what_is_not_in_the_catalogue_leaves_something_unexplained(diagnosed, what):
    report = diagnosed(OUTSIDE[what])
    assert report.diagnosis.verdict in ("unknown", "ambiguous", "partly")
    assert report.diagnosis.left.size > 0.02
    assert "still off by" in report.diagnosis.sentence
    assert report.diagnosis.p_value < 1e-6
    assert report.as_dict()["where"]  # but told where it sits
    if what != "distortion":
        assert report.diagnosis.verdict == "partly"
        assert "of the misfit beyond the noise" in report.diagnosis.sentence
    if what == "resonance of a bracket":
        assert "removes none" in report.diagnosis.sentence
        assert STANDS_IN in report.diagnosis.sentence
        worst = max(report.diagnosis.residuals, key=lambda cell: cell.excess)
        assert worst.floor == "3F"
        assert worst.band_hz[1] > 10.0


def test_phase_is_left_out_where_asked(diagnosed):
    """A delay shows in nothing but the phase."""
    found = diagnosed(NAMED["channel_delay@RF"][0], use_phase=False).diagnosis
    assert found.verdict == "none"
    assert not any(one.placed.effect.needs_phase for one in found.scores)


def test_the_same_effect_from_amplitudes_alone(study, tmp_path):
    source = ObservationSource(write(tmp_path / "abs.csv", NAMED["added_mass@3F"][0], phase=False))
    found = diagnose_study(study, open_study(study), source).diagnosis
    assert found.verdict == "named"
    assert found.leading.placed.label == "added_mass@3F"


def test_sampled_evidence_agrees_with_laplace(diagnosed):
    """On the leading effect, whose posterior is nearly normal."""
    frf = with_mass(0.03).frf(GRID)
    plain = diagnosed(frf).diagnosis.leading
    drawn = diagnosed(frf, settings=DiagnosisSettings(sampled=2)).diagnosis.leading
    assert drawn.placed.label == plain.placed.label == "added_mass@3F"
    assert drawn.evidence.error > 0.0
    assert drawn.evidence.log_evidence == pytest.approx(
        plain.evidence.log_evidence, abs=0.5 + 4.0 * drawn.evidence.error
    )


def test_an_effect_that_the_building_lists_is_not_looked_for_again(diagnosed, tmp_path):
    """The file says 15 %, the truth is 15 %: nothing is left."""
    listed = '\n[[effects]]\nname = "added_mass"\nplace = "3F"\n[effects.parameters]\nsize = 0.15\n'
    building = tmp_path / "listed.toml"
    building.write_text(building_text(effects=listed))
    found = diagnosed(NAMED["added_mass@3F"][0], str(building)).diagnosis
    assert found.verdict == "none"
    assert found.p_value > 0.01
    (size,), (sd,) = found.base.sizes()
    assert abs(size - 0.15) < 3.0 * sd
    assert "added_mass@3F" not in {one.placed.label for one in found.scores}


def test_the_report_has_the_promised_keys_and_its_file(heavier):
    told = heavier.as_dict()
    assert "(share of the floor's mass" in told["effects"][0]["size_in_words"]
    assert {"p_value", "verdict", "effects", "where", "seconds"} <= set(told)
    assert {
        "name",
        "place",
        "certified",
        "log_evidence_on_other_data",
        "log_evidence_over_none",
        "size",
        "size_sd",
        "absorbed_by_theta",
    } <= set(told["effects"][0])
    # As if the catalogue were complete.
    assert "probability" not in told["effects"][0]
    assert {"floor", "band_hz", "excess", "data"} == set(told["where"][0])
    assert 0.5 < told["effects"][0]["absorbed_by_theta"] < 1.0
    assert told["effects"][0]["added_mass_kg"] is None  # masses of that building are nominal
    kept = json.loads(heavier.path.read_text())
    assert kept["verdict"] == "named"
    assert kept["effects"][0]["name"] == "added_mass"
    assert heavier.path.name == "diagnosis.json"


def test_two_effects_that_others_imitate_are_repaired(study, tmp_path):
    """Mass and rocking together: by themselves each explains less than half."""
    both = with_mass(0.1, chain=on_soft_ground(rocking=0.1))
    path = write(tmp_path / "both.csv", both.frf(GRID), sd=0.01)
    home = Study(shutil.copytree(study.folder, tmp_path / "both"))
    report = repair_study(home, open_study(home), ObservationSource(path))
    done = report.repair
    sizes = {one.finding.placed.label: one.finding.size for one in done.rounds}
    assert sizes == {
        "foundation_rocking@base": pytest.approx(0.1, rel=0.1),
        "added_mass@3F": pytest.approx(0.1, rel=0.1),
    }
    before, after = report.in_turn
    assert before > 10.0 > 1.5 > after
    told = report.as_dict()
    assert [told[f"halves_chi2_{when}"] for when in ("before", "after")] == [before, after]
    assert f"kept out in turn: error (chi2 a point) {before:.1f} -> " in "\n".join(report.lines())


def test_a_factor_that_ends_at_its_limit_is_told(diagnosed, study, heavier, tmp_path):
    """theta_2 is 1.3, which a narrow prior leaves out."""
    narrow = tmp_path / "narrow.toml"
    text = study.path("building.toml").read_text()
    narrow.write_text(re.sub(r"(\[prior.theta\][^\[]*upper = )[\d.]+", r"\g<1>1.2", text))
    report = diagnosed(CHAIN.frf(GRID), str(narrow))
    (told,) = report.limits
    assert told.startswith("Without effects theta_2 (1.2) ends at the prior's limit")
    assert report.as_dict()["screen"][0] == told
    assert heavier.limits == ()


def test_six_notes_of_a_diagnosis_are_printed_the_decisive_first(heavier):
    many = replace(heavier, limits=("at its limit",), screen=tuple(f"note {k}" for k in range(8)))
    printed = [line for line in many.lines() if line.startswith("  - ")]
    assert len(many.notes) > 8
    assert printed[0] == "  - at its limit"
    assert printed[1:6] == [f"  - {note}" for note in many.notes[1:6]]
    assert printed[6:] == [f"  - {len(many.notes) - 6} more notes: diagnosis.json in the study"]
    assert many.as_dict()["screen"] == list(many.limits + many.screen)


def test_pictures_of_a_diagnosis(heavier, tmp_path):
    pictures = draw(heavier, tmp_path / "pictures")
    assert [path.name for path in pictures] == ["residual_map.png", "effect_ranking.png"]
    for path in pictures:
        assert path.stat().st_size > 5000


def test_the_bench_top_frame(tmp_path):
    """Real data of a frame that is no exact chain: something is said, and it is not "none"."""
    path = SHARED / "mini_flexible_sine1p0.csv"
    if not path.exists():
        pytest.skip("the measured data are not beside this checkout")
    home = Study(tmp_path / "bench")
    columns = {"time_s": "t_s", "base": "a_base", "2F": "a_1F", "3F": "a_2F", "RF": "a_3F"}
    source = ObservationSource(path, "m/s2", columns, band_hz=(0.5, 18.0))
    report = diagnose_study(home, open_study(home, "shear_3dof"), source)
    found = report.diagnosis
    assert found.verdict in ("named", "partly", "ambiguous", "indistinguishable", "unknown")
    assert found.p_value < 1e-3
    best = min(one.fitted.chi2 for one in found.findings)
    assert best < 0.9 * found.base.chi2
    assert load_building(home.path("building.toml")).effects == ()
