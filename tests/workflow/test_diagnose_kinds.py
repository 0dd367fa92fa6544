"""Effects hidden in identified modes and in responses to forces of a chain solved by hand."""

import json

import numpy as np
import pytest

from femupdate.errors import InferenceError
from femupdate.report import draw
from femupdate.study import Study
from femupdate.workflow import ObservationSource, diagnose_study, open_study, repair_study
from tests.chains import Chain

FLOORS, THETA, ZETA = ("2F", "3F", "RF"), np.array([0.7, 1.3, 0.9]), 0.02
GRID = np.arange(0.5, 18.0, 0.2)


PLAIN = Chain(np.ones(3), 3000.0 * THETA, zeta=ZETA)


def heavy(size, floor=1):
    masses = np.ones(3)
    masses[floor] += size
    return PLAIN.but(masses=masses)


def write_modes(path, chain, seed=1, signs=(1, 1, 1), extra=0):
    """A table of modes with errors of .2 % of frequencies and .01 of shapes."""
    (omega, shapes), rng = chain.modes, np.random.default_rng(seed)
    rows = []
    for number, (own, shape) in enumerate(
        zip(omega, (np.array(signs)[:, None] * shapes).T, strict=True), 1
    ):
        scaled = shape / np.abs(shape).max() + 0.01 * rng.standard_normal(3)
        hertz = own / (2.0 * np.pi) * np.exp(0.002 * rng.standard_normal())
        ratio = ZETA * np.exp(0.1 * rng.standard_normal())
        rows.append((number, hertz, 0.002 * hertz, ratio, *scaled, *[0.01] * 3))
    rows += [(9 + k, 15.0 + k, 0.1, 0.02, 1, 1, 1, *[0.01] * 3) for k in range(extra)]
    floors = ",".join([*FLOORS, *(f"{floor}_sd" for floor in FLOORS)])
    head = f"mode,frequency_hz,frequency_sd_hz,damping,{floors}"
    path.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


def write_force(path, chain, seed=1, gain=1.0, sd=0.05):
    """Accelerance of all floors to a hammer on the roof; `gain` is that of 3F's sensor."""
    K, M, C, *_ = chain._matrices()
    load = np.eye(3)[2]
    curves = [-(w**2) * np.linalg.solve(K + 1j * w * C - w**2 * M, load) for w in 2 * np.pi * GRID]
    noise = sd * np.random.default_rng(seed).standard_normal((GRID.size, 3))
    values = np.abs(curves) * np.exp(noise) * np.array([1.0, gain, 1.0])
    names = [f"{floor}/RF (m/s2/N)" for floor in FLOORS] + [f"{floor}/RF_sd" for floor in FLOORS]
    rows = [",".join(map(str, (f, *own, *[sd] * 3))) for f, own in zip(GRID, values, strict=True)]
    path.write_text("\n".join([",".join(["frequency_hz", *names]), *rows]) + "\n")
    return path


@pytest.fixture
def study(tmp_path):
    made = Study(tmp_path / "study")
    open_study(made, "shear_3dof")
    return made


@pytest.fixture
def diagnosed(study):
    """A function: the report on files."""

    def run(*paths, **options):
        source = ObservationSource(paths[0], further=paths[1:])
        return diagnose_study(study, open_study(study), source, **options)

    return run


def test_a_reversed_sensor_is_named_by_modes(diagnosed, tmp_path):
    path = write_modes(tmp_path / "seen.csv", PLAIN, signs=(1, -1, 1))
    found = diagnosed(path).diagnosis
    assert (found.verdict, found.leading.placed.label) == ("named", "reversed_channel@3F")
    assert found.leading.tested is None  # modes stand for one another


UNSEEN = {
    write_modes: {"channel_delay@2F", "story_damper@3F", "base_gain@base", "tuned_appendage@RF"},
    write_force: {"base_gain@base", "table_pitch@base", "channel_delay@RF"},
}


