"""Help that can be followed: headings, examples that parse, files that exist; time left; shells."""

import io
import os
import re
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

from femupdate.bars import Bars

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


@pytest.mark.parametrize(
    ("total", "done", "told"),
    [
        (100, 25, r"  Working: 25 %, \d\d:\d\d left, at it"),
        (4, 1, r"  Working: 1 of 4 steps, \d\d:\d\d so far, at it"),
        (1, 0, r"  Working: \d\d:\d\d so far"),
    ],
)
def test_a_log_tells_again_and_again_how_far_a_step_is(total, done, told):
    log = io.StringIO()
    with redirect_stderr(log), Bars(every=0.1) as shown:
        shown.start("Working", total)
        shown.advance(done, "at it" * bool(done))
        for _ in range(100):  # on a busy machine the thread that looks comes later
            time.sleep(0.05)
            if log.getvalue().count("\n") > 3:
                break
    first, *lines = log.getvalue().splitlines()
    assert first == "Working ..."
    assert len(lines) > 2
    assert all(re.fullmatch(told, line) for line in lines), lines


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
