"""Every command on a study that lies on a disk which nobody, root included, can write to."""

import json
import subprocess
import sys

import click
import pytest
from femupdate.cli.main import group

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
FEW = ("--exact", "--particles", "200", "--no-pictures")
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
        "calibrate": (path, *FEW),
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
