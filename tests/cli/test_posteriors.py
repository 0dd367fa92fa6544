"""Several posteriors in one study, studies that are only read, starting over, workbooks."""

import shlex
import shutil

import pytest

from tests.cli.commands import femupdate
from tests.helpers import snapshot

FEW = ("--exact", "--particles", 200, "--no-pictures")


@pytest.fixture(scope="module")
def study(tower_study, tower_observation, record, tmp_path_factory):
    """The tower with a posterior from both floors and one from the roof, each with a prediction."""
    folder = tmp_path_factory.mktemp("two") / "study"
    shutil.copytree(tower_study, folder)
    few = ("--samples", 10, "--no-pictures", "--study", folder)
    path = tower_observation.path
    for words in (
        ("calibrate", path, "--sensors", "RF", *FEW, "--name", "roof", "--study", folder),
        ("predict", "--record", record, *few),
        ("predict", "--record", record, "--scale", 2, *few, "--posterior", "roof"),
    ):
        done = femupdate(*words)
        assert done.code == 0, done.err
    return folder


def test_a_second_posterior_leaves_the_first_alone(study, tower_study):
    first, both = snapshot(tower_study), snapshot(study)
    assert both["posterior.nc"] == first["posterior.nc"]
    assert both["posterior_summary.json"] == first["posterior_summary.json"]
    roof = {"posterior.nc", "posterior_summary.json", "prediction.nc", "tables/frf_fit.csv"}
    assert {f"posteriors/roof/{name}" for name in roof} <= set(both)
    assert both["prediction.nc"] != both["posteriors/roof/prediction.nc"]


def test_status_names_both_and_how_to_make_them_again(study, tower_observation):
    items = {
        one["name"]: one for one in femupdate("status", "--study", study, "--json").answer["items"]
    }
    assert {"posterior", "prediction", "roof posterior", "roof prediction"} <= set(items)
    assert {one["state"] for one in items.values()} == {"current"}
    again = items["roof posterior"]["again"]
    few = "--exact --particles 200 --no-pictures"
    assert again == f"calibrate {tower_observation.path} --sensors RF {few} --name roof"
    rest = "--scale 2 --samples 10 --no-pictures --posterior roof"
    assert items["roof prediction"]["again"].endswith(rest)


def test_a_command_is_proposed_whole(tower_file, tower_observation, tmp_path):
    """Units and names of columns, without which the file could not be read again."""
    lines = tower_observation.path.read_text(encoding="utf-8").splitlines()
    names = next(k for k, line in enumerate(lines) if line.startswith("time_s"))
    values = [[float(part) for part in line.split(",")] for line in lines[names + 2 :]]
    rows = [",".join(f"{v / (1.0 if k == 0 else 9.80665):.9g}" for k, v in enumerate(row))
            for row in values]  # fmt: skip
    path, study = tmp_path / "in g.csv", tmp_path / "study"
    path.write_text("\n".join(["time_s,a 0,a 1,a 2", *rows]), encoding="utf-8")
    words = ("calibrate", path, "--unit", "g", "--columns", "base=a 0,2F=a 1,RF=a 2", *FEW)
    where = ("--study", study)
    told = femupdate(*words, "--building", tower_file, "--json", "-v", f"--study={study}")
    assert told.code == 0, told.err
    path.write_text("\n".join(["time_s,a 0,a 1,a 2", *rows, ""]), encoding="utf-8")
    (one,) = femupdate("status", *where, "--json").answer["next"]
    program, *again = shlex.split(one["command"])
    assert [program, *again] == ["femupdate", *map(str, (*words, *where))]
    assert femupdate(*again).code == 0
    assert "predict" in femupdate("status", *where, "--json").answer["next"][0]["command"]


def test_a_new_roof_posterior_makes_only_its_own_prediction_stale(
    study, tower_observation, tmp_path
):
    copy = shutil.copytree(study, tmp_path / "copy")
    words = ("calibrate", tower_observation.path, "--sensors", "RF", *FEW, "--name", "roof")
    assert femupdate(*words, "--seed", 5, "--study", copy).code == 0
    items = femupdate("status", "--study", copy, "--json").answer["items"]
    stale = {one["name"] for one in items if one["state"] == "stale"}
    assert stale == {"roof prediction"}


def test_a_page_elsewhere_leaves_the_study_as_it_is(study, tmp_path):
    before = snapshot(study)
    words = ("report", "--posterior", "roof", "-o", tmp_path / "roof.html")
    assert femupdate(*words, "--study", study).code == 0
    assert "scaled by 2" in (tmp_path / "roof.html").read_text(encoding="utf-8")
    assert snapshot(study) == before
