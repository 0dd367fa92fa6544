"""The benchmark `interruptions`, on small scripts that behave well or badly."""

import subprocess
import sys
from dataclasses import dataclass

import numpy as np
import pytest
from femupdate.benchmarks.interruptions import trials
from femupdate.benchmarks.interruptions.commands import Interruptible
from femupdate.benchmarks.interruptions.trials import Reference, interrupt, reference

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes and disks of Linux")

# Writes a number that it first counts up to, in steps that a kill can come between.
GOOD = """\
import os, sys, time
from pathlib import Path
study = Path(sys.argv[2]); study.mkdir(exist_ok=True)
print("Counting ...", "  Counting: 50 %, about 5 s left", sep="\\n", file=sys.stderr)
print("  Counting: 60 %, about 4 min left, 7 found", file=sys.stderr)
print("  Counting: 2 of 3 steps, about 25 s so far, 7 found", file=sys.stderr)
time.sleep(1.0)
try:
    (study / "new").write_text("7" * 3000); os.replace(study / "new", study / "result")
except OSError as error:
    (study / "new").unlink(missing_ok=True)
    sys.exit(f"Error: cannot write {study}: {error.strerror}")
"""
FORGETFUL = GOOD.replace("'7'", "str(os.getpid())").replace('"7"', "str(os.getpid())")
UNTIDY = GOOD.replace("time.sleep(1.0)", '(study / ".x-0a.part").write_text("half")')
TALKATIVE = GOOD.replace('sys.exit(f"Error: cannot write', 'sys.exit(f"Traceback: at')


@dataclass(frozen=True)
class Script(Interruptible):
    """A script in place of a command."""

    def call(self, study):
        return [sys.executable, *self.words, "--study", str(study)]


@pytest.fixture
def script(tmp_path):
    def make(text):
        path = tmp_path / "script.py"
        path.write_text(text.replace("sys.argv[2]", "sys.argv[-1]"))
        return Script("script", (str(path),), "result", lambda found: found.read_text())

    return make


# Kills come within half a second, where the script sleeps for a whole one.
KNOWN = Reference("7" * 3000, 0.5, 3000, 8 * 4096)


def interrupted(one, kind, tmp_path, known=KNOWN):
    return interrupt(one, kind, known, tmp_path / "study", np.random.default_rng(1))


@pytest.mark.parametrize("kind", ["killed", "file limit"])
def test_a_good_command_loses_nothing(script, tmp_path, kind):
    found = interrupted(script(GOOD), kind, tmp_path)
    assert found.interrupted
    assert found.wrong == ()


@pytest.mark.skipif(not trials.can_mount(), reason="this user may not mount a disk in memory")
def test_a_small_disk(script, tmp_path):
    assert interrupted(script(GOOD), "disk full", tmp_path).wrong == ()


def test_an_undisturbed_run_is_measured(script, tmp_path):
    known = reference(script(GOOD), tmp_path / "reference")
    assert (known.digest, known.largest, known.total) == ("7" * 3000, 3000, 3000)
    assert known.seconds > 1.0


def test_an_orphan_is_counted(monkeypatch):
    monkeypatch.setattr(trials, "_DEATH_S", 0.2)
    process = subprocess.Popen(["sh", "-c", "sleep 5 &"], start_new_session=True)
    process.wait()
    assert trials._survivors(process.pid) == 1


def test_another_result_is_told(script, tmp_path):
    found = interrupted(script(FORGETFUL), "killed", tmp_path)
    assert found.wrong == ("the second run ended with another result",)


def test_what_is_left_behind_is_told(script, tmp_path):
    assert "left behind: .x-0a.part" in interrupted(script(UNTIDY), "killed", tmp_path).wrong


def test_more_than_one_sentence_is_told(script, tmp_path):
    (found,) = interrupted(script(TALKATIVE), "file limit", tmp_path).wrong
    assert found.startswith("it ended with 1: Traceback")


def test_processes_that_have_ended_are_none():
    process = subprocess.Popen([sys.executable, "-c", ""], start_new_session=True)
    process.wait()
    assert trials._survivors(process.pid) == 0
