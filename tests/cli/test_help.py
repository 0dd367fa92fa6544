"""Help that can be followed: headings, examples that parse, files that exist; time left; shells."""

import io
import itertools
import os
import shlex
import subprocess
import sys
import time
from contextlib import redirect_stderr
from importlib.resources import files

import click
import pytest
from click.testing import CliRunner
from femupdate.cli.main import group

from femupdate import bars

COMMANDS = group.list_commands(click.Context(group))
WITH_EXAMPLES = [name for name in COMMANDS if name != "benchmark"]


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_examples_in_the_help_are_commands_that_exist(name):
    text = CliRunner().invoke(group, [name, "--help"]).stdout
    lines = [line for line in text.splitlines() if line.startswith("    femupdate ")]
    assert lines
    for line in lines:
        _, called, *words = shlex.split(line)
        command = group.get_command(click.Context(group), called)
        parser = command.make_parser(click.Context(command))
        parser.parse_args(list(words))  # an unknown option is an error
        for word in words:
            if word.startswith("examples/"):
                assert (
                    files("femupdate.examples").joinpath(word.removeprefix("examples/")).is_file()
                )


def test_options_have_headings_in_the_order_of_the_work():
    text = CliRunner().invoke(group, ["calibrate", "--help"]).stdout
    headings = [line for line in text.splitlines() if line.endswith(":") and line[0] != " "]
    assert headings == ["What is read:", "How it is done:", "What is written:", "General:"]
    read, written = text.index("What is read:"), text.index("What is written:")
    assert read < text.index("\n  --sensors") < text.index("\n  --particles") < written
    assert written < text.index("\n  --name")


def test_a_log_tells_the_time_that_is_left(monkeypatch):
    clock = iter([0.0, 1.0, 30.0, 40.0, 61.0, 100.0])
    monkeypatch.setattr(bars.time, "monotonic", lambda: next(clock))
    log = io.StringIO()
    with redirect_stderr(log):
        work = bars._Log("Sampling", 10)
        for _ in range(5):
            work.advance(1, "")
    assert log.getvalue().splitlines() == [
        "  Sampling: 20 %, about 2 min left",
        "  Sampling: 40 %, about 2 min left",
        "  Sampling: 50 %, about 2 min left",
    ]


def test_a_step_that_says_nothing_tells_how_long_it_takes(monkeypatch):
    ticks = itertools.count(0.0, 25.0)
    monkeypatch.setattr(bars.time, "monotonic", lambda: next(ticks))
    log = io.StringIO()
    with redirect_stderr(log), bars.Bars() as shown:
        shown.start("Thinking", 1)
        for _ in range(100):  # every second a thread looks; on a busy machine later
            time.sleep(0.1)
            if "so far" in log.getvalue():
                break
    assert log.getvalue().splitlines()[:2] == ["Thinking ...", "  Thinking: about 25 s so far"]


def test_a_shell_completes_commands_and_options():
    asked = {"_FEMUPDATE_COMPLETE": "bash_complete", "COMP_CWORD": "1"}
    for words, cword, found in (
        ("femupdate cal", "1", "calibrate"),
        ("femupdate calibrate --na", "2", "--name"),
    ):
        done = subprocess.run(
            [sys.executable, "-c", "from femupdate.cli.main import main; main()"],
            env={**os.environ, **asked, "COMP_WORDS": words, "COMP_CWORD": cword},
            capture_output=True,
            text=True,
        )
        assert f"plain,{found}" in done.stdout.splitlines()
