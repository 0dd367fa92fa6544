"""Tables for spreadsheets hold what was computed, one thing a row, with units."""

import csv

import numpy as np
import pytest
from click.testing import CliRunner
from femupdate.cli.main import group

from femupdate.building import load_building
from femupdate.dynamics import CutMember, MemberForces, Statistics
from femupdate.inference import load_posterior
from femupdate.report.quantities import member_tables, quantities, tidy_table
from femupdate.result import Result
from tests.helpers import write_record


def rows_of(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def folder(tower_study, tower_observation, tmp_path_factory):
    """Tables that `predict` and `render` write into a study, and the answer of `predict`."""
    import json
    import shutil

    from femupdate.measurement import GroundMotion

    study = shutil.copytree(tower_study, tmp_path_factory.mktemp("tables") / "study")
    histories = tower_observation.histories
    motion = GroundMotion(histories.acceleration[0][:1000], histories.time_step)
    record = write_record(study.parent / "record.csv", motion)
    words = ["predict", "--record", record, "--samples", 20, "--no-pictures", "--json"]
    words.append("--floor-spectra")
    done = CliRunner().invoke(group, [*map(str, words), "--study", str(study)])
    answer = json.loads(done.stdout)
    assert answer["tables"] == [str(study / "tables" / name) for name in PREDICTED]
    return study, answer


@pytest.mark.parametrize(("shear", "units"), [(0.6, ["N", "N/mm"]), (6e4, ["kN", "kN/mm"])])
def test_units_suit_bench_top_models_and_buildings(tower_file, shear, units):
    one = np.full((4, 2), shear)
    found = quantities(load_building(tower_file), ("low", "high"), [one] * 4, 9)
    assert [found[key].unit for key in ("base", "stiffness")] == units
    newton = {"N": 1.0, "kN": 1e3}[units[0]]
    assert found["base"].values[0, 0] * newton == pytest.approx(shear)
    assert found["stiffness"].values[0, 0] * newton * 1e3 == pytest.approx(shear)


PREDICTED = ("predicted_peaks.csv", "floor_spectra.csv", "floor_histories.csv")


def test_predicted_peaks(folder):
    study, answer = folder
    rows = rows_of(study / "tables" / "predicted_peaks.csv")
    assert [row["place"] for row in rows if row["quantity"] == "peak drift"] == ["low", "high"]
    by_key = {(row["quantity"], row["place"]): row for row in rows}
    stiffness = answer["story_stiffness_n_per_m"]["1"]["mean"]
    kept = by_key["stiffness", "low"]
    assert kept["unit"] == "kN/mm"
    assert float(kept["mean"]) == pytest.approx(stiffness / 1e6)
    base, first = by_key["peak base shear", "base"], by_key["peak shear", "low"]
    # Sums of a column alone and beside others are rounded otherwise.
    assert float(base["mean"]) == pytest.approx(float(first["mean"]), rel=1e-12)
    # All masses of the tower but none of its base: 5 t.
    weight = 100.0 * float(base["mean"]) / float(by_key[SHARE]["mean"])
    assert weight == pytest.approx(5.0 * 9.80665, rel=1e-6)
    assert [one["mean"] for one in answer["peaks"]] == [float(row["mean"]) for row in rows]


SHARE = ("peak base shear over weight", "base")


@pytest.fixture
def members():
    """A wall and a beam whose forces are known."""
    wall = CutMember("wall", "X2:S1", np.zeros((2, 3)), ("N", "V", "M"), 0)
    beam = CutMember("beam", "(1, 0, 2.7) to (1.2, 0, 2.7) m", np.zeros((2, 3)), ("N_start",), 0)
    found = []
    for member, size in ((wall, [5514.0, 32320.0, 40940.0]), (beam, [80.69])):
        mean = np.array(size)
        peak = Statistics(mean, 0.01 * mean, 0.98 * mean, 1.02 * mean)
        found.append(MemberForces(member, mean[:, None], 0.0 * mean[:, None], peak))
    return found


def test_largest_forces_of_members_have_one_unit_each(members):
    head, rows = tidy_table("peaks", [], members).sheet()
    assert [row[:3] for row in rows] == [
        ("largest N", "kN", "wall 1, X2:S1"),
        ("largest V", "kN", "wall 1, X2:S1"),
        ("largest M", "kN m", "wall 1, X2:S1"),
        ("largest N start", "kN", "beam 2, (1, 0, 2.7) to (1.2, 0, 2.7) m"),
    ]
    assert rows[1][3:] == pytest.approx((32.32, 0.3232, 31.6736, 32.9664))
    assert len(rows[0]) == len(head)


class Members(Result):
    """Forces of members alone."""

    def __init__(self, members):
        self.members = members

    def items(self):
        return member_tables(self.members)


def test_largest_forces_of_members_are_told_without_exponents(members):
    text = "\n".join(Members(members).lines())
    assert "wall 1, X2:S1: largest forces\n" in text
    assert "  V, kN    32.32 [31.67, 32.97]\n" in text
    assert "e+0" not in text


def test_the_posterior_and_its_responses(calibrated, tower_observation, tower_file):
    words = ["calibrate", tower_observation.path, "--exact", "--particles", 200, "--no-pictures"]
    done = CliRunner().invoke(group, [*map(str, words), "--study", str(calibrated)])
    assert done.exit_code == 0, done.output
    assert "story high" in done.stdout
    rows = rows_of(calibrated / "tables" / "posterior.csv")
    assert [row["of"] for row in rows] == ["story low", "story high", "damping ratio"]
    draws = load_posterior(calibrated / "posterior.nc").samples
    assert [float(row["mean"]) for row in rows[:2]] == pytest.approx(draws.mean(axis=0).tolist())
    fit = rows_of(calibrated / "tables" / "frf_fit.csv")
    assert {row["floor"] for row in fit} == {"2F", "RF"}
    used = [row for row in fit if row["used"] == "1"]
    ratio = [float(row["predicted_abs_h"]) / float(row["measured_abs_h"]) for row in used]
    assert np.median(np.abs(np.log(ratio))) < 0.1
