"""The documentation is plain English, its links hold, and it is complete beside the code."""

import re
import types
import typing
from itertools import pairwise
from pathlib import Path

import click
import pytest
from femupdate.cli.main import group
from pydantic import BaseModel

from femupdate.building.schema import Building
from femupdate.effects.registry import CATALOGUE
from femupdate.measurement.registry import readers

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
LONGEST_LINE, LONGEST_SENTENCE = 99, 29
PAGES = [
    *(ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")),
    *sorted(DOCS.rglob("*.md")),
]
PAGES = [page for page in PAGES if page.exists()]
# Results are figures and tables, some of them written by benchmarks.
PROSE = [page for page in PAGES if DOCS / "results" not in page.parents]
EFFECTS = DOCS / "reference" / "effects.md"
COMMANDS = DOCS / "reference" / "commands.md"

pages = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
prose = pytest.mark.parametrize("page", PROSE, ids=lambda page: str(page.relative_to(ROOT)))


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


@prose
def test_lines_are_short(page):
    lines = plain_lines(page.read_text(encoding="utf-8"))
    assert [line for line in lines if len(line) > LONGEST_LINE] == []


@prose
def test_sentences_are_short(page):
    found = sentences(page.read_text(encoding="utf-8"))
    assert [one for one in found if len(words(one)) > LONGEST_SENTENCE] == []


def test_long_sentences_are_found():
    text = "Short one. " + "word " * LONGEST_SENTENCE + "end.\n\n- item\n- " + "word " * 10
    assert [len(words(one)) for one in sentences(text)] == [2, LONGEST_SENTENCE + 1, 1, 10]


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


def test_pictures_are_used_and_small():
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    for picture in (DOCS / "pictures").iterdir():
        assert f"pictures/{picture.name}" in text
        assert 5_000 < picture.stat().st_size < 300_000


def commands(command, path=()):
    """Every command with the words that call it."""
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            yield from commands(command.get_command(context, name), (*path, name))
    else:
        yield " ".join(path), command


def options(command):
    return {text for one in command.params for text in (*one.opts, *one.secondary_opts)}


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
            own = part.split("#")[0].split()
            if "femupdate" in own[:1]:
                yield own[1:]


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


def sections(page):
    """Text of every section by its heading."""
    parts = re.split(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return dict(pairwise(parts[1:]))


@pytest.mark.parametrize("name", [name for name in KNOWN if not name.startswith("benchmark")])
def test_the_reference_has_every_option(name):
    found = sections(COMMANDS)
    text = found[name] + found["Options of every command"]
    if name == "repair":
        text += found["diagnose"]
    listed = {one for one in options(KNOWN[name]) if one.startswith("-")}
    missing = [one for one in listed if not re.search(rf"`[^`]*{one}\b", text)]
    assert missing == [], f"describe them in docs/reference/commands.md, section {name}"


def test_the_how_to_has_every_benchmark():
    text = (DOCS / "how-to" / "benchmarks.md").read_text(encoding="utf-8")
    benchmarks = [name for name in KNOWN if name.startswith("benchmark ")]
    assert [name for name in benchmarks if f"`femupdate {name}`" not in text] == []


def test_the_reference_has_every_reader():
    text = (DOCS / "reference" / "files.md").read_text(encoding="utf-8")
    assert [name for name in readers() if f"| `{name}` |" not in text] == []


def test_the_map_has_every_package():
    text = (DOCS / "explanation" / "where-things-are.md").read_text(encoding="utf-8")
    packages = [path.parent.name for path in (ROOT / "femupdate").glob("*/__init__.py")]
    assert [name for name in packages if f"| `{name}` |" not in text] == []


def models(annotation):
    """All pydantic models that a field's type names."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    if isinstance(annotation, types.UnionType) or typing.get_origin(annotation) is not None:
        for part in typing.get_args(annotation):
            yield from models(part)


def keys_of(annotation, seen):
    """Keys that a building file may have."""
    for model in models(annotation):
        if model in seen:
            continue
        seen.add(model)
        for name, field in model.model_fields.items():
            yield field.alias or name
            yield from keys_of(field.annotation, seen)


def test_the_reference_has_every_key_of_the_building_file():
    text = (DOCS / "reference" / "building-file.md").read_text(encoding="utf-8")
    keys = set(keys_of(Building, set()))
    assert {"youngs_modulus", "from", "stiffness_per_mass", "merge", "anchors"} <= keys
    code = " ".join(a or b for a, b in re.findall(r"`([^`\n]+)`|^(.*=.*)$", text, re.MULTILINE))
    assert [key for key in sorted(keys) if not re.search(rf"\b{key}\b", code)] == []


def rows_of_effects():
    """Cells of the catalogue's table by the name of the effect."""
    lines = EFFECTS.read_text(encoding="utf-8").splitlines()
    cells = [line.replace(r"\|", "/").strip("| ").split(" | ") for line in lines]
    return {own[0].strip("`"): own for own in cells if len(own) == 6 and own[0].startswith("`")}


def test_every_effect_has_its_row():
    assert set(rows_of_effects()) == set(CATALOGUE)


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_row_says_what_the_catalogue_says(name):
    effect, row = CATALOGUE[name], rows_of_effects()[name]
    _, _, parameters, sentence, confused, settled = row
    assert sentence.startswith(effect.sentence.replace("|", "/"))
    for one in effect.parameters:
        assert f"{one.text} ({one.unit}): {one.scale:g}, {one.lower:g} to {one.upper:g}" in (
            parameters
        )
    assert all(f"`{other}`" in confused for other in effect.confused_with)
    assert settled == effect.settled_by
