"""Every command line of README, tutorial and guides is one that the program takes."""

import re
import shlex
from pathlib import Path

import click
import pytest
from femupdate.cli.main import group

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("[!a]*/*.md"))]
NAMED = re.compile(r"[\w/-]+\.(?:csv|toml|bdf|uff|nc)\b")


def command_lines(page):
    """Command lines of blocks and, whole, between backticks."""
    text = page.read_text(encoding="utf-8")
    blocks = re.findall(r"^```\w*\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    # In a sentence a command may stand for all its calls.
    inline = [line for line in re.findall(r"`(femupdate [^`]*)`", text) if "." in line]
    said = [line.removeprefix("$ ").strip() for line in (*lines, *inline)]
    return [line for line in said if line.startswith("femupdate ")]


LINES = [(page.name, line) for page in PAGES for line in dict.fromkeys(command_lines(page))]


@pytest.mark.parametrize(("page", "line"), LINES)
def test_the_program_takes_the_line(page, line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in NAMED.findall(line):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("", encoding="utf-8")
    words = shlex.split(line.partition("  #")[0])[1:]
    with click.Context(group, info_name="femupdate") as above:
        name, command, rest = group.resolve_command(above, words)
        command.make_context(name, list(rest), parent=above)
