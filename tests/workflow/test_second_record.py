"""Two records at different levels: softening is named, put into the building, and left out."""

import importlib.util
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from femupdate.discrepancy.residual_map import p_value
from femupdate.errors import BuildingError, MeasurementError
from femupdate.measurement.record import GroundMotion
from femupdate.simulation import parse_effect
from femupdate.study import Study
from femupdate.workflow.amplitude import level_between
from femupdate.workflow.diagnose import diagnose_study
from femupdate.workflow.model import open_study
from femupdate.workflow.observed import ObservationSource
from femupdate.workflow.predict import predict_study
from femupdate.workflow.prediction_inputs import PredictionSettings, RecordSource
from femupdate.workflow.repair import repair_study

MASSES, SPRINGS = np.array([3.0, 2.0, 1.5]), np.array([9e3, 5e3, 4e3])
THETA, STEP = np.array([0.8, 1.4, 1.1]), 0.01
SOFTER, TIMES = 0.8, 4.0
BUILDING = """\
name = "three"
kind = "shear"
{stories}
[frequency_grid]
start = "0.2 Hz"
step = "0.1 Hz"
count = 150

[prior.theta]
lower = 0.5
upper = 2

[prior.zeta]
lower = 0.01
upper = 0.1

[damping]
law = "constant"
ratio = 0.04
"""
STORY = '[[stories]]\nname = "S{n}"\nmass = "{m} kg"\nstiffness = "{k} N/m"\n'


