"""Posteriors by name, and commands that only read."""

import json
import shlex
import shutil
import subprocess
import sys

import click
import pytest
from femupdate.cli.main import group

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


DISK = """
mount -t tmpfs none "$0" && cp -r "$1" "$0/study" && mount -o remount,ro "$0" && shift && exec "$@"
"""
CALLS = """
import json, sys
from click.testing import CliRunner
from femupdate.cli.main import group
done = [CliRunner().invoke(group, words) for words in json.load(sys.stdin)]
json.dump([(one.exit_code, one.stdout, one.stderr) for one in done], sys.stdout)
"""
ELSEWHERE = "or copy it to another folder and name that"
SHORT = ("--exact", "--particles", "200", "--no-pictures")
# Far enough to show that the study was read, and not for minutes.
SOON_ENDED = {"compare": "come from the same measurement"}
WITHOUT_STUDY = {"inspect", "identify", "list", "examples", "benchmark"}


def on_read_only_disk(study, folder, commands):
    """Exit code, stdout and stderr of commands where the study lies on such a disk."""
    disk = folder / "disk"
    disk.mkdir()
    call = ["unshare", "-rm", "sh", "-c", DISK, disk, study, sys.executable, "-c", CALLS]
    words = [[*map(str, one), "--study", str(disk / "study")] for one in commands]
    done = subprocess.run(
        [str(word) for word in call], input=json.dumps(words), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def can_mount():
    try:
        call = ["unshare", "-rm", "mount", "-t", "tmpfs", "none", "/mnt"]
        return subprocess.run(call, capture_output=True).returncode == 0
    except FileNotFoundError:
        return False


@pytest.mark.skipif(not can_mount(), reason="this user may not mount a disk in memory")
def test_what_only_reads_works_on_a_read_only_study_and_the_rest_says_what_to_do(
    tower_study, tower_file, tower_observation, record, tmp_path
):
    path, posterior = tower_observation.path, tower_study / "posterior.nc"
    # What writes into a study, and what reads it alone.
    writing = {
        "build-model": (tower_file, "--no-pictures"),
        "train": ("--samples", 200, "--epochs", 1, "--batch", 64, "--fresh"),
        "calibrate": (path, *SHORT),
        "predict": ("--record", record, "--samples", 10, "--no-pictures"),
        "render": ("--samples", 5, "--modes", 1),
        "diagnose": (path, "--no-pictures"),
        "repair": (path, "--no-pictures"),
        "demo": (),
    }
    reading = {
        "status": (),
        "report": ("-o", tmp_path / "page.html"),
        "compare": (posterior, posterior),
        "simulate": ("-o", tmp_path / "made.csv", "--duration", 20),
    }
    assert {*writing, *reading} | WITHOUT_STUDY == {*group.list_commands(click.Context(group))}
    refused = [*writing.items(), ("report", ())]
    calls = [(name, *words) for name, words in (*refused, *reading.items())]
    ended = on_read_only_disk(tower_study, tmp_path, calls)
    for (name, *_), (code, out, err) in zip(calls[: len(refused)], ended, strict=False):
        assert (code, out) == (1, ""), name
        assert err.count("\n") == 1, err
        assert "cannot write" in err, name
        assert ELSEWHERE in err, err
    for (name, *_), (code, _, err) in zip(
        calls[len(refused) :], ended[len(refused) :], strict=True
    ):
        assert code == 0 if name not in SOON_ENDED else SOON_ENDED[name] in err, (name, err)
    assert (tmp_path / "page.html").exists()
    assert (tmp_path / "made.csv").exists()
