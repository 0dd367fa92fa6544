"""The benchmark `memory`: what a command takes, and what it may take."""

import sys

import pytest
from femupdate.benchmarks.memory import run
from femupdate.benchmarks.result import Job
from femupdate.cli.main import group

from femupdate.errors import StudyError

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")


def test_a_command_is_measured_once_and_marked_above_the_limit(tmp_path, monkeypatch):
    report, over = run.run_memory(Job(tmp_path), "list")
    measured = report.content()["commands"]
    assert over == 0
    assert list(measured) == ["list"]
    assert 20.0 < measured["list"]["peak_mb"] < 2000.0
    monkeypatch.setattr(run, "MOST_MB", 1.0)
    report, over = run.run_memory(Job(tmp_path), "list")
    assert over == 1
    assert report.content()["commands"] == measured
    assert report.text.endswith("| ! |")


def test_a_command_that_fails_is_told(tmp_path, monkeypatch):
    failing = run.Measured("inspect", ("inspect", "nowhere.csv"))
    monkeypatch.setattr(run, "commands", lambda folder: [failing])
    with pytest.raises(StudyError, match=r"inspect did not end well: .*nowhere.csv"):
        run.run_memory(Job(tmp_path))


def test_every_command_is_measured_in_an_order_that_works(tmp_path):
    """All commands but those that take no work, and what one reads is written before."""
    names = [one.words[0] for one in run.commands(tmp_path)]
    assert names.index("build-model") < names.index("calibrate") < names.index("predict")
    assert names.index("simulate") < names.index("repair")
    assert set(group.modules) - set(names) == {"benchmark", "examples"}