def _chain(theta, zeta):
    path = Path(__file__).parents[1] / "discrepancy" / "chain.py"
    spec = importlib.util.spec_from_file_location("second_chain", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Chain(MASSES, theta * SPRINGS, zeta=zeta)


def _write(path, chain, seed, rms):
    """Noise of an rms (m/s2) at the base, then rest, with the floors' exact response."""
    rng = np.random.default_rng(seed)
    count = 12_000
    frequency = np.fft.rfftfreq(count, STEP)
    white = np.fft.rfft(rng.standard_normal(count))
    white[(frequency < 0.15) | (frequency > 18.0)] = 0.0
    base = np.fft.irfft(white, count) * (np.arange(count) < count - 1000)
    frf = np.ones((4, frequency.size), dtype=complex)
    frf[1:, 1:] = chain.frf(frequency[1:])
    motion = np.fft.irfft(frf * np.fft.rfft(rms / base.std() * base), count, axis=1)
    motion += 0.002 * rng.standard_normal(motion.shape)
    rows = [f"{n * STEP:.2f}," + ",".join(f"{v:.7g}" for v in r) for n, r in enumerate(motion.T)]
    path.write_text("\n".join(["time_s,base,2F,3F,RF", "s,m/s2,m/s2,m/s2,m/s2", *rows]) + "\n")


def _shake(path, chain, seed, newtons):
    """A shaker on the roof with an rms force (N), then rest, with the floors' exact response."""
    rng, count = np.random.default_rng(seed), 12_000
    w = 2.0 * np.pi * np.fft.rfftfreq(count, STEP)
    white = np.fft.rfft(rng.standard_normal(count))
    white[(w < 2.0) | (w > 110.0)] = 0.0
    force = np.fft.irfft(white, count) * (np.arange(count) < count - 1000)
    force *= newtons / force.std()
    own, shapes = chain.modes
    modes = -(w**2) / (own[:, None] ** 2 - w**2 + 2j * chain.zeta * own[:, None] * w)
    frf = np.vstack([np.ones(w.size), (shapes * shapes[-1]) @ modes])
    motion = np.fft.irfft(frf * np.fft.rfft(force), count, axis=1)
    motion[1:] += 0.002 * rng.standard_normal((3, count))
    rows = [f"{n * STEP:.2f}," + ",".join(f"{v:.7g}" for v in r) for n, r in enumerate(motion.T)]
    head = "time_s,force/RF (N),2F (m/s2),3F (m/s2),RF (m/s2)"
    path.write_text("\n".join([head, *rows]) + "\n")


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    folder = tmp_path_factory.mktemp("second")
    stories = "".join(
        STORY.format(n=n, m=m, k=k) for n, (m, k) in enumerate(zip(MASSES, SPRINGS, strict=True), 1)
    )
    (folder / "three.toml").write_text(BUILDING.format(stories=stories))
    one_story = THETA * np.array([1.0, SOFTER, 1.0])
    _write(folder / "weak.csv", _chain(THETA, 0.04), 1, 0.3)
    _write(folder / "strong.csv", _chain(SOFTER * THETA, 0.05), 2, TIMES * 0.3)
    _write(folder / "one.csv", _chain(one_story, 0.04), 3, TIMES * 0.3)
    _write(folder / "same.csv", _chain(THETA, 0.04), 4, TIMES * 0.3)
    _shake(folder / "gentle.csv", _chain(THETA, 0.04), 5, 0.5)
    _shake(folder / "hard.csv", _chain(SOFTER * THETA, 0.05), 6, 2.0)
    (folder / "table.csv").write_text(
        "frequency_hz,2F,3F,RF\n" + "".join(f"{f},1,1,1\n" for f in range(1, 16))
    )
    (folder / "modes.csv").write_text("mode,frequency_hz\n1,4.0\n2,11.0\n")
    return folder


@pytest.fixture
def study(home, tmp_path):
    return Study(tmp_path / "study")


def _open(study, home):
    return open_study(study, str(home / "three.toml"))


@pytest.fixture(scope="module")
def repaired(home):
    """What repair made of the weak and the strong record; its study is only read."""
    study = Study(home / "softened")
    weak, strong = (ObservationSource(home / name) for name in ("weak.csv", "strong.csv"))
    return repair_study(study, _open(study, home), weak, second=strong)


def test_softening_is_named_repaired_and_of_the_right_size(repaired, study, home):
    report, model = repaired, _open(study, home)
    weak, strong = (ObservationSource(home / name) for name in ("weak.csv", "strong.csv"))
    assert [one.finding.placed.label for one in report.repair.rounds] == ["amplitude_softening@all"]
    content = tomllib.loads(report.building_path.read_text())
    own = content["effects"][0]["parameters"]
    level = level_between(model, weak, strong)
    assert (1.0 + own["size"]) ** level == pytest.approx(SOFTER, rel=0.01)
    assert (1.0 + own["damping"]) ** level == pytest.approx(1.25, rel=0.1)
    np.testing.assert_allclose(report.theta_after.mean(axis=0), THETA, rtol=0.01)
    before, after = (
        p_value(fit.likelihood, fit) for fit in (report.repair.before, report.repair.after)
    )
    assert before < 1e-6
    assert after > 0.05
    # The repaired building is an ordinary one: the first record alone is explained by it.
    again = diagnose_study(report.study, open_study(report.study, None), weak)
    assert again.diagnosis.verdict == "none"


def test_a_stronger_shaker_shows_softening_as_a_stronger_base_motion_does(study, home):
    model = _open(study, home)
    low, high = (ObservationSource(home / name) for name in ("gentle.csv", "hard.csv"))
    report = diagnose_study(study, model, low, second=high)
    assert report.diagnosis.verdict == "named"
    leading = report.diagnosis.leading
    assert leading.placed.label == "amplitude_softening@all"
    assert (1.0 + leading.size) ** level_between(model, low, high) == pytest.approx(
        SOFTER, rel=0.02
    )


def test_the_story_that_softens_is_found(study, home):
    weak, one = (ObservationSource(home / name) for name in ("weak.csv", "one.csv"))
    report = diagnose_study(study, _open(study, home), weak, second=one)
    assert report.diagnosis.verdict == "named"
    assert report.diagnosis.leading.placed.label == "amplitude_softening@S2"
    assert any("times the level" in note for note in report.screen)


def test_a_stronger_record_of_the_same_building_names_nothing(study, home):
    weak, same = (ObservationSource(home / name) for name in ("weak.csv", "same.csv"))
    report = diagnose_study(study, _open(study, home), weak, second=same)
    assert report.diagnosis.verdict == "none"
    tested = [one.placed.effect.name for one in report.diagnosis.scores]
    assert "amplitude_softening" in tested


def test_one_record_cannot_show_it(study, home):
    report = diagnose_study(study, _open(study, home), ObservationSource(home / "weak.csv"))
    assert "amplitude_softening" not in [o.placed.effect.name for o in report.diagnosis.scores]


@pytest.mark.parametrize("name", ["table.csv", "modes.csv"])
def test_neither_a_table_nor_modes_have_a_level(study, home, name):
    table, weak = (ObservationSource(home / one) for one in (name, "weak.csv"))
    with pytest.raises(MeasurementError, match="do not say at which level"):
        diagnose_study(study, _open(study, home), weak, second=table)


def test_one_simulation_has_one_level(study, home):
    building = _open(study, home).building
    with pytest.raises(BuildingError, match="two levels"):
        parse_effect(building, "amplitude_softening@all", (-0.1,))


def test_another_strong_motion_is_predicted_with_the_stiffness_at_its_level(
    repaired, home, monkeypatch, write_record
):
    """A record kept out, of the softened chain: the factors alone hold for weak motion."""
    other = home / "other.csv"
    _write(other, _chain(SOFTER * THETA, 0.05), 9, TIMES * 0.3)
    base = np.loadtxt(other, delimiter=",", skiprows=2, usecols=1)
    record = write_record(home / "other_base.csv", GroundMotion(base, STEP))

    def predicted():
        return predict_study(
            repaired.study,
            open_study(repaired.study),
            RecordSource(record),
            PredictionSettings(samples=4),
            measured=other,
        )

    report = predicted()
    # 0.002 m/s2 of noise and the errors of what was found from two records.
    assert (report.comparison.relative_error < 0.05).all()
    (told,) = re.findall(r"motion is ([0-9.]+) times as strong", " ".join(report.notes))
    # Floors answer to noise as the root of base motion squared over damping.
    assert float(told) == pytest.approx(TIMES * np.sqrt(0.04 / 0.05), rel=0.05)
    assert not any("beyond" in note for note in report.notes)
    np.testing.assert_allclose(report.story_stiffness.mean, SOFTER * THETA * SPRINGS, rtol=0.02)
    monkeypatch.setattr("femupdate.workflow.amplitude.changes_with_level", lambda _: False)
    assert (predicted().comparison.relative_error > 0.3).all()
