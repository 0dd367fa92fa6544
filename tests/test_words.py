"""The documentation is plain English, its links hold, and its commands exist."""

import re
from pathlib import Path

import click
import pytest
from femupdate.cli.main import group

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
LONGEST_LINE, LONGEST_SENTENCE = 99, 29
PAGES = [
    *(ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")),
    *sorted(DOCS.rglob("*.md")),
]
PAGES = [page for page in PAGES if page.exists()]

pages = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))


def without_code(text):
    """The text with blocks of code left out, line by line."""
    return re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)


def plain_lines(text):
    """Lines that are neither code nor part of a table."""
    lines = without_code(text).splitlines()
    return [line for line in lines if not line.startswith(("|", "    "))]


def sentences(text):
    """Sentences of the prose; headings, items and paragraphs end one."""
    blocks = re.split(r"\n\s*\n|\n(?=#|\s*[-*] |\d+\. )", "\n".join(plain_lines(text)))
    for block in blocks:
        joined = " ".join(re.sub(r"\]\([^)]*\)", "]", re.sub(r"`[^`]*`", "code", block)).split())
        yield from re.split(r"(?<=[.!?])[\"*)\]]*\s+(?=[\w\"*\[(|!])", joined)


def words(sentence):
    return re.findall(r"[A-Za-z]\S*|\d\S*", sentence)


@pages
def test_lines_are_short(page):
    lines = plain_lines(page.read_text(encoding="utf-8"))
    assert [line for line in lines if len(line) > LONGEST_LINE] == []


@pages
def test_sentences_are_short(page):
    found = sentences(page.read_text(encoding="utf-8"))
    assert [sentence for sentence in found if len(words(sentence)) > LONGEST_SENTENCE] == []


def anchors(page):
    """Anchors of the headings, as GitHub makes them."""
    heads = re.findall(r"^#+ (.*)$", without_code(page.read_text(encoding="utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head).strip().lower().replace(" ", "-") for head in heads}


@pages
def test_links_lead_somewhere(page):
    text = without_code(page.read_text(encoding="utf-8"))
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith(("http://", "https://")):
            continue
        file, _, anchor = target.partition("#")
        there = page if not file else (page.parent / file).resolve()
        assert there.exists(), f"{target}: no such file"
        assert not anchor or anchor in anchors(there), f"{target}: no such heading"


@pages
def test_scripts_exist(page):
    for script in re.findall(
        r"python ((?:examples|models|tests)/\S+\.py)", page.read_text(encoding="utf-8")
    ):
        assert (DOCS.parent / script).exists(), f"{script}: no such file"


def commands(command, path=()):
    """Every command with the words that call it."""
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            yield from commands(command.get_command(context, name), (*path, name))
    else:
        yield " ".join(path), command


def options(command):
    return {name for option in command.params for name in (*option.opts, *option.secondary_opts)}


KNOWN = dict(commands(group))


def called(text):
    """Command and options of every `femupdate ...` in code, lines that go on joined."""
    joined = text.replace("\\\n", " ")
    code = re.findall(r"`([^`\n]+)`", joined)
    code += [
        line
        for block in re.findall(r"```\n(.*?)```", joined, re.DOTALL)
        for line in block.splitlines()
    ]
    for line in code:
        for part in line.split("&&"):
            given = part.split("#")[0].split()
            if "femupdate" in given[:1]:
                yield given[1:]


@pages
def test_commands_and_options_exist(page):
    for given in called(page.read_text(encoding="utf-8")):
        if not given or given[0] in ("COMMAND", "--help", "--version"):
            continue
        depth = 2 if given[0] == "benchmark" else 1
        name = " ".join(given[:depth])
        if name == "benchmark" or name.endswith(" NAME"):
            continue
        assert name in KNOWN, f"femupdate {name}"
        used = {word.partition("=")[0] for word in given if re.match(r"--?[a-z]", word)}
        assert used <= options(KNOWN[name]) | {"--help"}, f"femupdate {name}"