@pytest.mark.parametrize("write", [write_modes, write_force])
def test_nothing_is_found_where_nothing_is_missing(study, diagnosed, tmp_path, write):
    """And what such data cannot show is told."""
    report = diagnosed(write(tmp_path / "seen.csv", PLAIN, 5))
    assert report.diagnosis.verdict == "none"
    assert report.diagnosis.p_value > 0.01
    assert all(path.exists() for path in draw(report, study.path("pictures")))
    unseen = set(report.as_dict()["cannot_be_seen"])
    assert unseen >= UNSEEN[write]
    assert not any(label.startswith("added_mass") for label in unseen)
    halves = any("cannot be parted in two" in line for line in report.lines())
    assert halves == (write is write_modes)


def test_both_kinds_together_certify_what_is_hidden(diagnosed, tmp_path):
    files = [
        write(tmp_path / f"{write.__name__}.csv", heavy(0.3))
        for write in (write_modes, write_force)
    ]
    found = diagnosed(*files).diagnosis
    assert found.leading.placed.label == "added_mass@3F"
    assert abs(found.leading.size - 0.3) < 4.0 * found.leading.size_sd
    assert found.leading.tested.certified
    assert {cell.data for cell in found.residuals} == {"force at RF", "modes"}


HELD = {
    "modes": (write_force, write_modes, "frequencies, damping ratios and shapes"),
    "force": (write_modes, write_force, "ln|H|"),
}


@pytest.mark.parametrize("case", HELD)
def test_repair_adds_what_was_hidden_and_data_of_another_kind_carry_it(study, tmp_path, case):
    fitted, kept, compared = HELD[case]
    path = fitted(tmp_path / "seen.csv", heavy(0.3))
    other = kept(tmp_path / "kept.csv", heavy(0.3), 9)
    model = open_study(study)
    report = repair_study(study, model, ObservationSource(path), ObservationSource(other))
    done = report.repair
    assert [one.finding.placed.label for one in done.rounds] == ["added_mass@3F"]
    assert done.after.chi2 < 0.3 * done.before.chi2
    before, after = (
        abs(one.mean(0) - THETA).max() for one in (report.theta_before, report.theta_after)
    )
    assert after < before
    assert "added_mass" in report.building_path.read_text()
    assert all(path.exists() for path in draw(report, study.path("pictures")))
    held = report.held
    assert held.lines()[0].startswith(f"kept.csv, kept out: error of {compared} (chi2 a point)")
    before, after = held.figures["chi2"]
    assert after < 1.6 < 0.5 * before
    told = json.loads(report.path.read_text())
    assert told["verdict"] == "repaired"
    assert told["holdout_error_after"] is None
    assert told["holdout_chi2_after"] == pytest.approx(after)


def test_what_predicts_a_hammer_test_worse_is_not_added(study, tmp_path):
    """The modes are of a heavier floor, and the hammer hit the building as modelled."""
    modes = write_modes(tmp_path / "modes.csv", heavy(0.3))
    hammer = write_force(tmp_path / "hammer.csv", PLAIN)
    report = repair_study(
        study, open_study(study), ObservationSource(modes), ObservationSource(hammer)
    )
    assert "added_mass@3F" in [one.placed.label for one in report.repair.refused]
    # What the modes only hint at may go in, where it predicts the hammer test better.
    added = [one.finding.placed.label for one in report.repair.rounds]
    assert "added_mass@3F" not in added
    before, after = report.held.figures["chi2"]
    assert (after < before) == bool(added)


def test_a_model_that_errs_by_more_than_its_modes_allow_is_not_explained(diagnosed, tmp_path):
    """The building is stiffer than its prior allows."""
    path = write_modes(tmp_path / "modes.csv", PLAIN.but(springs=20.0 * PLAIN.springs))
    found = diagnosed(path).diagnosis
    assert found.verdict == "unknown"
    assert "farther off than their errors allow" in found.sentence


def test_files_that_cannot_be_explained(study, diagnosed, tmp_path):
    many = write_modes(tmp_path / "many.csv", PLAIN, extra=1)
    with pytest.raises(InferenceError, match="holds 4 modes but the model has 3"):
        diagnosed(many)
    assert not study.path("diagnosis.json").exists()
