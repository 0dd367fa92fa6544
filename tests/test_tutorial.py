"""The second half of the tutorial runs as it stands and prints what the page shows."""

import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner
from femupdate.cli.main import group

PAGE = Path(__file__).resolve().parent.parent / "docs" / "tutorial" / "first-hour.md"
NUMBER = re.compile(r"[-+]?\d+\.?\d*(e[-+]?\d+)?")


def blocks():
    """Blocks of code without a language, from the model that is wrong to the repaired one."""
    text = PAGE.read_text(encoding="utf-8")
    part = text[text.index("## 4.") : text.index("## 7.")]
    return re.findall(r"^```\n(.*?)^```", part, flags=re.MULTILINE | re.DOTALL)


def called(block):
    """Arguments of every command in a block, none where it shows output."""
    lines = block.replace("\\\n", " ").splitlines()
    return [shlex.split(line)[1:] for line in lines if line.startswith("femupdate ")]


def shape(line):
    """A line with its numbers left open, for they may differ in the last digits."""
    return " ".join(NUMBER.sub("#", line).split())


@pytest.mark.slow
def test_the_tutorial_prints_what_it_shows(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(PAGE.parents[2] / "examples")
    printed = ""
    for block in blocks():
        commands = called(block)
        for words in commands:
            result = CliRunner().invoke(group, words, catch_exceptions=False)
            assert result.exit_code == 0, result.output
            printed = result.stdout
        if not commands:
            seen = [shape(line) for line in printed.splitlines()]
            shown = [shape(line) for line in block.splitlines() if line.strip() != "..."]
            assert [one for one in shown if not any(s.startswith(one) for s in seen)] == []
    errors = re.search(r"error of the histories (\S+) -> (\S+),", printed)
    before, after = float(errors[1]), float(errors[2])
    assert before > 0.1
    assert after < 0.1
    assert (tmp_path / "four" / "repaired" / "building.toml").exists()
